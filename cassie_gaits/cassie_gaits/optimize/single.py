"""One gait at a time, made while the robot walks: solved from the library's nearest, certified.

The result depends on the conditions only, not on earlier answers or the clock.
"""

from __future__ import annotations

import enum
import math
import time
from dataclasses import dataclass

from cassie_gaits.certificate.certify import certify
from cassie_gaits.certificate.seal import sealed
from cassie_gaits.errors import GaitLibraryError
from cassie_gaits.gait_library import Gait, GaitLibrary
from cassie_gaits.optimize.request import Request
from cassie_gaits.optimize.solution import Point, point_of, prepare_newton, solve

SLOPE_STEP, PAYLOAD_STEP, SPEED_STEP = 0.01, 0.5, 0.01
"""Steps to which conditions are rounded, so that a noisy estimate gives the same gait. In rad, kg
and m/s or rad/s."""

_RADIUS = 0.25  # m; in the distance of gaits, 1 rad/s of turning rate counts as 0.25 m/s
_PREPARED = 0.5  # m/s, speed of the gaits that `prepare` solves


class Result(enum.IntEnum):
    """Kinds of results, as the constants of Gait.msg."""

    FOUND = 0
    REFUSED = 1
    NOT_FOUND = 2
    NOT_CERTIFIED = 3


@dataclass(frozen=True)
class Conditions:
    """Commanded speeds, and present state of robot and ground.

    Attributes:
        vx, vy: Mean speed ahead and to the left. In m/s.
        yaw_rate: Mean turning rate to the left. In rad/s.
        payload: Additional mass on the pelvis. In kg.
        slope: Rise of the ground ahead. In rad.
    """

    vx: float
    vy: float
    yaw_rate: float
    payload: float
    slope: float

    def rounded(self) -> Conditions:
        """The conditions for which a gait is made; what no gait can be for stays as it is."""
        vx, vy, yaw_rate = (_round(v, SPEED_STEP) for v in (self.vx, self.vy, self.yaw_rate))
        payload, slope = _round(self.payload, PAYLOAD_STEP), _round(self.slope, SLOPE_STEP)
        return Conditions(vx, vy, yaw_rate, payload, slope)


@dataclass(frozen=True, eq=False)
class Answer:
    """Answer for some conditions.

    Attributes:
        result: Kind of the result.
        conditions: Conditions for which the gait was made.
        gait: The gait, with its certificate; None unless the result is FOUND.
        reason: How the gait was found, or why not, in one line.
        solve_time, certify_time: Processor time. In s.
    """

    result: Result
    conditions: Conditions
    gait: Gait | None
    reason: str
    solve_time: float = 0.0
    certify_time: float = 0.0


class GaitMaker:
    """Makes gaits, each from the nearest of a library.

    Args:
        library: Certified library, made by this optimizer.

    Raises:
        GaitLibraryError: if no gait of the library can serve as a start.
    """

    def __init__(self, library: GaitLibrary) -> None:
        self._starts: list[tuple[Gait, Point]] = []
        for gait in library.gaits:
            if gait.passive is not None and "request" in gait.solver:
                self._starts.append((gait, point_of(gait)))
        if not self._starts:
            raise GaitLibraryError("the library has no gait of this optimizer to start from")

    def prepare(self) -> None:
        """Make both programs and solve each once, so that the first gait need not wait for that."""
        for symmetric in (True, False):
            prepare_newton(symmetric=symmetric)
            turn = 0.0 if symmetric else 0.1
            self.make(Conditions(_PREPARED, 0.0, turn, 0.0, 0.0))

    def make(self, conditions: Conditions) -> Answer:
        """The answer for some conditions: solves for a gait and certifies it."""
        conditions = conditions.rounded()
        try:
            request = _request(conditions)
        except GaitLibraryError as error:
            return Answer(Result.REFUSED, conditions, None, str(error))
        started = time.process_time()
        outcome = solve(request, self._nearest(request), patient=False)
        solved = time.process_time()
        if outcome.gait is None:
            reason = f"no gait found in {outcome.iterations} iterations"
            return Answer(Result.NOT_FOUND, conditions, None, reason, solved - started)
        try:
            certificate = certify(outcome.gait)
            missed = ", ".join(row.name for row in certificate.rows if not row.met)
        except GaitLibraryError as error:
            missed = str(error)
        times = solved - started, time.process_time() - solved
        if missed:
            missed = f"not certified: {missed}"
            return Answer(Result.NOT_CERTIFIED, conditions, None, missed, *times)
        gait = sealed(outcome.gait, certificate.as_document())
        reason = f"{outcome.iterations} iterations, cost {outcome.cost:.0f}, certified"
        return Answer(Result.FOUND, conditions, gait, reason, *times)

    def _nearest(self, request: Request) -> Point:
        """Start point: that of the gait with the nearest speeds."""

        def distance(entry: tuple[Gait, Point]) -> float:
            gait = entry[0]
            turn = _RADIUS * (gait.yaw_rate - request.yaw_rate)
            return math.hypot(gait.vx - request.vx, gait.vy - request.vy, turn)

        straight = [e for e in self._starts if e[0].vy == e[0].yaw_rate == 0.0]
        return min(straight if request.symmetric and straight else self._starts, key=distance)[1]


def _request(conditions: Conditions) -> Request:
    """The request for some conditions.

    Raises:
        GaitLibraryError: if a number is not finite or out of range, or the gait turns on a slope.
    """
    straight = conditions.vy == 0.0 and conditions.yaw_rate == 0.0
    if conditions.slope != 0.0 and conditions.yaw_rate != 0.0:
        raise GaitLibraryError("on a slope gaits do not turn")
    return Request(
        conditions.vx,
        conditions.vy,
        conditions.yaw_rate,
        slope=conditions.slope,
        payload=conditions.payload,
        symmetric=straight,
    )


def _round(value: float, step: float) -> float:
    """`value`, rounded to a multiple of a step, as its shortest decimal.

    NaN, infinities and numbers so large that the quotient is infinite stay as they are.
    """
    steps = value / step
    return round(round(steps) * step, 6) + 0.0 if math.isfinite(steps) else value
