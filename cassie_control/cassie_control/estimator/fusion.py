"""Arithmetic of the estimator, compiled. All arrays are float64 and written in place."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from cassie_gaits.compiled import compiled

FloatArray = npt.NDArray[np.float64]

GRAVITY = 9.81
SOLE_RADIUS = 0.02
_HANGING_LEAK = 1.0  # 1/s: without load the velocity decays, as there is nothing to correct it
_ACCELERATION_VARIANCE = 0.05**2  # (m/s^2)^2 s, from the IMU's tilt error


@compiled
def euler_angles(
    orientation: FloatArray,
    angular_velocity: FloatArray,
    rotation: FloatArray,
    angles: FloatArray,
    rates: FloatArray,
) -> None:
    """Rotation matrix, z-y-x Euler angles and their rates.

    Args:
        orientation: Pelvis to world, x y z w. Shape (4,).
        angular_velocity: Pelvis frame. Shape (3,), in rad/s.
        rotation: Result, pelvis to world. Shape (3, 3).
        angles: Result, yaw, pitch, roll. Shape (3,), in rad.
        rates: Result, their time derivatives. Shape (3,), in rad/s.
    """
    x, y, z, w = orientation[0], orientation[1], orientation[2], orientation[3]
    scale = 2.0 / (x * x + y * y + z * z + w * w)
    rotation[0, 0] = 1.0 - scale * (y * y + z * z)
    rotation[0, 1] = scale * (x * y - w * z)
    rotation[0, 2] = scale * (x * z + w * y)
    rotation[1, 0] = scale * (x * y + w * z)
    rotation[1, 1] = 1.0 - scale * (x * x + z * z)
    rotation[1, 2] = scale * (y * z - w * x)
    rotation[2, 0] = scale * (x * z - w * y)
    rotation[2, 1] = scale * (y * z + w * x)
    rotation[2, 2] = 1.0 - scale * (x * x + y * y)
    sine = max(-1.0, min(1.0, -rotation[2, 0]))
    angles[0] = math.atan2(rotation[1, 0], rotation[0, 0])
    angles[1] = math.asin(sine)
    angles[2] = math.atan2(rotation[2, 1], rotation[2, 2])
    c_roll, s_roll = math.cos(angles[2]), math.sin(angles[2])
    c_pitch = max(0.05, math.cos(angles[1]))  # a robot on its nose has fallen long before
    turning = s_roll * angular_velocity[1] + c_roll * angular_velocity[2]
    rates[0] = turning / c_pitch
    rates[1] = c_roll * angular_velocity[1] - s_roll * angular_velocity[2]
    rates[2] = angular_velocity[0] + turning * math.sin(angles[1]) / c_pitch


@compiled
def _rotated(rotation: FloatArray, vector: Any, k: int) -> float:
    x, y, z = rotation[k, 0], rotation[k, 1], rotation[k, 2]
    value: float = x * vector[0] + y * vector[1] + z * vector[2]
    return value


@compiled
def _swept(omega: FloatArray, point: Any, k: int) -> float:
    i, j = (k + 1) % 3, (k + 2) % 3
    value: float = omega[i] * point[j] - omega[j] * point[i]
    return value


@compiled
def fuse_velocity(
    rotation: FloatArray,
    omega: FloatArray,
    specific_force: FloatArray,
    imu: FloatArray,
    feet: FloatArray,
    foot_velocities: FloatArray,
    load: FloatArray,
    period: float,
    velocity_bandwidth: float,
    height_bandwidth: float,
    velocity_noise: float,
    imu_velocity: FloatArray,
    velocity: FloatArray,
    position: FloatArray,
    variance: FloatArray,
) -> None:
    """Predict the pelvis's velocity with the accelerometer, correct it with the loaded feet.

    Args:
        rotation: Pelvis to world. Shape (3, 3).
        omega: Angular velocity, pelvis frame. Shape (3,), in rad/s.
        specific_force: At the IMU, pelvis frame. Shape (3,), in m/s^2.
        imu: Position of the IMU in the pelvis. Shape (3,), in m.
        feet: Middle of each sole in the pelvis. Shape (2, 3), in m.
        foot_velocities: Against the pelvis. Shape (2, 3), in m/s.
        load: Of each foot, 0..1. Shape (2,).
        period: In s.
        velocity_bandwidth, height_bandwidth: In 1/s.
        velocity_noise: In m/s.
        imu_velocity: State: velocity of the IMU in the world. Shape (3,), in m/s.
        velocity: Result: of the pelvis origin. Shape (3,), in m/s.
        position: State: of the pelvis origin. Shape (3,), in m.
        variance: State: of velocity (m^2/s^2) and position (m^2). Shape (2,).
    """
    total = load[0] + load[1]
    share = min(1.0, total)
    gain = 1.0 - math.exp(-velocity_bandwidth * share * period)
    arm = (_swept(omega, imu, 0), _swept(omega, imu, 1), _swept(omega, imu, 2))
    for k in range(3):
        imu_velocity[k] += period * _rotated(rotation, specific_force, k)
    imu_velocity[2] -= period * GRAVITY
    if total > 0.0:
        still = (
            _still_velocity(omega, feet, foot_velocities, load, total, 0),
            _still_velocity(omega, feet, foot_velocities, load, total, 1),
            _still_velocity(omega, feet, foot_velocities, load, total, 2),
        )
        for k in range(3):
            measured = _rotated(rotation, still, k) + _rotated(rotation, arm, k)
            imu_velocity[k] += gain * (measured - imu_velocity[k])
    else:
        for k in range(3):
            imu_velocity[k] *= 1.0 - _HANGING_LEAK * period
    for k in range(3):
        velocity[k] = imu_velocity[k] - _rotated(rotation, arm, k)
        position[k] += period * velocity[k]
    if total > 0.0:
        follow = 1.0 - math.exp(-height_bandwidth * share * period)
        position[2] += follow * (_standing_height(rotation, feet, load, total) - position[2])
    noise = velocity_noise * velocity_noise
    variance[0] = (1.0 - gain) ** 2 * (variance[0] + _ACCELERATION_VARIANCE * period)
    variance[0] += gain * gain * noise + gain * 0.1 * noise
    variance[1] += variance[0] * period * 0.1


@compiled
def _still_velocity(
    omega: FloatArray,
    feet: FloatArray,
    foot_velocities: FloatArray,
    load: FloatArray,
    total: float,
    k: int,
) -> float:
    """Pelvis velocity, in the pelvis frame, at which the loaded feet stand still."""
    value = 0.0
    for i in range(2):
        value -= load[i] / total * (foot_velocities[i, k] + _swept(omega, feet[i], k))
    return value


@compiled
def _standing_height(
    rotation: FloatArray, feet: FloatArray, load: FloatArray, total: float
) -> float:
    """Pelvis height at which the loaded feet are on the ground."""
    height = 0.0
    for i in range(2):
        height += load[i] / total * (SOLE_RADIUS - _rotated(rotation, feet[i], 2))
    return height


@compiled
def com_in_heading(
    rotation: FloatArray,
    yaw: float,
    omega: FloatArray,
    velocity: FloatArray,
    feet: FloatArray,
    moment: FloatArray,
    moment_rate: FloatArray,
    mass: float,
    com_position: FloatArray,
    com_velocity: FloatArray,
) -> None:
    """Centre of mass from the midpoint of the feet, and its velocity, in the heading frame.

    Args:
        rotation: Pelvis to world. Shape (3, 3).
        yaw: In rad.
        omega: Angular velocity, pelvis frame. Shape (3,), in rad/s.
        velocity: Of the pelvis in the world. Shape (3,), in m/s.
        feet: Middle of each sole in the pelvis. Shape (2, 3), in m.
        moment: Sum of mass times position, pelvis frame. Shape (3,), in kg m.
        moment_rate: Its rate against the pelvis. Shape (3,), in kg m/s.
        mass: Of the robot. In kg.
        com_position: Result. Shape (3,), in m.
        com_velocity: Result. Shape (3,), in m/s.
    """
    com = (moment[0] / mass, moment[1] / mass, moment[2] / mass)
    offset = (
        com[0] - 0.5 * (feet[0, 0] + feet[1, 0]),
        com[1] - 0.5 * (feet[0, 1] + feet[1, 1]),
        com[2] - 0.5 * (feet[0, 2] + feet[1, 2]),
    )
    drift = (
        moment_rate[0] / mass + _swept(omega, com, 0),
        moment_rate[1] / mass + _swept(omega, com, 1),
        moment_rate[2] / mass + _swept(omega, com, 2),
    )
    c, s = math.cos(yaw), math.sin(yaw)
    px, py = _rotated(rotation, offset, 0), _rotated(rotation, offset, 1)
    vx = velocity[0] + _rotated(rotation, drift, 0)
    vy = velocity[1] + _rotated(rotation, drift, 1)
    com_position[0] = c * px + s * py
    com_position[1] = c * py - s * px
    com_position[2] = _rotated(rotation, offset, 2)
    com_velocity[0] = c * vx + s * vy
    com_velocity[1] = c * vy - s * vx
    com_velocity[2] = velocity[2] + _rotated(rotation, drift, 2)
