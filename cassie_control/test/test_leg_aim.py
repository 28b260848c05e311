"""Aiming the swing leg, against the leg's own kinematics."""

from __future__ import annotations

import numpy as np
import pytest
from robot_states import leg_joints, readings_of, state_of

from cassie_control.control.robot import HIP_ROLL_X, HIP_Y, aim_leg
from cassie_gaits import virtual_leg


@pytest.mark.parametrize("seed", range(12))
def test_the_toe_joint_comes_to_where_it_is_aimed(seed):
    rng = np.random.default_rng(seed)
    x, y, down = rng.uniform((-0.35, -0.15, 0.75), (0.35, 0.3, 0.95))
    hip_yaw, pitch = rng.uniform(-0.25, 0.25), rng.uniform(-0.05, 0.05)
    roll, leg_pitch, length = aim_leg(x, y, down, hip_yaw, pitch)
    joints = leg_joints(
        hip_roll=roll,
        hip_yaw=hip_yaw,
        hip_pitch=virtual_leg.hip_pitch_angle(leg_pitch, pitch, length),
        knee=virtual_leg.knee_angle(length),
    )
    readings = readings_of(state_of(joints, leg_joints(), pitch=pitch))
    hip = readings.R_HP @ np.array([HIP_ROLL_X, HIP_Y, 0.0])
    toe = np.array(readings.legs[0].toe_joint) - hip
    assert toe == pytest.approx((x, y, -down), abs=0.012)
