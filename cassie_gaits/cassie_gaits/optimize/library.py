"""A whole library: gaits solved from their neighbours, each certified, in several processes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from dataclasses import dataclass, field
from typing import Any

from cassie_gaits.certificate.certify import Certificate, certify
from cassie_gaits.certificate.seal import sealed
from cassie_gaits.certificate.table import Row
from cassie_gaits.errors import GaitLibraryError
from cassie_gaits.gait_library import Gait
from cassie_gaits.optimize.conflicts import Conflict, conflict
from cassie_gaits.optimize.request import Request
from cassie_gaits.optimize.solution import Outcome, Point, exchanged, point_of, solve


@dataclass(frozen=True, eq=False)
class Result:
    """Result of one request.

    Attributes:
        request: The request.
        gait: The gait with its certificate, or None.
        outcome: Outcome of the solver; None for a gait from an earlier run.
        reason: Why there is no gait, in one line; empty if there is one.
    """

    request: Request
    gait: Gait | None
    outcome: Outcome | None
    reason: str = ""


@dataclass
class _Work:
    """State of the running work."""

    nearer: dict[Request, list[Request]]
    waiting: list[Request]
    solving: dict[Future[Outcome], tuple[Request, list[Request]]] = field(default_factory=dict)
    checking: dict[Future[Certificate], Outcome] = field(default_factory=dict)
    explaining: dict[Future[Conflict], tuple[Outcome, str]] = field(default_factory=dict)
    points: dict[Request, Point | None] = field(default_factory=dict)

    @property
    def pending(self) -> list[Future[Any]]:
        """All futures that an executor works on."""
        return [*self.solving, *self.checking, *self.explaining]


def find(
    requests: Sequence[Request], executor: Executor, done: Mapping[Request, Gait | None]
) -> Iterator[Result]:
    """Solve and certify every request; results come as they are ready.

    A gait starts from its mirror image if that is requested, too, otherwise from its neighbour
    nearer to rest. This makes neighbours similar and the solver fast. If it fails, the gait starts
    from another neighbour, and at last from the constant guess. Mirror images differ by the
    pelvis's asymmetry only, so the second one takes a few iterations; it has its own certificate.

    Args:
        requests: Requests, all different.
        executor: Runs the work: local processes or a cluster.
        done: Gaits that exist already; None for requests that are known to fail.
    """
    work = _Work(neighbours(requests), [request for request in requests if request not in done])
    for request, gait in done.items():
        work.points[request] = None if gait is None else point_of(gait)
    try:
        while work.waiting or work.pending:
            _start_ready(work, executor)
            pending = work.pending
            for finished in wait(pending, return_when=FIRST_COMPLETED).done:
                result = _finished(work, executor, finished)
                if result is not None:
                    yield result
    finally:
        for future in work.pending:
            future.cancel()


def neighbours(requests: Sequence[Request]) -> dict[Request, list[Request]]:
    """For each request the other requests from which it can start, best first.

    A gait to the right starts from its mirror image to the left. Another gait starts from one that
    is a step nearer to rest: in turning rate, then in lateral speed, then in sagittal speed.
    """
    names = ("yaw_rate", "vy", "vx")
    by_speeds = {tuple(getattr(r, name) for name in names): r for r in requests}
    axes = [sorted({speeds[i] for speeds in by_speeds}, key=abs) for i in range(len(names))]
    result: dict[Request, list[Request]] = {}
    for speeds, request in by_speeds.items():
        found = []
        for i, value in enumerate(speeds):
            nearer = [v for v in axes[i] if abs(v) < abs(value) and v * value >= 0.0]
            if nearer:
                found.append((*speeds[:i], nearer[-1], *speeds[i + 1 :]))
        result[request] = [by_speeds[speeds] for speeds in found if speeds in by_speeds]
        twin = by_speeds.get(_mirrored(speeds))
        if twin is not None and _mirrored(speeds) > speeds:
            result[request].insert(0, twin)
    return result


def _mirrored(speeds: tuple[float, ...]) -> tuple[float, ...]:
    """Turning rate, lateral and sagittal speed with left and right exchanged."""
    yaw_rate, vy, vx = speeds
    return -yaw_rate, -vy, vx


def _start_ready(work: _Work, executor: Executor) -> None:
    later = []
    for request in work.waiting:
        nearer = work.nearer[request]
        if nearer and nearer[0] not in work.points:
            later.append(request)
        else:
            _solve(work, executor, request, nearer)
    work.waiting = later


def _solve(work: _Work, executor: Executor, request: Request, nearer: list[Request]) -> None:
    """Begin to solve from the first of `nearer` with a point; the others are tried later."""
    near = next((i for i, other in enumerate(nearer) if work.points.get(other)), None)
    point = None if near is None else _start(request, nearer[near], work.points[nearer[near]])
    left = [] if near is None else nearer[near + 1 :]
    future = executor.submit(solve, request, point)
    work.solving[future] = (request, left if point is not None else [request])


def _start(request: Request, other: Request, point: Point | None) -> Point | None:
    """Start point for a request, from the point of another one."""
    mirrored = (other.vx, -other.vy, -other.yaw_rate) == (request.vx, request.vy, request.yaw_rate)
    if point is None or request.symmetric or not mirrored:
        return point
    return exchanged(point)


def _finished(work: _Work, executor: Executor, future: Future[Any]) -> Result | None:
    if future in work.solving:
        request, left = work.solving.pop(future)
        outcome = future.result()
        if outcome.gait is None and left != [request]:
            _solve(work, executor, request, left)
            return None
        work.points[request] = outcome.point
        if outcome.gait is None:
            _explain(work, executor, outcome, outcome.status)
        else:
            work.checking[executor.submit(certify, outcome.gait)] = outcome
        return None
    if future in work.explaining:
        outcome, failure = work.explaining.pop(future)
        return Result(outcome.request, None, outcome, f"{failure}; {future.result()}")
    return _checked(work, executor, future)


def _checked(work: _Work, executor: Executor, future: Future[Certificate]) -> Result | None:
    outcome = work.checking.pop(future)
    try:
        certificate = future.result()
    except GaitLibraryError as error:
        return Result(outcome.request, None, outcome, f"not certified: {error}")
    if outcome.gait is not None and certificate.met:
        return Result(outcome.request, sealed(outcome.gait, certificate.as_document()), outcome)
    missed = ", ".join(_miss(row) for row in certificate.rows if not row.met)
    _explain(work, executor, outcome, f"not certified: {missed}")
    return None


def _miss(row: Row) -> str:
    bounds = f"{row.low:.4g} .. {row.high:.4g}"
    if row.low == -math.inf:
        bounds = f"at most {row.high:.4g}"
    return f"{row.name} is {row.worst:.4g} {row.unit}, allowed {bounds}"


def _explain(work: _Work, executor: Executor, outcome: Outcome, failure: str) -> None:
    found = executor.submit(conflict, outcome.request, outcome.unknowns)
    work.explaining[found] = (outcome, failure)
