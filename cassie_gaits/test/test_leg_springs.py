"""Foot force from the springs: against the whole dynamics, and refusals."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cassie_gaits import robot
from cassie_gaits.dynamics import Dynamics
from cassie_gaits.errors import KinematicsError
from cassie_gaits.leg_springs import foot_force
from cassie_gaits.names import COORDINATES, LEGS

DYNAMICS = Dynamics()


@pytest.mark.parametrize("leg", LEGS)
@pytest.mark.parametrize("toe_torque", [0.0, -8.0])
@pytest.mark.parametrize("seed", range(5))
def test_springs_balance_the_force_that_the_whole_model_needs(leg, toe_torque, seed):
    rng = np.random.default_rng(seed)
    pitch, hip, knee = rng.uniform(-0.2, 0.2), rng.uniform(0.3, 0.8), rng.uniform(-2.0, -0.9)
    shin, extra, toe = rng.uniform(-0.06, 0.0), rng.uniform(-0.02, 0.05), rng.uniform(-2.0, -1.2)
    angles = (hip, knee, shin, robot.NEUTRAL_TARSUS - knee + extra, toe)
    q = np.zeros(20)
    q[COORDINATES.index("pitch")] = pitch
    names = ("hip_pitch", "knee", "shin", "tarsus", "toe")
    rows = [COORDINATES.index(f"{leg}_{name}") for name in names]
    q[rows] = angles
    for name in ("knee", "tarsus"):  # the other leg anywhere its rods reach
        other = COORDINATES.index(f"{LEGS[1 - LEGS.index(leg)]}_{name}")
        q[other] = -1.0 if name == "knee" else 1.0 + robot.NEUTRAL_TARSUS
    balance = rows[2:]
    needed = DYNAMICS.gravity(q) - DYNAMICS.spring_torque(q)
    needed[rows[4]] -= toe_torque
    jacobian = DYNAMICS.sole_jacobian(q, leg)
    # Force ahead and up at the sole, and moment about the axis to the left.
    wrench = jacobian[[0, 2, 4]][:, balance].T
    ahead, up, _ = np.linalg.solve(wrench, needed[balance])
    force = foot_force(pitch, *angles[:4], toe_torque=toe_torque)
    np.testing.assert_allclose(force, [ahead, up], atol=0.5)


def test_relaxed_leg_carries_next_to_nothing():
    knee = math.radians(-45.0)
    force = foot_force(0.0, 0.4, knee, 0.0, robot.NEUTRAL_TARSUS - knee)
    assert np.hypot(*force) < 25.0


def test_straight_lower_leg_and_missing_number_are_refused():
    with pytest.raises(KinematicsError, match="in line"):
        foot_force(0.0, 0.4, -0.6, 0.0, math.atan2(0.02, 0.43476) + math.atan2(0.04, 0.408) - 2e-4)
    with pytest.raises(KinematicsError):
        foot_force(0.0, 0.4, math.nan, 0.0, 1.0)
