"""The certificate of a gait: all requirements, with their margins."""

from __future__ import annotations

import contextlib
import math
import reprlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cassie_gaits.certificate import states
from cassie_gaits.certificate.rollout import POINTS, Step, integrate
from cassie_gaits.certificate.table import Row, row, speed_rows, step_rows, travel
from cassie_gaits.certificate.walker import Walker
from cassie_gaits.certificate.walker import walker as equations
from cassie_gaits.errors import GaitLibraryError, KinematicsError
from cassie_gaits.gait_library import Gait, mirror, mirror_passive, mirror_torques

POSITION_TOLERANCE = 1e-5
VELOCITY_TOLERANCE = 1e-4
IMPACT_TOLERANCE = 1e-3
RESIDUAL_TOLERANCE = 0.05

_SAME = 1e-12


@dataclass(frozen=True)
class Certificate:
    """Result of the check of a gait.

    Attributes:
        rows: Every requirement; if both steps were integrated, for the worse step.
        mirrored: Whether the left step is exactly the right one's mirror image, so that one step
            on a symmetric pelvis stands for both.
    """

    rows: tuple[Row, ...]
    mirrored: bool

    @property
    def met(self) -> bool:
        """Whether every requirement is met."""
        return all(entry.met for entry in self.rows)

    def as_document(self) -> dict[str, Any]:
        """The certificate as an entry of the library's file."""
        return {
            "met": self.met,
            "points": POINTS,
            "mirrored": self.mirrored,
            "worst": {entry.name: float(f"{entry.worst:.6g}") for entry in self.rows},
        }


@dataclass(frozen=True)
class Terms:
    """The values of a gait's request that the table and the model need.

    Attributes:
        clearance: Least height of the swing foot at mid-step. In m.
        slope: Rise of the ground ahead. In rad.
        symmetric: Whether the pelvis counts as symmetric.
        payload: Additional mass at the pelvis's centre of mass. In kg.
    """

    clearance: float
    slope: float
    symmetric: bool
    payload: float


def terms(gait: Gait) -> Terms:
    """The terms of a gait.

    Raises:
        GaitLibraryError: if a term is missing or invalid.
    """
    request = gait.solver.get("request")
    if not isinstance(request, Mapping):
        raise GaitLibraryError("the gait does not say its clearance, slope and symmetry")
    symmetric = request.get("symmetric")
    if not isinstance(symmetric, bool):
        shown = reprlib.repr(symmetric)
        raise GaitLibraryError(f"its request's symmetric is {shown}, expected true or false")
    payload = _asked(request, "payload", 0.0, 30.0) if "payload" in request else 0.0
    return Terms(
        _asked(request, "clearance", 0.0, 1.0),
        _asked(request, "slope", -1.0, 1.0),
        symmetric,
        payload,
    )


def _asked(request: Mapping[str, Any], name: str, low: float, high: float) -> float:
    value = request.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        shown = reprlib.repr(value)
        raise GaitLibraryError(f"its request's {name} is {shown}, expected {low:g} .. {high:g}")
    return float(value)


@contextlib.contextmanager
def motion_that_may_break() -> Iterator[None]:
    """Turn all errors that a motion far from any gait's can raise into one kind of error.

    Raises:
        GaitLibraryError: if the motion leaves the model's range, or an equation has no solution.
    """
    try:
        with np.errstate(all="ignore"):
            yield
    except KinematicsError as error:
        reason = " ".join(str(error).split())
        raise GaitLibraryError(f"its motion leaves the robot's range: {reason}") from None
    except (ArithmeticError, np.linalg.LinAlgError) as error:
        raise GaitLibraryError(f"its motion has no solution: {error}") from None


def certify(gait: Gait) -> Certificate:
    """Check a gait.

    Raises:
        GaitLibraryError: if the gait has no torques, no passive motion or no request, or if the
            integration of its motion fails before the end.
    """
    if gait.torques is None or gait.passive is None:
        raise GaitLibraryError("the gait has no torques or no passive motion to check")
    asked = terms(gait)
    with motion_that_may_break():
        walker = equations(symmetric=asked.symmetric, slope=asked.slope, payload=asked.payload)
        mirrored = asked.symmetric and mirror_image(gait)
        steps = [integrate(walker, gait, domain) for domain in ((0,) if mirrored else (0, 1))]
        rows = [_step(walker, gait, step, asked.clearance) for step in steps]
        worse = [min(pair, key=lambda entry: entry.margin) for pair in zip(*rows, strict=True)]
        first = travel(walker, steps[0])
        second = (first[0], -first[1], -first[2]) if mirrored else travel(walker, steps[1])
        return Certificate((*worse, *speed_rows(gait, first, second)), mirrored)


def mirror_image(gait: Gait) -> bool:
    """Whether the step on the left leg is exactly the mirror image of that on the right."""
    if gait.torques is None or gait.passive is None:
        return False
    pairs = (
        (mirror(gait.coefficients[0]), gait.coefficients[1]),
        (mirror_passive(gait.passive[0]), gait.passive[1]),
        (mirror_torques(gait.torques[0]), gait.torques[1]),
    )
    return all(bool(np.abs(a - b).max() <= _SAME) for a, b in pairs)


def _step(walker: Walker, gait: Gait, step: Step, clearance: float) -> list[Row]:
    position, velocity = _after_impact(walker, gait, step)
    inf = math.inf
    return [
        row("end of the step, position", "m, rad", -inf, POSITION_TOLERANCE, step.position_error),
        row("end of the step, velocity", "/s", -inf, VELOCITY_TOLERANCE, step.velocity_error),
        row("start of the next step, position", "m, rad", -inf, IMPACT_TOLERANCE, position),
        row("start of the next step, velocity", "/s", -inf, IMPACT_TOLERANCE, velocity),
        row("outputs on the way", "m, rad", -inf, VELOCITY_TOLERANCE, step.output_error),
        row("dynamics between nodes", "Nm", -inf, RESIDUAL_TOLERANCE, step.residual),
        *step_rows(walker, gait, step, clearance),
    ]


def _after_impact(walker: Walker, gait: Gait, step: Step) -> tuple[float, float]:
    """Difference between the state after the impact and the start of the next step.

    Both are expressed in the frame of the new stance foot, which is rotated against the old one.
    """
    _, swing = states.legs(step.domain)
    yaw = travel(walker, step)[2]
    after = walker.impact(step.q[-1], step.v[-1], swing, yaw)
    next_q, next_v = states.state(walker, gait, 1 - step.domain, 0.0)
    q, v = step.q[-1].copy(), after
    c, s = math.cos(yaw), math.sin(yaw)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    origin = walker.tree.sole(q, swing)[0]
    q[:3] = turn @ (q[:3] - origin)
    q[3] -= yaw
    v = np.concatenate([turn @ v[:3], v[3:]])
    return float(np.abs(q - next_q).max()), float(np.abs(v - next_v).max())
