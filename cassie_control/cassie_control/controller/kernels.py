"""Small vector arithmetic of the controller, compiled: numpy's call overhead would dominate."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from cassie_control.controller.records import RecordArray
from cassie_gaits.compiled import compiled
from cassie_gaits.leg_kernels import both_legs

FloatArray = npt.NDArray[np.float64]


@compiled
def set_tilt(pitch: float, roll: float, tilt: FloatArray) -> None:
    """Rotation from pelvis to heading frame, from pitch and roll in rad, into `tilt` (3, 3)."""
    cp, sp = math.cos(pitch), math.sin(pitch)
    cr, sr = math.cos(roll), math.sin(roll)
    tilt[0, 0], tilt[0, 1], tilt[0, 2] = cp, sp * sr, sp * cr
    tilt[1, 0], tilt[1, 1], tilt[1, 2] = 0.0, cr, -sr
    tilt[2, 0], tilt[2, 1], tilt[2, 2] = -sp, cp * sr, cp * cr


@compiled
def turned(rotation: FloatArray, vector: FloatArray) -> tuple[float, float, float]:
    """rotation (3, 3) times vector (3,)."""
    x, y, z = vector[0], vector[1], vector[2]
    return (
        rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z,
        rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z,
        rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z,
    )


@compiled
def clamp(values: FloatArray, low: FloatArray, high: FloatArray) -> int:
    """Clamp each value in place; the index of the first that is not finite, or -1.

    Args:
        values, low, high: All of the same shape (n,) and unit.
    """
    for i in range(values.size):
        if not math.isfinite(values[i]):
            return i
        values[i] = max(low[i], min(high[i], values[i]))
    return -1


@compiled
def read_robot(states: RecordArray, pairs: RecordArray, robots: RecordArray) -> None:
    """What the control laws read of a state estimate.

    Args:
        states: `RobotState.record`. Shape (1,).
        pairs: Result, kinematics of both legs, `leg_chain.LegPair.record`. Shape (1,).
        robots: Result, of `records.ROBOT_TYPE`. Shape (1,).
    """
    estimate, pair, robot = states[0], pairs[0], robots[0]
    q, v = estimate.q, estimate.v
    both_legs(q[6:].reshape(2, 7), v[6:].reshape(2, 7), (0.0, 0.0), (0.0, 0.0, 1.0), pair)
    legs = pair.states
    robot.height, robot.yaw, robot.pitch, robot.roll = q[2], q[3], q[4], q[5]
    robot.yaw_rate, robot.pitch_rate, robot.roll_rate = v[3], v[4], v[5]
    set_tilt(q[4], q[5], robot.tilt)
    for i in range(2):
        for k in range(7):
            robot.joints[i, k], robot.rates[i, k] = q[6 + 7 * i + k], v[6 + 7 * i + k]
        robot.load[i], robot.force[i] = estimate.foot_load[i], estimate.foot_force[i]
        robot.contact[i] = estimate.contact_probability[i]
        ankle, foot = turned(robot.tilt, legs[i].ankle), turned(robot.tilt, legs[i].foot)
        for k in range(3):
            robot.ankle[i, k], robot.foot[i, k] = ankle[k], foot[k]
    for k in range(3):
        robot.angular_velocity[k] = estimate.angular_velocity[k]
        middle = 0.5 * (robot.foot[0, k] + robot.foot[1, k])
        robot.com_from_feet[k] = estimate.com_position[k]
        robot.com[k] = estimate.com_position[k] + middle
        robot.com_velocity[k] = estimate.com_velocity[k]
    c, s = math.cos(q[3]), math.sin(q[3])
    robot.velocity[0] = c * v[0] + s * v[1]
    robot.velocity[1] = c * v[1] - s * v[0]
    robot.velocity[2] = v[2]
