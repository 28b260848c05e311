"""The sensor monitor's look at a sample, compiled. See `monitor` for the reasoning."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from cassie_control.estimator.acceleration_kernels import look_at_acceleration
from cassie_control.estimator.delay_kernels import P, V
from cassie_control.estimator.pair_kernels import (
    APART_TIME,
    IMU,
    PAIRS,
    REST_TIME,
    go_on,
    look_at_pair,
)
from cassie_gaits.compiled import compiled

FloatArray = npt.NDArray[np.float64]
RecordArray = npt.NDArray[np.void]

BELIEVED, RESTED = 1, 2
"""What `inspect` finds: all of the sample can be believed; it has come to rest without power."""


@compiled
def arrange(
    orientation: FloatArray,
    angular_velocity: FloatArray,
    linear_acceleration: FloatArray,
    drive_position: FloatArray,
    drive_velocity: FloatArray,
    joint_position: FloatArray,
    joint_velocity: FloatArray,
    watches: RecordArray,
) -> bool:
    """Take in a sample; whether the orientation is one.

    Args:
        orientation to joint_velocity: Fields of Sensors.
        watches: Of `monitor_records.WATCH_TYPE`. Shape (1,).
    """
    watch = watches[0]
    for i in range(10):
        watch.position[i], watch.velocity[i] = drive_position[i], drive_velocity[i]
    for i in range(6):
        watch.position[10 + i], watch.velocity[10 + i] = joint_position[i], joint_velocity[i]
    for k in range(3):
        watch.velocity[IMU + k] = angular_velocity[k]
        watch.acceleration[2, k] = watch.acceleration[1, k]
        watch.acceleration[1, k] = watch.acceleration[0, k]
        watch.acceleration[0, k] = linear_acceleration[k]
    q, p = orientation, watch.last_orientation
    square = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
    valid = 0.9 < square < 1.1  # NaN compares false
    if not valid:
        for k in range(3):
            watch.position[IMU + k] = math.nan
        return False
    if watch.ticks == 0:
        for k in range(4):
            p[k] = q[k]
            if watch.bad[P, IMU] <= 0.0:
                watch.orientation[k] = q[k]
    sign = 2.0 if q[0] * p[0] + q[1] * p[1] + q[2] * p[2] + q[3] * p[3] > 0.0 else -2.0
    x = p[3] * q[0] - p[0] * q[3] - p[1] * q[2] + p[2] * q[1]
    y = p[3] * q[1] - p[1] * q[3] - p[2] * q[0] + p[0] * q[2]
    z = p[3] * q[2] - p[2] * q[3] - p[0] * q[1] + p[1] * q[0]
    watch.position[IMU] = watch.last_position[IMU] + sign * x
    watch.position[IMU + 1] = watch.last_position[IMU + 1] + sign * y
    watch.position[IMU + 2] = watch.last_position[IMU + 2] + sign * z
    for k in range(4):
        p[k] = q[k]
    return True


@compiled
def inspect(
    samples: RecordArray,
    watches: RecordArray,
    limits: RecordArray,
    expected: FloatArray,
    force: float,
) -> int:
    """Take in a sample and `look`.

    Returns:
        `BELIEVED` if all of it can be believed, plus `RESTED` at the moment from which on the
        robot has rested without power for `REST_TIME`, and at which a channel is believed again
        later in that rest.

    Args:
        samples: `Sensors.record`. Shape (1,).
        watches: Of `monitor_records.WATCH_TYPE`. Shape (1,).
        limits, expected, force: See `look`.
    """
    sample, watch = samples[0], watches[0]
    arrange(
        sample.orientation,
        sample.angular_velocity,
        sample.linear_acceleration,
        sample.drive_position,
        sample.drive_velocity,
        sample.joint_position,
        sample.joint_velocity,
        watches,
    )
    _look_at_torques(sample.drive_torque, watch, limits[0])
    _rest(watch, limits[0], sample.power)
    look(watches, limits, expected, force)
    found = 0
    if watch.bad.max() <= 0.0 and watch.bad_acceleration.max() <= 0.0:
        found = BELIEVED if watch.bad_torque.max() <= 0.0 else 0
    if watch.moved > 0 and watch.rest >= REST_TIME:
        watch.moved = 0
        found += RESTED
    return found


@compiled
def _rest(watch: Any, limit: Any, power: float) -> None:
    """For how long it has had no power and hung or lain still, as far as its sensors tell."""
    still = power < 0.5
    watch.powered = 0 if still else 1
    if not still:
        watch.used = 1
    else:
        for i in range(PAIRS):
            if watch.bad[V, i] <= 0.0 and not abs(watch.velocity[i]) < limit.still[i]:
                still = False
    if still:
        watch.rest += limit.period
    else:
        watch.rest, watch.moved = 0.0, watch.used


@compiled
def _look_at_torques(drive_torque: FloatArray, watch: Any, limit: Any) -> None:
    """Nothing tells a wrong torque, except where the drive cannot give it."""
    for i in range(10):
        watch.bad_torque[i] = max(0.0, watch.bad_torque[i] - limit.period)
        if not abs(drive_torque[i]) <= limit.torque[i]:  # NaN compares false
            watch.bad_torque[i] = limit.hold


@compiled
def look(
    watches: RecordArray,
    limits: RecordArray,
    expected: FloatArray,
    force: float,
) -> None:
    """Compare what belongs together; afterwards `bad` and `trusted` are those of this sample.

    Args:
        watches: Of `monitor_records.WATCH_TYPE`. Shape (1,).
        limits: Of `monitor_records.LIMITS_TYPE`. Shape (1,).
        expected: Acceleration of the last sample after `expect_acceleration`. Shape (3,), in m/s^2.
        force: Of both feet at the last sample. In N.
    """
    watch, limit = watches[0], limits[0]
    if watch.ticks == 0:
        for i in range(PAIRS):
            p, v = watch.position[i], watch.velocity[i]
            watch.last_position[i] = p if math.isfinite(p) else 0.0
            watch.last_velocity[:, i] = v if math.isfinite(v) else 0.0
            if watch.bad[P, i] == 0.0 and math.isfinite(p):
                watch.trusted[P, i] = p
            if watch.bad[V, i] == 0.0 and math.isfinite(v):
                watch.trusted[V, i] = v
        watch.acceleration[1:] = watch.acceleration[0]
    for k in range(3):
        rate = watch.velocity[IMU + k]
        watch.turned[k] *= math.exp(-limit.period / APART_TIME)
        watch.turned[k] += limit.period * rate if math.isfinite(rate) else 0.0
    for i in range(PAIRS):
        look_at_pair(watch, limit, i)
    turned = max(watch.bad[P, IMU], watch.bad[P, IMU + 1], watch.bad[P, IMU + 2])
    for i in range(IMU, PAIRS):
        watch.bad[P, i] = turned
    for i in range(PAIRS):
        go_on(watch, limit, i)
    _turn(watch, limit, turned > 0.0)
    look_at_acceleration(watch, limit, expected, force)
    watch.ticks += 1


@compiled
def _turn(watch: Any, limit: Any, bad: bool) -> None:
    """The orientation to go on with: the measured one, or the last one turned by the gyro."""
    q = watch.orientation
    if not bad:
        for k in range(4):
            q[k] = watch.last_orientation[k]
        return
    half = 0.5 * limit.period
    x, y, z = (
        half * watch.trusted[V, 16],
        half * watch.trusted[V, 17],
        half * watch.trusted[V, 18],
    )
    a, b, c, w = q[0], q[1], q[2], q[3]
    q[0] = a + w * x + b * z - c * y
    q[1] = b + w * y + c * x - a * z
    q[2] = c + w * z + a * y - b * x
    q[3] = w - a * x - b * y - c * z
    square = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
    scale = 1.0 / math.sqrt(square) if square > 0.0 else 0.0  # 0 before the first orientation
    for k in range(4):
        q[k] *= scale
