"""Newton's method from a neighbour: its derivatives, its optimum, and where it gives up."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from cassie_gaits.errors import GaitLibraryError
from cassie_gaits.gait_library_file import library_path, load_library
from cassie_gaits.optimize.bounds import row_bounds, unknown_bounds
from cassie_gaits.optimize.newton import Bounds, Newton
from cassie_gaits.optimize.problem import problem
from cassie_gaits.optimize.request import Request, parameters
from cassie_gaits.optimize.solution import FAR, NEAR, NEWTON_BARRIER, Point, point_of, solve
from cassie_gaits.optimize.tape import LANES, Tape

LIBRARY = load_library(library_path("optimized"))
HALF = next(gait for gait in LIBRARY.gaits if gait.vx == 0.5)


def newton(request: Request) -> Newton:
    program = problem(symmetric=request.symmetric, lean=True)
    bounds = Bounds(*unknown_bounds(program, request), *row_bounds(program, request))
    return Newton(program.evaluation, bounds, np.array(parameters(request)), NEWTON_BARRIER)


def test_a_tape_gives_what_the_function_gives_it_is_made_of():
    x = ca.SX.sym("x", 3)
    a, b, c = ca.vertsplit(x)
    y = ca.vertcat(
        *(a * b - c / a, ca.sin(a) * ca.cos(b), ca.atan2(a, b), ca.sqrt(c), -(b * b)),
        *(ca.acos(0.1 * a), ca.asin(0.1 * b), ca.fabs(-a), 2.0 * b, 1.0 / c, ca.SX(3.5)),
    )
    points = np.random.default_rng(1).uniform(0.5, 2.0, (3, LANES + 3))
    found = Tape("several", x, y).run(points)
    function = ca.Function("f", [x], [y])
    wanted = np.hstack([np.array(function(point)) for point in points.T])
    np.testing.assert_allclose(found, wanted, rtol=1e-15)


def test_a_tape_refuses_an_operation_that_it_does_not_know():
    x = ca.SX.sym("x")
    with pytest.raises(GaitLibraryError, match="hyperbolic has operation"):
        Tape("hyperbolic", x, ca.tanh(x))


@pytest.mark.parametrize("symmetric", [True, False])
def test_values_and_derivatives_are_those_of_the_program(symmetric):
    program = problem(symmetric=symmetric, lean=True)
    rng = np.random.default_rng(2)
    x = program.guess() + rng.uniform(-0.02, 0.02, program.unknowns)
    p = np.array([0.5, 0.1, 0.2, 0.4, 0.15, 0.05, 4.0, 1.0])
    multipliers = rng.normal(size=len(program.lower))
    found = program.evaluation.values(x, p)
    cost, rows = program.values(x, p)
    derivatives = program.derivatives
    gradient, jacobian = derivatives["grad_f"](x, p)[1], derivatives["jac_g"](x, p)[1]
    upper = np.array(derivatives["hess_lag"](x, p, 1.0, multipliers))
    hessian = np.triu(upper) + np.triu(upper, 1).T
    assert found.cost == pytest.approx(float(cost), rel=1e-12)
    np.testing.assert_allclose(found.rows, np.array(rows).ravel(), atol=1e-10)
    np.testing.assert_allclose(found.cost_gradient, np.array(gradient).ravel(), atol=1e-8)
    np.testing.assert_allclose(found.jacobian, np.array(jacobian), atol=1e-8)
    own = program.evaluation.hessian(x, p, multipliers)
    np.testing.assert_allclose(own, hessian, atol=1e-7 * np.abs(hessian).max())


def test_from_a_neighbour_it_goes_to_the_optimum_of_ipopt():
    request = Request(vx=0.6)
    program = problem(symmetric=True, lean=True)
    near = point_of(HALF)
    lower, upper = row_bounds(program, request)
    x_lower, x_upper = unknown_bounds(program, request)
    wanted = program.follower(
        *(near.unknowns, parameters(request), x_lower, x_upper, lower, upper, 0, 0)
    )
    result = newton(request).run(near.unknowns, 40, NEAR.bound_distance, NEAR.barrier)
    assert result.status == "Solve_Succeeded"
    assert result.iterations < 12
    cost, _ = program.evaluation.cost_and_rows(result.unknowns, np.array(parameters(request)))
    assert cost == pytest.approx(float(wanted[1]), rel=1e-3)
    np.testing.assert_allclose(result.unknowns, np.array(wanted[0]).ravel(), atol=5e-3)


def test_from_its_own_answer_it_has_nothing_to_do():
    request = Request(vx=0.5, slope=0.05)
    method = newton(request)
    first = method.run(point_of(HALF).unknowns, 40, NEAR.bound_distance, NEAR.barrier)
    again = method.run(first.unknowns, 40, 1e-8, NEAR.barrier)
    assert again.iterations <= 2
    np.testing.assert_allclose(again.unknowns, first.unknowns, atol=1e-5)


def test_an_impossible_gait_ends_with_its_reason_and_without_patience_at_once():
    found = solve(Request(vx=4.5), point_of(HALF), patient=False)
    assert found.gait is None
    assert found.status != "Solve_Succeeded"
    assert found.iterations <= NEAR.max_steps + FAR.max_steps


def test_too_few_iterations_are_told():
    start = point_of(HALF).unknowns
    result = newton(Request(vx=0.9)).run(start, 1, NEAR.bound_distance, NEAR.barrier)
    assert (result.status, result.iterations) == ("Maximum_Iterations_Exceeded", 1)


def test_where_newton_finds_no_way_a_patient_solve_goes_on():
    far = Point(point_of(HALF).unknowns + 0.3)
    found = solve(Request(vx=0.5), far)
    assert found.gait is None or found.violation < 1e-4


def test_from_a_posture_that_the_legs_cannot_take_it_ends_with_the_reason():
    start = point_of(HALF).unknowns + 0.2
    result = newton(Request(vx=1.8, slope=1.0)).run(start, 3, NEAR.bound_distance, NEAR.barrier)
    assert (result.status, result.iterations) == ("Invalid_Number_Detected", 0)
