"""Inverse dynamics from the stance foot: the same robot as the 20-DoF model with closed loops."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from cassie_gaits import linkage, robot
from cassie_gaits.dynamics import RIGID, Dynamics
from cassie_gaits.optimize import rods
from cassie_gaits.optimize.posture import places
from cassie_gaits.optimize.step_model import instant

RNG = np.random.default_rng(0)
Y = np.array([0.03, 0.02, 0.05, 0.8, 0.02, -0.03, 0.2, 0.7, 0.1, 0.04, -0.15])


@pytest.mark.parametrize("knee", [-2.5, -1.8, -1.2, -0.7])
def test_heel_spring_follows_the_knee_as_in_the_linkage(knee):
    expected = linkage.heel_angle(knee, 0.0, robot.NEUTRAL_TARSUS - knee)
    assert float(rods.heel_angle(ca.DM(knee))) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("toe", [-2.3, -1.7, -1.0])
def test_foot_crank_follows_the_toe_as_in_the_linkage(toe):
    assert float(rods.crank_angle(ca.DM(toe))) == pytest.approx(
        linkage.crank_angles(toe)[0], abs=1e-12
    )


def full_coordinates(at):
    """The 20 coordinates of an instant and their first two derivatives."""

    def leg(joints):
        tarsus = robot.NEUTRAL_TARSUS - joints[3]
        return ca.vertcat(joints[:4], 0.0, tarsus, joints[4])

    pelvis, _, _ = places(at.posture)
    q = ca.vertcat(pelvis, at.posture.torso, leg(at.posture.swing), leg(at.posture.stance))
    v = ca.jtimes(q, at.y, at.yd)
    return q, v, ca.jtimes(v, at.y, at.yd) + ca.jtimes(v, at.yd, at.ydd)


@pytest.mark.parametrize(("slope", "payload"), [(0.0, 0.0), (0.15, 0.0), (-0.1, 8.0)])
def test_torques_and_ground_wrench_balance_the_pinocchio_model(slope, payload):
    at = instant()
    wanted = [*full_coordinates(at), at.efforts.stance, at.efforts.swing, at.force, at.moment]
    symbols = [at.y, at.yd, at.ydd, at.slope, at.asymmetry, at.payload]
    function = ca.Function("f", symbols, wanted)
    yd, ydd = RNG.normal(size=11) * 0.5, RNG.normal(size=11) * 5.0
    results = [np.array(part).ravel() for part in function(Y, yd, ydd, slope, 1.0, payload)]
    q, v, a, stance, swing, force, moment = results
    model = Dynamics(pelvis=replace(robot.PELVIS, mass=robot.PELVIS.mass + payload))
    sole = model.sole_jacobian(q, "right")
    balance = model.mass_matrix(q) @ a + model.bias(q, v) - sole.T @ np.r_[force, moment]
    rest = RIGID.T @ balance
    np.testing.assert_allclose(rest[:6], 0.0, atol=1e-5)
    np.testing.assert_allclose(rest[6:], np.r_[swing, stance], atol=1e-5)
    np.testing.assert_allclose((sole @ v)[[0, 1, 2]], 0.0, atol=1e-12)
