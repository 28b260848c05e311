"""Torques of a swinging leg, against the full dynamics."""

from __future__ import annotations

import numpy as np
import pytest

from cassie_control.control.drives import inertia_torques
from cassie_gaits import virtual_leg
from cassie_gaits.dynamics import RIGID, Dynamics, rigid_pose

DYNAMICS = Dynamics(gravity=0.0)
STEP = 1e-4  # s


def swing(time, *, rolls):
    """Leg roll, pitch and length of a lively swing."""
    roll = 0.1 * np.sin(5.0 * time) if rolls else 0.0
    return np.array([roll, 0.3 * np.sin(7.0 * time), 0.75 + 0.1 * np.cos(9.0 * time)])


def pose(outputs):
    roll, pitch, length = outputs
    knee = virtual_leg.knee_angle(length)
    hip_pitch = virtual_leg.hip_pitch_angle(pitch, 0.0, length)
    toe = virtual_leg.toe_angle(0.0, 0.0, hip_pitch)
    still = (0.0, 0.0, 0.5, -1.2, -1.6)
    return rigid_pose(np.zeros(6), np.array([roll, 0.0, hip_pitch, knee, toe, *still]))


def derivatives(values):
    """Central differences of a function's values one step before, at and after a time."""
    before, now, after = values
    return (after - before) / (2.0 * STEP), (after - 2.0 * now + before) / STEP**2


@pytest.mark.parametrize("time", [0.05, 0.2, 0.35, 0.5, 0.65])
@pytest.mark.parametrize("rolls", [False, True])
def test_torques_are_those_of_the_full_dynamics(time, rolls):
    outputs = [swing(time + shift, rolls=rolls) for shift in (-STEP, 0.0, STEP)]
    q = pose(outputs[1])
    rates, accelerations = derivatives([pose(output) for output in outputs])
    force = RIGID.T @ (DYNAMICS.mass_matrix(q) @ accelerations + DYNAMICS.bias(q, rates))
    roll, _, pitch, knee, toe = force[6:11]
    wanted = derivatives(outputs)
    bend = virtual_leg.knee_angle(outputs[1][2])
    found = inertia_torques(tuple(wanted[0]), tuple(wanted[1]), bend)
    # The toe, which keeps the foot level, leans on the hip.
    assert found[1:] == pytest.approx((pitch - toe, knee), abs=0.15)
    assert found[0] == pytest.approx(roll, abs=0.6)
