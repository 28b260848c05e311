"""Angular momentum from joint rates, against Pinocchio's and a mass that moves as a whole."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from robot_states import leg_joints, put, put_toe_joint, random_state, readings_of, state_of

from cassie_control.planner.momentum import make_masses, momentum_about_pelvis, momentum_velocity
from cassie_gaits.dynamics import RIGID, Dynamics, rigid_pose
from cassie_gaits.pinocchio_model import build_tree


@pytest.mark.parametrize("seed", range(4))
def test_it_is_that_of_the_rigid_bodies(seed):
    rng, dynamics, tree = np.random.default_rng(seed), Dynamics(), build_tree()
    drives = np.tile([0.05, 0.02, 0.5, -1.2, -1.6], 2) + rng.uniform(-0.15, 0.15, 10)
    q = rigid_pose(np.zeros(6), drives)
    v = RIGID @ rng.uniform(-1.0, 1.0, 16)
    v[:3] = 0.0
    data, full = tree.model.createData(), dynamics.configuration(q)
    pin.computeCentroidalMomentum(tree.model, data, full, dynamics.embedding(q) @ v)
    pin.centerOfMass(tree.model, data, full, dynamics.embedding(q) @ v)
    expected = data.hg.angular + np.cross(data.com[0], data.hg.linear)
    joints, rates = q[6:].reshape(2, 7), v[6:].reshape(2, 7)
    found = momentum_about_pelvis(joints, rates, v[[5, 4, 3]], make_masses())
    # The rods count as masses at the links that carry them.
    assert found == pytest.approx(expected, abs=0.04 * np.linalg.norm(expected))


def test_a_pose_that_moves_as_a_whole_has_the_velocity_of_its_mass():
    readings = readings_of(state_of(leg_joints(), leg_joints()))
    put(readings, velocity=(0.7, -0.3, 0.0), com_velocity=(0.7, -0.3, 0.0))
    found = momentum_velocity(readings.records, 0, make_masses())
    assert found == pytest.approx((0.7, -0.3), abs=1e-12)


def test_it_says_the_same_about_any_foot_while_the_mass_does_not_rise():
    readings = readings_of(random_state(3))
    vx, vy, _ = readings.com_velocity
    put(readings, com_velocity=(vx, vy, 0.0))
    masses = make_masses()
    left, right = readings.legs
    put_toe_joint(readings, 1, (right.toe_joint[0], right.toe_joint[1], left.toe_joint[2]))
    by_left, by_right = (momentum_velocity(readings.records, stance, masses) for stance in (0, 1))
    assert by_left == pytest.approx(by_right)
