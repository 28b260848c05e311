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
from cassie_gaits.neighbours import far_apart, pairs, speeds_of
from cassie_gaits.optimize.conflicts import Conflict, conflict
from cassie_gaits.optimize.request import Request
from cassie_gaits.optimize.solution import NEAR, Outcome, Point, exchanged, point_of, solve

LEAST_GAIN = 1e-4
"""Least part of its cost that a gait must save to take the place of another one."""


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


def apart(gaits: Mapping[Request, Gait]) -> list[tuple[Request, Request]]:
    """Requests whose gaits are far from a neighbour's, each with that neighbour."""
    by_speeds = {speeds_of(gait): request for request, gait in gaits.items()}
    found = []
    for pair in far_apart(pairs(list(gaits.values()))):
        one, other = by_speeds[speeds_of(pair.one)], by_speeds[speeds_of(pair.other)]
        found += [(one, other)] if other.symmetric or not one.symmetric else []
        found += [(other, one)] if one.symmetric or not other.symmetric else []
    return found


def improve(gaits: Mapping[Request, Gait], executor: Executor) -> Iterator[Result]:
    """Solve the gaits that are far from a neighbour again, from that neighbour's gait.

    Such neighbours may be in two local optima. A gait that costs less, and is certified, takes the
    place of the present one, until no gait costs less from any neighbour.

    Args:
        gaits: All gaits of the grid.
        executor: Runs the work.

    Yields:
        The better gaits.
    """
    best = dict(gaits)
    tried: set[tuple[Request, Request, float]] = set()
    while True:
        attempts = [
            (request, near, point_of(best[near]))
            for request, near in apart(best)
            if (request, near, _cost(best[near])) not in tried
        ]
        if not attempts:
            return
        tried.update((request, near, _cost(best[near])) for request, near, _ in attempts)
        futures = [
            executor.submit(_solve_again, request, point, _cost(best[request]))
            for request, _, point in attempts
        ]
        try:
            for future in futures:
                result = future.result()
                if result.gait is not None and _saves(result.gait, _cost(best[result.request])):
                    best[result.request] = result.gait
                    yield result
        finally:
            for future in futures:
                future.cancel()


def _solve_again(request: Request, near: Point, cost: float) -> Result:
    """A gait from a neighbour's point; none unless it is certified and costs less than `cost`."""
    outcome = solve(request, near, starts=(NEAR,), patient=False)
    if outcome.gait is None or not _saves(outcome.gait, cost):
        return Result(request, None, outcome, "costs no less")
    try:
        certificate = certify(outcome.gait)
    except GaitLibraryError as error:
        return Result(request, None, outcome, f"not certified: {error}")
    return _certified(outcome, certificate)


def _saves(gait: Gait, cost: float) -> bool:
    return _cost(gait) < (1.0 - LEAST_GAIN) * cost


def _cost(gait: Gait) -> float:
    return math.inf if gait.cost is None else gait.cost


def neighbours(requests: Sequence[Request]) -> dict[Request, list[Request]]:
    """For each request the other requests from which it can start, best first.

    A gait to the right starts from its mirror image to the left. Another gait starts from one that
    is a step nearer to rest: in sagittal speed, then in lateral speed, then in turning rate, whose
    steps change a gait most.
    """
    names = ("vx", "vy", "yaw_rate")
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
    """Sagittal and lateral speed and turning rate with left and right exchanged."""
    vx, vy, yaw_rate = speeds
    return vx, -vy, -yaw_rate


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
    result = _certified(outcome, certificate)
    if result.gait is not None:
        return result
    _explain(work, executor, outcome, result.reason)
    return None


def _certified(outcome: Outcome, certificate: Certificate) -> Result:
    """The result for a gait that was checked."""
    if outcome.gait is not None and certificate.met:
        return Result(outcome.request, sealed(outcome.gait, certificate.as_document()), outcome)
    missed = ", ".join(_miss(row) for row in certificate.rows if not row.met)
    return Result(outcome.request, None, outcome, f"not certified: {missed}")


def _miss(row: Row) -> str:
    bounds = f"{row.low:.4g} .. {row.high:.4g}"
    if row.low == -math.inf:
        bounds = f"at most {row.high:.4g}"
    return f"{row.name} is {row.worst:.4g} {row.unit}, allowed {bounds}"


def _explain(work: _Work, executor: Executor, outcome: Outcome, failure: str) -> None:
    found = executor.submit(conflict, outcome.request, outcome.unknowns)
    work.explaining[found] = (outcome, failure)
