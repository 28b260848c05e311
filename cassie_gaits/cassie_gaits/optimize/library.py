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

    waiting: dict[Request, Request | None]
    solving: dict[Future[Outcome], tuple[Request, bool]] = field(default_factory=dict)
    checking: dict[Future[Certificate], Outcome] = field(default_factory=dict)
    points: dict[Request, Point | None] = field(default_factory=dict)


def find(
    requests: Sequence[Request], executor: Executor, done: Mapping[Request, Gait]
) -> Iterator[Result]:
    """Solve and certify every request; results come as they are ready.

    A gait starts from its neighbour nearer to rest, which makes neighbours alike and the solver
    quick; where that fails it starts from the constant guess.

    Args:
        requests: What is wanted, all different.
        executor: Runs the work: local processes or a cluster.
        done: Gaits that are there already.
    """
    work = _Work({request: neighbour(request, requests) for request in requests})
    for request, gait in done.items():
        work.waiting.pop(request, None)
        work.points[request] = point_of(gait)
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


def neighbour(request: Request, among: Sequence[Request]) -> Request | None:
    """The request one step nearer to rest: in turning first, then to the side, then ahead."""
    for name in ("yaw_rate", "vy", "vx"):
        value = getattr(request, name)
        others = {getattr(other, name) for other in among}
        nearer = [v for v in others if abs(v) < abs(value) and v * value >= 0.0]
        if nearer:
            wanted = replace(request, **{name: max(nearer, key=abs)})
            return wanted if wanted in among else None
    return None


def _start_ready(work: _Work, executor: Executor) -> None:
    for request, before in list(work.waiting.items()):
        if before is None or before in work.points:
            near = None if before is None else work.points[before]
            _solve(work, executor, request, near)
            del work.waiting[request]


def _solve(work: _Work, executor: Executor, request: Request, near: Point | None) -> None:
    work.solving[executor.submit(solve, request, near)] = (request, near is not None)


def _finished(work: _Work, executor: Executor, future: Future[Any]) -> Result | None:
    for solved in [f for f in work.solving if f is future]:
        request, helped = work.solving.pop(solved)
        outcome = solved.result()
        if outcome.gait is None and helped:
            _solve(work, executor, request, None)
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
