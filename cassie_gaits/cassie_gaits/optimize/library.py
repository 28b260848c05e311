"""A whole library: gaits solved next to each other, each certified, over several processes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from dataclasses import dataclass, field, replace
from typing import Any

from cassie_gaits.certificate.certify import Certificate, certify
from cassie_gaits.errors import GaitLibraryError
from cassie_gaits.gait_library import Gait
from cassie_gaits.optimize.request import Request
from cassie_gaits.optimize.solution import Outcome, Point, point_of, solve


@dataclass(frozen=True, eq=False)
class Result:
    """What came of one request.

    Attributes:
        request: What was asked for.
        gait: The gait with its certificate, or None.
        outcome: Of the solver; None for a gait that was taken over from an earlier run.
        reason: Why there is no gait, in a line; empty if there is one.
    """

    request: Request
    gait: Gait | None
    outcome: Outcome | None
    reason: str = ""


@dataclass
class _Work:
    """What is under way."""

    nearer: dict[Request, list[Request]]
    waiting: list[Request]
    solving: dict[Future[Outcome], tuple[Request, list[Request]]] = field(default_factory=dict)
    checking: dict[Future[Certificate], Outcome] = field(default_factory=dict)
    points: dict[Request, Point | None] = field(default_factory=dict)


def find(
    requests: Sequence[Request], executor: Executor, done: Mapping[Request, Gait | None]
) -> Iterator[Result]:
    """Solve and certify every request; results come as they are ready.

    A gait starts from its neighbour nearer to rest, which makes neighbours alike and the solver
    quick; where that fails it starts from another one, at last from the constant guess.

    Args:
        requests: What is wanted, all different.
        executor: Runs the work: local processes or a cluster.
        done: Gaits that are there already; None for what is known to fail.
    """
    work = _Work(neighbours(requests), [request for request in requests if request not in done])
    for request, gait in done.items():
        work.points[request] = None if gait is None else point_of(gait)
    try:
        while work.waiting or work.solving or work.checking:
            _start_ready(work, executor)
            pending: list[Future[Any]] = [*work.solving, *work.checking]
            for finished in wait(pending, return_when=FIRST_COMPLETED).done:
                result = _finished(work, executor, finished)
                if result is not None:
                    yield result
    finally:
        left: list[Future[Any]] = [*work.solving, *work.checking]
        for future in left:
            future.cancel()


def neighbours(requests: Sequence[Request]) -> dict[Request, list[Request]]:
    """Of each request those one step nearer to rest: in turning, then to the side, then ahead."""
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
    return result


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
    """From the first of `nearer` that has a point; the others are left to try."""
    near = next((i for i, other in enumerate(nearer) if work.points.get(other)), None)
    point = None if near is None else work.points[nearer[near]]
    left = [] if near is None else nearer[near + 1 :]
    future = executor.submit(solve, request, point)
    work.solving[future] = (request, left if point is not None else [request])


def _finished(work: _Work, executor: Executor, future: Future[Any]) -> Result | None:
    for solved in [f for f in work.solving if f is future]:
        request, left = work.solving.pop(solved)
        outcome = solved.result()
        if outcome.gait is None and left != [request]:
            _solve(work, executor, request, left)
            return None
        work.points[request] = outcome.point
        if outcome.gait is None:
            return Result(request, None, outcome, _why(outcome))
        work.checking[executor.submit(certify, outcome.gait)] = outcome
        return None
    checked = next(f for f in work.checking if f is future)
    return _checked(work.checking.pop(checked), checked)


def _checked(outcome: Outcome, future: Future[Certificate]) -> Result:
    try:
        certificate = future.result()
    except GaitLibraryError as error:
        return Result(outcome.request, None, outcome, f"not certified: {error}")
    if outcome.gait is None or not certificate.met:
        missed = ", ".join(
            f"{row.name} is {row.worst:.4g} {row.unit}, allowed {row.low:.4g} .. {row.high:.4g}"
            for row in certificate.rows
            if not row.met
        )
        return Result(outcome.request, None, outcome, f"not certified: {missed}")
    gait = replace(outcome.gait, certificate=certificate.as_document())
    return Result(outcome.request, gait, outcome)


def _why(outcome: Outcome) -> str:
    conflicts = ", ".join(outcome.conflicts) or "none, the solver gave up"
    return f"{outcome.status}; constraints in conflict at the best point found: {conflicts}"
