"""Foot force from the springs: against the whole dynamics, and where springs tell nothing."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cassie_gaits import robot, virtual_leg
from cassie_gaits.dynamics import Dynamics
from cassie_gaits.leg import LegPair, bent_leg, both_legs, leg_shortening, spring_force
from cassie_gaits.linkage import heel_angle_and_slopes
from cassie_gaits.names import COORDINATES, LEGS

DYNAMICS = Dynamics()
UP = np.array([0.0, 0.0, 1.0])
RELAXED = np.array([0.0, 0.0, 0.4, -1.2, 0.0, robot.NEUTRAL_TARSUS + 1.2, -1.6])


def bent(*offsets: float) -> np.ndarray:
    return RELAXED + np.array(offsets)


def random_pose(seed: int, leg: str) -> tuple[np.ndarray, list[int]]:
    """A loaded leg under a tilted torso, its hips at zero, and the indices of its joints."""
    rng = np.random.default_rng(seed)
    q = np.zeros(20)
    q[COORDINATES.index("pitch")] = rng.uniform(-0.2, 0.2)
    for name in LEGS:  # the other leg anywhere its rods reach
        q[COORDINATES.index(f"{name}_knee")] = -1.0
        q[COORDINATES.index(f"{name}_tarsus")] = 1.0 + robot.NEUTRAL_TARSUS
    joints = list(range(COORDINATES.index(f"{leg}_hip_roll"), COORDINATES.index(f"{leg}_toe") + 1))
    knee = rng.uniform(-2.0, -0.9)
    tarsus = robot.NEUTRAL_TARSUS - knee + rng.uniform(-0.02, 0.05)
    shin, toe = rng.uniform(-0.06, 0.0), rng.uniform(-2.0, -1.2)
    q[joints[2:]] = rng.uniform(0.3, 0.8), knee, shin, tarsus, toe
    return q, joints


def pair_at(joints: np.ndarray, up: np.ndarray = UP) -> LegPair:
    """Both legs at the same angles."""
    pair = LegPair()
    both_legs(np.tile(joints, (2, 1)), np.zeros((2, 7)), np.zeros(2), up, pair.records[0])
    return pair


def force_of(pair: LegPair, i: int, toe_torque: float = 0.0, up: np.ndarray = UP) -> np.ndarray:
    legs = pair.records[0]["legs"]
    return np.array(spring_force(legs[i], pair.states[i], toe_torque, up))


def force_on(leg: str, joints: np.ndarray, toe_torque: float = 0.0, up: np.ndarray = UP):
    return force_of(pair_at(joints, up), LEGS.index(leg), toe_torque, up)


@pytest.mark.parametrize("leg", LEGS)
@pytest.mark.parametrize("toe_torque", [0.0, -8.0])
@pytest.mark.parametrize("seed", range(5))
def test_springs_balance_the_force_that_the_whole_model_needs(leg, toe_torque, seed):
    q, joints = random_pose(seed, leg)
    needed = DYNAMICS.gravity(q) - DYNAMICS.spring_torque(q)
    needed[joints[6]] -= toe_torque
    # Force ahead and up at the sole and moment about the axis to the left balance these three.
    balance = joints[4:]
    wrench = DYNAMICS.sole_jacobian(q, leg)[[0, 2, 4]][:, balance].T
    ahead, up, _ = np.linalg.solve(wrench, needed[balance])
    pitch = q[COORDINATES.index("pitch")]
    c, s = math.cos(pitch), math.sin(pitch)
    force = force_on(leg, q[joints], toe_torque, np.array([-s, 0.0, c]))
    np.testing.assert_allclose(force, [c * ahead - s * up, 0.0, s * ahead + c * up], atol=0.2)


@pytest.mark.parametrize("leg", LEGS)
def test_relaxed_leg_carries_its_own_lower_part_only(leg):
    knee = math.radians(-45.0)  # where the heel spring is relaxed too
    joints = np.array([0.0, 0.0, 0.4, knee, 0.0, robot.NEUTRAL_TARSUS - knee, -1.6])
    assert 0.0 < force_on(leg, joints)[2] < 25.0
    np.testing.assert_allclose(force_on(leg, joints, up=np.zeros(3)), 0.0, atol=1e-9)


@pytest.mark.parametrize("leg", LEGS)
def test_springs_and_slopes_are_those_of_the_linkage(leg):
    joints = bent(0.1, -0.1, 0.2, 0.0, -0.04, 0.03, 0.0)
    state = pair_at(joints).states[LEGS.index(leg)]
    heel, _, *slopes = heel_angle_and_slopes(*joints[3:6])
    assert state["springs"].tolist() == [joints[4], heel]
    assert state["heel_gradient"].tolist() == slopes


def test_legs_mirror_each_other():
    joints = bent(0.1, -0.05, 0.0, 0.0, -0.04, 0.03, 0.0)
    mirrored = joints * [-1.0, -1.0, 1.0, 1.0, 1.0, 1.0, 1.0]
    up = np.array([-0.1, 0.05, 0.99])
    across = np.array([1.0, -1.0, 1.0])
    right = force_on("right", mirrored, 3.0, up * across)
    np.testing.assert_allclose(force_on("left", joints, 3.0, up), right * across, atol=1e-9)


@pytest.mark.parametrize("leg", LEGS)
@pytest.mark.parametrize("seed", range(5))
def test_lower_leg_weighs_what_the_whole_model_says(leg, seed):
    q, joints = random_pose(seed, leg)
    q[COORDINATES.index("pitch")] = 0.0
    shin, tarsus, toe = DYNAMICS.gravity(q)[joints[4:]]
    state = pair_at(q[joints]).states[LEGS.index(leg)]
    weight = 9.81 * state["lower_leg"] @ UP
    np.testing.assert_allclose(weight, [shin - toe, tarsus - toe], atol=0.03)


@pytest.mark.parametrize(
    "joints",
    [
        bent(0.0, 0.0, 0.0, 0.6, 0.0, 0.4, 0.0),  # the achilles rod does not reach
        bent(0.0, 0.0, 0.0, math.nan, 0.0, 0.0, 0.0),
        bent(0.0, 0.0, 0.0, 0.0, math.inf, 0.0, 0.0),
    ],
)
def test_impossible_angles_show_no_force(joints):
    for leg in LEGS:
        np.testing.assert_array_equal(force_on(leg, joints), 0.0)


def test_force_stays_finite_wherever_the_joints_go():
    pair, rng = LegPair(), np.random.default_rng(0)
    for _ in range(1000):
        joints = rng.uniform(-3.5, 3.5, (2, 7))
        both_legs(joints, np.zeros((2, 7)), np.zeros(2), UP, pair.records[0])
        assert np.isfinite(pair.forces).all()
        for i, state in enumerate(pair.states):
            assert np.isfinite(force_of(pair, i)).all()
            assert np.isfinite(state["springs"]).all()
            assert np.abs(state["heel_gradient"]).max() < 1000.0


def test_the_force_against_gravity_is_that_of_each_leg():
    pair, rates = LegPair(), np.random.default_rng(1).normal(0.0, 1.0, (2, 7))
    joints = np.array(
        [bent(0.1, -0.1, 0.0, 0.0, -0.03, 0.02, 0.1), bent(0.0, 0.1, 0.2, 0.0, -0.02, 0.0, 0.0)]
    )
    torques, up = np.array([3.0, -2.0]), np.array([0.1, -0.05, math.sqrt(1.0 - 0.0125)])
    both_legs(joints, rates, torques, up, pair.records[0])
    for i in range(2):
        force = np.dot(up, force_of(pair, i, torques[i], up))
        assert pair.forces[i] == pytest.approx(force, abs=1e-9)


@pytest.mark.parametrize("force", [0.0, 160.0, 320.0])
@pytest.mark.parametrize("length", [0.3, 0.5, 0.75, 0.95])
def test_springs_of_a_leg_that_a_force_shortens_show_that_force(length, force):
    shortening = leg_shortening(length, force)
    joints = bent_leg(length, force)
    pair = pair_at(joints)
    state = pair.states[0]
    along = state["origins"][2] - state["toe_joint"]
    assert np.linalg.norm(along) == pytest.approx(length, abs=1e-6)
    assert virtual_leg.length(joints[3]) == pytest.approx(length + shortening, abs=1e-9)
    up = along / length
    in_plane = force * up * (1.0, 0.0, 1.0)  # the toe joint is 5 mm beside it
    np.testing.assert_allclose(force_on("left", joints, up=up), in_plane, atol=0.3)


def test_the_springs_shorten_a_bent_leg_more():
    shortening = [leg_shortening(length, 160.0) for length in np.linspace(0.3, 0.95, 12)]
    assert (np.diff(shortening) < 0.0).all()
    assert 0.009 < shortening[-1] < 0.01
    assert 0.06 < shortening[0] < 0.065
