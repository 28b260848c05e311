"""Optimized gaits: exact derivatives, certified by the independent check, refused when wrong."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from cassie_gaits.certificate.certify import certify
from cassie_gaits.errors import GaitLibraryError
from cassie_gaits.gait_library import OUTPUTS, mirror
from cassie_gaits.optimize import solution
from cassie_gaits.optimize.library import neighbours
from cassie_gaits.optimize.problem import Problem, problem
from cassie_gaits.optimize.request import TABLE_ONLY, Request, parameters
from cassie_gaits.optimize.solution import solve

REQUEST = Request(vx=0.5)


@pytest.fixture(scope="module")
def outcome():
    return solve(REQUEST)


@pytest.fixture(scope="module")
def certificate(outcome):
    return certify(outcome.gait)


def test_derivatives_of_the_program_match_finite_differences():
    program = problem(symmetric=True, lean=True)
    x = program.guess() + 0.01 * np.random.default_rng(3).normal(size=program.unknowns)
    p, step = parameters(REQUEST), 1e-6
    direction = np.random.default_rng(4).normal(size=x.size)
    lam = np.random.default_rng(5).normal(size=len(program.names))
    jacobian = program.solver.get_function("nlp_jac_g")
    gradient = program.solver.get_function("nlp_grad_f")

    def slope(at):
        return np.array(gradient(at, p)[1]).ravel() + lam @ np.array(jacobian(at, p)[1])

    def value(at):
        f, g = program.values(at, p)
        return float(f) + lam @ np.array(g).ravel()

    ahead, behind = x + step * direction, x - step * direction
    assert (value(ahead) - value(behind)) / (2 * step) == pytest.approx(
        slope(x) @ direction, rel=1e-6
    )
    upper = program.solver.get_function("nlp_hess_l")(x, p, 1.0, lam)
    hessian = np.array(ca.triu2symm(upper))
    numeric = (slope(ahead) - slope(behind)) / (2 * step)
    np.testing.assert_allclose(hessian @ direction, numeric, rtol=1e-5, atol=1e-3)


def test_a_gait_is_found_from_the_constant_guess(outcome):
    assert outcome.status == "Solve_Succeeded"
    assert outcome.iterations < 60
    assert outcome.violation < 1e-6


def test_the_left_step_mirrors_the_right(outcome):
    right, left = outcome.gait.coefficients
    np.testing.assert_array_equal(left, mirror(right))


def test_the_gait_is_certified(certificate):
    assert [row.name for row in certificate.rows if not row.met] == []


def test_integration_ends_where_the_optimizer_says(certificate):
    worst = {row.name: row.worst for row in certificate.rows}
    assert worst["end of the step, position"] < 1e-5
    assert worst["end of the step, velocity"] < 1e-4
    assert worst["start of the next step, velocity"] < 1e-3


@pytest.mark.parametrize(
    ("part", "row"),
    [("torques", "end of the step, position"), ("coefficients", "outputs on the way")],
)
def test_a_gait_that_was_tampered_with_is_not_certified(outcome, part, row):
    changed = getattr(outcome.gait, part).copy()
    changed[:, 3] *= 1.01
    found = certify(replace(outcome.gait, **{part: changed}))
    assert row in [entry.name for entry in found.rows if not entry.met]


def test_a_gait_without_torques_cannot_be_checked(outcome):
    with pytest.raises(GaitLibraryError, match="no torques"):
        certify(replace(outcome.gait, torques=None))


def test_an_impossible_request_names_the_constraints_in_conflict(monkeypatch):
    hasty = Problem(symmetric=True, lean=True, max_iterations=12)
    monkeypatch.setattr(solution, "problem", lambda **_: hasty)
    found = solve(Request(vx=5.0))
    assert found.gait is None
    assert found.conflicts


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"vx": float("nan")}, "vx is nan"),
        ({"step_time": 0.0}, "step_time is 0.0, expected 0.15"),
        ({"vy": 0.1}, "neither goes sideways nor turns"),
    ],
)
def test_bad_requests_are_refused(change, reason):
    with pytest.raises(GaitLibraryError, match=reason):
        Request(**change)


def test_a_softer_landing_with_wider_feet_can_be_asked_for():
    asked = Request(vx=0.25, landing_speed=0.15, feet_apart=0.28)
    worst = {row.name: row.worst for row in certify(solve(asked).gait).rows}
    assert worst["swing foot velocity on impact (z)"] > -0.15
    assert worst["distance between feet"] > 0.28


def test_the_torso_stays_upright_the_hips_straight_and_the_pelvis_low(outcome, certificate):
    asked, alpha = outcome.request, outcome.gait.coefficients
    assert np.abs(alpha[:, OUTPUTS.index("torso_roll")]).max() <= asked.torso_roll
    assert np.abs(alpha[:, OUTPUTS.index("torso_pitch")]).max() <= asked.torso_pitch
    assert np.abs(alpha[:, OUTPUTS.index("swing_hip_yaw")]).max() <= asked.hip_yaw
    worst = {row.name: row.worst for row in certificate.rows}
    assert worst["distance between pelvis and stance foot"] < asked.pelvis_distance


def test_the_table_alone_is_cheaper(outcome):
    assert solve(Request(vx=0.5, **TABLE_ONLY)).cost < 0.9 * outcome.cost


@pytest.fixture(scope="module")
def turning():
    rest = solve(Request())
    return solve(Request(vy=0.1, yaw_rate=0.3, symmetric=False), rest.point)


def test_a_gait_that_turns_and_goes_sideways_is_certified(turning):
    certificate = certify(turning.gait)
    assert [row.name for row in certificate.rows if not row.met] == []
    worst = {row.name: row.worst for row in certificate.rows}
    assert worst["average turning rate"] == pytest.approx(0.3, abs=1e-4)
    assert worst["average lateral velocity"] == pytest.approx(0.1, abs=1e-4)


def test_its_two_steps_differ(turning):
    right, left = turning.gait.coefficients
    assert np.abs(left - mirror(right)).max() > 0.01


def test_neighbours_are_one_step_nearer_to_rest_in_turning_first():
    straight = [Request(vx=v) for v in (-0.5, 0.0, 0.25, 0.5)]
    near = neighbours(straight)
    assert [near[request] for request in straight] == [
        [straight[1]],
        [],
        [straight[1]],
        [straight[2]],
    ]
    turn = Request(vx=0.25, yaw_rate=0.3, symmetric=False)
    slower = Request(yaw_rate=0.3, symmetric=False)
    assert neighbours([*straight, turn, slower])[turn] == [straight[2], slower]
