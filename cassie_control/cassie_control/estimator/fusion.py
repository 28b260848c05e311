"""The pelvis from either estimator, and the CoM, compiled. Results are written in place."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from cassie_gaits.compiled import compiled

FloatArray = npt.NDArray[np.float64]
RecordArray = npt.NDArray[np.void]

GRAVITY = 9.81
SOLE_RADIUS = 0.02
_VELOCITY, _POSITION, _GYRO_BIAS = 3, 6, 15  # rows of the covariance, see `invariant`
_HANGING_LEAK = 1.0  # 1/s: without load the velocity decays, as there is nothing to correct it
_ACCELERATION_VARIANCE = 0.05**2  # (m/s^2)^2 s, from the IMU's tilt error


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
    legs: RecordArray,
    pelvis_moment: FloatArray,
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
        legs: Kinematics of both, see `leg.LegPair`. Shape (2,).
        pelvis_moment: Mass times centre of mass of the pelvis. Shape (3,), in kg m.
        mass: Of the robot. In kg.
        com_position: Result. Shape (3,), in m.
        com_velocity: Result. Shape (3,), in m/s.
    """
    left, right = legs[0], legs[1]
    com, offset, drift = np.empty(3), np.empty(3), np.empty(3)
    for k in range(3):
        com[k] = (pelvis_moment[k] + left.com_moment[k] + right.com_moment[k]) / mass
        offset[k] = com[k] - 0.5 * (left.foot[k] + right.foot[k])
    for k in range(3):
        drift[k] = (left.com_rate[k] + right.com_rate[k]) / mass + _swept(omega, com, k)
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


@compiled
def read_pelvis(
    filter_state: Any, noise: Any, body: Any, angular_velocity: FloatArray, state: Any
) -> bool:
    """The pelvis's origin from the filter's IMU; False where the filter has diverged.

    Args:
        filter_state: Of `invariant.FILTER_TYPE`.
        noise: Of `invariant.NOISE_TYPE`.
        body: Of `base.BODY_TYPE`; the height of its ground follows the loaded feet.
        angular_velocity: Measured. Shape (3,), in rad/s.
        state: Result, of `RobotState.RECORD`: angular velocity less its bias, position with the
            height above that ground, velocity, covariance.
    """
    P, R, points = filter_state.covariance, filter_state.rotation, filter_state.points
    rate, load, covariance, imu = (
        state.angular_velocity,
        state.foot_load,
        state.covariance,
        body.imu,
    )
    for k in range(3):
        rate[k] = angular_velocity[k] - filter_state.gyro_bias[k]
    swept = (_swept(rate, imu, 0), _swept(rate, imu, 1), _swept(rate, imu, 2))
    total = load[0] + load[1]
    if total > 0.0:
        sole = (load[0] * points[2, 2] + load[1] * points[3, 2]) / total
        follow = 1.0 - math.exp(-body.height_bandwidth * min(1.0, total) * noise.period)
        body.ground += follow * (sole - noise.sole_radius - body.ground)
    for k in range(3):
        state.v[k] = points[0, k] - _rotated(R, swept, k)
        state.q[k] = points[1, k] - _rotated(R, imu, k) - (body.ground if k == 2 else 0.0)
        covariance[k] = _point_variance(P, points[1], _POSITION, k)
        covariance[6 + k] = _point_variance(P, points[0], _VELOCITY, k)
        covariance[9 + k] = P[_GYRO_BIAS + k, _GYRO_BIAS + k] + noise.gyro / noise.period
    heading = math.hypot(R[0, 0], R[1, 0])
    c, s = (R[0, 0] / heading, R[1, 0] / heading) if heading > 0.0 else (1.0, 0.0)
    covariance[3] = P[2, 2]
    covariance[4] = s * s * P[0, 0] + c * c * P[1, 1] - 2.0 * s * c * P[0, 1]
    covariance[5] = c * c * P[0, 0] + s * s * P[1, 1] + 2.0 * s * c * P[0, 1]
    total = R.sum() + points.sum() + filter_state.accelerometer_bias.sum()
    sound = math.isfinite(total + filter_state.ground)
    for k in range(len(P)):
        sound = sound and 0.0 < P[k, k] < math.inf  # NaN compares false
    return sound


@compiled
def _point_variance(P: FloatArray, point: FloatArray, at: int, k: int) -> float:
    """Of one coordinate of x: its error is that of the filter plus rotation error x x."""
    i, j = (k + 1) % 3, (k + 2) % 3
    a, b = point[j], -point[i]
    value: float = P[at + k, at + k] + 2.0 * (a * P[at + k, i] + b * P[at + k, j])
    value += a * a * P[i, i] + b * b * P[j, j] + 2.0 * a * b * P[i, j]
    return value
