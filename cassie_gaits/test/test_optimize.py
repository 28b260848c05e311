"""Optimized gaits: exact derivatives, certified by the independent check, refused when wrong."""

from __future__ import annotations

import cmath
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from cassie_gaits.certificate.certify import certify
from cassie_gaits.certificate.seal import flaw, gait_sha256
from cassie_gaits.certificate.table import speed_rows
from cassie_gaits.errors import GaitLibraryError
from cassie_gaits.gait_library import OUTPUTS, Gait, mirror
from cassie_gaits.gait_library_file import library_path, load_library
from cassie_gaits.optimize.conflicts import conflict
from cassie_gaits.optimize.library import apart, improve, neighbours
from cassie_gaits.optimize.problem import problem
from cassie_gaits.optimize.request import TABLE_ONLY, Request, as_document, parameters
from cassie_gaits.optimize.solution import exchanged, point_of, solve
from cassie_gaits.processes import local_processes

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

    def lagrangian_gradient(at):
        return np.array(gradient(at, p)[1]).ravel() + lam @ np.array(jacobian(at, p)[1])

    def value(at):
        f, g = program.values(at, p)
        return float(f) + lam @ np.array(g).ravel()

    ahead, behind = x + step * direction, x - step * direction
    assert (value(ahead) - value(behind)) / (2 * step) == pytest.approx(
        lagrangian_gradient(x) @ direction, rel=1e-6
    )
    upper = program.solver.get_function("nlp_hess_l")(x, p, 1.0, lam)
    hessian = np.array(ca.triu2symm(upper))
    numeric = (lagrangian_gradient(ahead) - lagrangian_gradient(behind)) / (2 * step)
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


@pytest.mark.parametrize(
    ("asked", "missed", "against"),
    [
        ({"clearance": 0.6}, "mid-step swing foot clearance", "range of swing leg length"),
        ({"step_time": 0.1}, "mid-step swing foot clearance", "torque at speed of swing knee"),
        ({"slope": 0.698}, "friction cone", "average sagittal velocity"),
    ],
)
def test_an_impossible_request_names_what_it_misses_and_what_stands_against_it(
    asked, missed, against
):
    request = Request(**asked)
    found = solve(request)
    assert found.gait is None
    reasons = conflict(request, found.unknowns)
    assert reasons.missed[0].startswith(f"{missed} (by ")
    assert against in reasons.against
    assert not any(name in " ".join(reasons.missed) for name in reasons.against)


def test_what_is_missed_is_no_more_than_it_must_be():
    asked = Request(clearance=0.6)
    missed = conflict(asked, solve(asked).unknowns).missed[0]
    by = float(missed.partition("(by ")[2].split()[0])
    assert solve(replace(asked, clearance=0.6 - by - 0.01)).gait is not None
    assert solve(replace(asked, clearance=0.6 - by + 0.01)).gait is None


def test_a_gait_that_is_found_misses_nothing(outcome):
    reasons = conflict(REQUEST, outcome.unknowns)
    assert reasons.missed == ()
    assert "distance between feet" in reasons.against
    assert str(reasons).startswith("the optimizer's own constraints can be met; what binds most: ")


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"vx": float("nan")}, r"vx is nan m/s, expected -5 \.\. 5 m/s"),
        ({"step_time": 0.0}, r"step_time is 0 s, expected 0\.05 \.\. 1\.5 s"),
        ({"payload": -3.0}, r"payload is -3 kg, expected 0 \.\. 30 kg"),
        ({"clearance": 2.0}, r"clearance is 2 m, expected 0 \.\. 1 m"),
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


def test_the_mirror_image_of_a_gait_is_one_of_the_mirrored_robot(turning):
    program = problem(symmetric=False, lean=False)
    other = replace(turning.request, vy=-turning.request.vy, yaw_rate=-turning.request.yaw_rate)
    mirrored_robot = [*parameters(other)[:-1], -1.0]
    x = exchanged(turning.point).unknowns
    cost, rows = program.values(turning.unknowns, parameters(turning.request))
    cost_m, rows_m = program.values(x, mirrored_robot)
    assert float(cost_m) == pytest.approx(float(cost), rel=1e-9)
    travel = [name.startswith("average") for name in program.names]
    np.testing.assert_allclose(np.array(rows_m).ravel()[travel], 0.0, atol=1e-6)
    parts, parts_m = (np.array(g).ravel()[~np.array(travel)].reshape(2, -1) for g in (rows, rows_m))
    np.testing.assert_allclose(parts_m, parts[::-1], atol=1e-9)


def test_from_its_mirror_image_a_gait_takes_few_iterations(turning):
    other = replace(turning.request, vy=-turning.request.vy, yaw_rate=-turning.request.yaw_rate)
    found = solve(other, exchanged(turning.point))
    assert found.iterations < 8
    assert found.cost == pytest.approx(turning.cost, rel=2e-3)
    assert certify(found.gait).met


@pytest.mark.parametrize("turn", [0.9, -0.9])
def test_speed_on_an_arc_is_that_of_the_middle_between_the_feet(turn):
    speed, half, time = 0.6, 0.14, 0.4
    centre, step = 1j * speed / turn, cmath.exp(1j * turn * time)

    def foot(side, angle):
        return centre + (1j * half * side - centre) * angle

    def travel(start, end):  # the standing foot's heading is that of the arc
        way = foot(*end) - foot(*start)
        return (way / start[1]).real, (way / start[1]).imag, cmath.phase(end[1] / start[1])

    first = travel((-1, 1.0), (1, step))
    second = travel((1, step), (-1, step**2))
    gait = Gait(speed, 0.0, turn, time, np.zeros((2, 9, 6)))
    assert [row.worst for row in speed_rows(gait, first, second)] == pytest.approx(
        [speed, 0.0, turn], abs=1e-12
    )


def test_neighbours_are_one_step_nearer_to_rest_those_slower_ahead_first():
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
    assert neighbours([*straight, turn, slower])[turn] == [slower, straight[2]]


def test_a_gait_to_the_right_starts_from_its_mirror_image():
    left = Request(vx=0.25, vy=0.1, yaw_rate=0.3, symmetric=False)
    right = Request(vx=0.25, vy=-0.1, yaw_rate=-0.3, symmetric=False)
    straight = Request(vx=0.25, vy=-0.1, symmetric=False)
    near = neighbours([Request(vx=0.25), left, right, straight])
    assert near[right] == [left, straight]
    assert near[left] == []


def test_gaits_in_a_dearer_optimum_are_solved_again_from_their_neighbours():
    """Beyond a border between two optima the gait that costs less is the other one's."""
    gaits = {
        Request(gait.vx, gait.vy, gait.yaw_rate, symmetric=False): gait
        for gait in load_library(library_path("dense")).gaits
        if (gait.vy, gait.yaw_rate) == (0.1, 0.9) and 0.2 <= gait.vx <= 0.6
    }
    of = {request.vx: request for request in gaits}
    assert {(request.vx, near.vx) for request, near in apart(gaits)} == {(0.4, 0.5), (0.5, 0.4)}
    found = dict(gaits)
    dearer = solve(of[0.4], point_of(gaits[of[0.5]])).gait
    assert dearer.cost > 1.001 * gaits[of[0.4]].cost
    gaits[of[0.4]] = dearer
    with local_processes(1) as executor:
        better = {result.request: result.gait for result in improve(gaits, executor)}
    assert [request.vx for request in better] == [0.4]
    assert better[of[0.4]].cost == pytest.approx(found[of[0.4]].cost, rel=1e-4)
    for request, gait in better.items():
        assert gait.solver["request"] == as_document(request)
        assert flaw(gait, gait_sha256(gait)) == ""
