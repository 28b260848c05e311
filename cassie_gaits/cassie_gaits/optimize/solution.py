"""Solution of the program, and the resulting gait."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import casadi as ca
import numpy as np

from cassie_gaits.errors import GaitLibraryError
from cassie_gaits.gait_library import Gait, mirror, mirror_passive, mirror_torques
from cassie_gaits.optimize import grid
from cassie_gaits.optimize.bounds import row_bounds, unknown_bounds
from cassie_gaits.optimize.newton import Bounds, Newton
from cassie_gaits.optimize.problem import COST_SCALE, Problem, problem
from cassie_gaits.optimize.request import Request, as_document, parameters
from cassie_gaits.optimize.step_model import instant
from cassie_gaits.records import FloatArray

TORQUE_DEGREE = 28
"""Degree of the polynomials of the torques in the file."""

DIGITS = (9, 9, 6)
"""Decimals of outputs, passive motion and torques in the file; rounded values are certified."""

TRAVEL_ROWS = 3
"""Number of rows of mean speeds, the last rows of a program of two steps."""

NEWTON_BARRIER = 2.5e-4
"""Barrier of the scaled cost, equal to IPOPT's `mu_target` after IPOPT's scaling of the cost."""


@dataclass(frozen=True)
class NewtonStart:
    """Arguments of one start of Newton's method, see `Newton.run`."""

    bound_distance: float
    barrier: float
    max_steps: int


NEAR = NewtonStart(bound_distance=1e-3, barrier=NEWTON_BARRIER, max_steps=20)
"""Start for a neighbour in the library, which usually takes 8 to 13 steps."""

FAR = NewtonStart(bound_distance=1e-2, barrier=1e-2, max_steps=30)
"""Start if `NEAR` fails: farther from the bounds, which takes 14 to 27 steps."""

LEEWAY = 1e-4
"""Largest scaled violation in a solved gait: half of the limits' margin."""


@dataclass(frozen=True, eq=False)
class Point:
    """End point of a solver, from which a neighbour can start.

    Attributes:
        unknowns: Unknowns of the program.
        bound_multipliers, row_multipliers: Multipliers of bounds and constraints of the lean
            program; None if they are not known.
    """

    unknowns: FloatArray
    bound_multipliers: FloatArray | None = None
    row_multipliers: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Outcome:
    """Outcome of a request.

    Attributes:
        request: The request.
        gait: The gait, or None if there is none.
        point: Start point for neighbours, or None if there is no gait.
        status: Status of the solver.
        iterations: Number of the solver's iterations.
        cost: Cost of both steps.
        violation: Largest scaled violation.
        unknowns: Unknowns at the solver's end, with a gait or without.
        seconds: CPU time.
    """

    request: Request
    gait: Gait | None
    point: Point | None
    status: str
    iterations: int
    cost: float
    violation: float
    unknowns: FloatArray
    seconds: float


def prepare(*, symmetric: bool) -> None:
    """Set up everything that the first gait needs, which takes one or two seconds."""
    problem(symmetric=symmetric, lean=True).prepare()
    problem(symmetric=symmetric, lean=False).values.n_in()
    _torques().n_in()


def prepare_newton(*, symmetric: bool) -> None:
    """Set up everything for `solve` from a neighbour with `patient` false, without IPOPT."""
    for lean in (True, False):
        program = problem(symmetric=symmetric, lean=lean)
        program.evaluation.cost_and_rows(program.guess(), np.ones(program.parameters))
    problem(symmetric=symmetric, lean=False).values.n_in()
    _torques().n_in()


def solve(
    request: Request,
    near: Point | None = None,
    *,
    starts: Sequence[NewtonStart] = (NEAR, FAR),
    patient: bool = True,
) -> Outcome:
    """Find a gait.

    The lean program is solved first. If its gait violates a constraint that the lean program omits,
    the whole program is solved from this gait.

    Args:
        request: The request.
        near: End point of a neighbour, or None to start from the constant guess.
        starts: How Newton's method starts from the neighbour, in turn.
        patient: Whether IPOPT is used if Newton's method fails from the neighbour.
    """
    start = time.process_time()
    whole = problem(symmetric=request.symmetric, lean=False)
    lean = problem(symmetric=request.symmetric, lean=True)
    point, status, iterations = _run(lean, request, near, starts, patient)
    x = point.unknowns
    if status == "Solve_Succeeded" and _violations(whole, request, x)[1].max() > LEEWAY:
        again, status, more = _run(whole, request, Point(x), starts, patient)
        x, iterations = again.unknowns, iterations + more
    judge = whole if status == "Solve_Succeeded" else lean
    cost, violations = _violations(judge, request, x)
    solved = status == "Solve_Succeeded" and float(violations.max()) <= LEEWAY
    steps = 2.0 / whole.steps
    found = _Found(request, x, steps * cost, iterations, float(violations.max()))
    seconds = time.process_time() - start
    return Outcome(
        request,
        _gait(found, seconds) if solved else None,
        replace(point, unknowns=x) if solved else None,
        status,
        iterations,
        found.cost,
        found.violation,
        x,
        seconds,
    )


@dataclass(frozen=True, eq=False)
class _Found:
    request: Request
    unknowns: FloatArray
    cost: float
    iterations: int
    violation: float


def point_of(gait: Gait) -> Point:
    """End point of the solver for a gait from a file.

    Raises:
        GaitLibraryError: if the gait was not made by this tool.
    """
    if gait.passive is None or gait.passive.shape[2] != grid.PASSIVE_DEGREE + 1:
        raise GaitLibraryError("the gait's passive motion is not this optimizer's")
    right = [gait.coefficients[0].ravel(), gait.passive[0].ravel()]
    left = [mirror(gait.coefficients[1]).ravel(), mirror_passive(gait.passive[1]).ravel()]
    symmetric = gait.solver["request"]["symmetric"]
    return Point(np.concatenate(right if symmetric else [*right, *left]))


def exchanged(point: Point) -> Point:
    """The point of a gait of two steps with left and right exchanged.

    Each step is stored as one on the right leg, so the two steps change places.
    """
    x = _swapped(point.unknowns)
    if point.bound_multipliers is None or point.row_multipliers is None:
        return Point(x)
    rows = _swapped(point.row_multipliers[:-TRAVEL_ROWS])
    travel = point.row_multipliers[-TRAVEL_ROWS:] * (1.0, -1.0, -1.0)  # ahead, to the left, turning
    return Point(x, _swapped(point.bound_multipliers), np.concatenate([rows, travel]))


def _swapped(values: FloatArray) -> FloatArray:
    result: FloatArray = np.roll(values, len(values) // 2)
    return result


def _for_all_steps(near: Point, program: Problem) -> Point:
    """A symmetric gait's point for a program of two steps."""
    if len(near.unknowns) == program.unknowns:
        return near
    return Point(np.tile(near.unknowns, program.steps))


def _run(
    program: Problem,
    request: Request,
    near: Point | None,
    starts: Sequence[NewtonStart],
    patient: bool,
) -> tuple[Point, str, int]:
    lower, upper = row_bounds(program, request)
    x_lower, x_upper = unknown_bounds(program, request)
    tried = 0
    if near is not None:
        near = _for_all_steps(near, program)
        newton = Newton(
            program.evaluation,
            Bounds(x_lower, x_upper, lower, upper),
            np.array(parameters(request)),
            NEWTON_BARRIER,
        )
        for how in starts:
            found = newton.run(near.unknowns, how.max_steps, how.bound_distance, how.barrier)
            tried += found.iterations
            if found.status == "Solve_Succeeded":
                break
        if found.status == "Solve_Succeeded" or not patient:
            return Point(found.unknowns), found.status, tried
    bounds = {"lbx": x_lower, "ubx": x_upper, "lbg": lower, "ubg": upper}
    if near is None:
        solver, start = program.solver, {"x0": program.guess()}
    else:
        # Zeros serve for unknown multipliers: the follower's small barrier keeps it near.
        solver, start = program.follower, {"x0": near.unknowns}
        if near.bound_multipliers is not None and near.row_multipliers is not None:
            start |= {"lam_x0": near.bound_multipliers, "lam_g0": near.row_multipliers}
    result = solver(p=parameters(request), **bounds, **start)
    stats = solver.stats()
    names = ("x", "lam_x", "lam_g")
    point = Point(*(np.array(result[name], dtype=np.float64).ravel() for name in names))
    return point, str(stats["return_status"]), tried + int(stats["iter_count"])


def _violations(program: Problem, request: Request, x: FloatArray) -> tuple[float, FloatArray]:
    f, g = program.values(x, parameters(request))
    values = np.array(g, dtype=np.float64).ravel()
    lower, upper = row_bounds(program, request)
    return float(f) / COST_SCALE, np.maximum(np.maximum(lower - values, values - upper), 0.0)


def _gait(found: _Found, seconds: float) -> Gait:
    request = found.request
    parts = found.unknowns.reshape(-1, grid.STEP_UNKNOWNS)
    steps = [_step(part, request, 1.0 - 2.0 * i) for i, part in enumerate(parts)]
    if request.symmetric:
        steps.append(steps[0])
    # The step on the left leg is stored as its mirror image.
    rounded = [
        [np.round(part, digits) for part, digits in zip(step, DIGITS, strict=True)]
        for step in steps
    ]
    (outputs, passive, torques), (outputs_l, passive_l, torques_l) = rounded
    return Gait(
        vx=request.vx,
        vy=request.vy,
        yaw_rate=request.yaw_rate,
        step_time=request.step_time,
        coefficients=np.stack([outputs, mirror(outputs_l)]),
        torques=np.stack([torques, mirror_torques(torques_l)]),
        passive=np.stack([passive, mirror_passive(passive_l)]),
        cost=round(found.cost, 3),
        solver={
            "name": "ipopt",
            "iterations": found.iterations,
            "violation": float(f"{found.violation:.2e}"),
            "cpu_seconds": round(seconds, 3),
            "request": as_document(request),
        },
    )


def _step(
    unknowns: FloatArray, request: Request, asymmetry: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Coefficients of outputs, passive coordinates and torques of a step on the right leg."""
    outputs, passive = grid.split(unknowns)
    if request.symmetric:
        asymmetry = 0.0
    duration = request.step_time
    phases, basis = _torque_samples()
    motion = np.array([grid.coordinates_at(phase, 2) @ unknowns for phase in phases])
    y, y1, y2 = motion.reshape(len(phases), 3, -1).transpose(1, 2, 0)
    samples = np.array(
        _torques()(*(y, y1 / duration, y2 / duration**2, request.slope, asymmetry, request.payload))
    )
    torques: FloatArray = np.linalg.lstsq(basis, samples.T, rcond=None)[0].T
    return outputs, passive, torques


@cache
def _torque_samples() -> tuple[tuple[float, ...], FloatArray]:
    """Chebyshev nodes at which torques are sampled, and the Bernstein polynomials there."""
    count = 2 * TORQUE_DEGREE
    phases = tuple((0.5 - 0.5 * np.cos(np.pi * (np.arange(count) + 0.5) / count)).tolist())
    return phases, np.array([grid.bernstein(TORQUE_DEGREE, phase) for phase in phases])


@cache
def _torques() -> ca.Function:
    """Function for the drives' torques, left then right; zero for the stance toe by constraint.

    Coordinates are given at all of `_torque_samples`, one column each.
    """
    at = instant()
    stance = ca.vertcat(at.efforts.stance[:4], 0.0)
    torques = ca.vertcat(at.efforts.swing, stance)
    symbols = [at.y, at.yd, at.ydd, at.slope, at.asymmetry, at.payload]
    return ca.Function("torques", symbols, [torques]).map(2 * TORQUE_DEGREE)
