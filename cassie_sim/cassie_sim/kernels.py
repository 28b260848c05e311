"""The inner loops of drives and encoders, compiled.

They run at every physics step, where numpy's call overhead would cost more than the physics.
All arrays are float64 and are changed in place; the classes that own them say what they hold.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from cassie_gaits.compiled import compiled

FloatArray = npt.NDArray[np.float64]


@compiled
def within(values: FloatArray, low: FloatArray, high: FloatArray) -> bool:
    """Whether every value is in the range of its row; NaN is not.

    Args:
        values: Shape (n, m).
        low: Shape (n,).
        high: Shape (n,).
    """
    for i in range(values.shape[0]):
        for k in range(values.shape[1]):
            if not low[i] <= values[i, k] <= high[i]:
                return False
    return True


@compiled
def drive_torques(
    set_points: FloatArray,
    position: FloatArray,
    velocity: FloatArray,
    torque_limit: FloatArray,
    speed_limit: FloatArray,
    pipeline: FloatArray,
    head: int,
    torque_constant: FloatArray,
    applied: FloatArray,
) -> int:
    """Impedance law, torque-speed bound and delay of the ten drives.

    Args:
        set_points: Rows torque, position, velocity, kp, kd. Shape (5, 10).
        position: Measured. Shape (10,), in rad.
        velocity: Measured. Shape (10,), in rad/s.
        torque_limit: Shape (10,), in Nm.
        speed_limit: Without load. Shape (10,), in rad/s.
        pipeline: Torques under way, one row a physics step. Shape (steps + 1, 10), in Nm.
        head: Row of `pipeline` to fill now.
        torque_constant: Shape (10,).
        applied: Torques that act now. Shape (10,), in Nm.

    Returns:
        The next `head`, which is also the row that acts now.
    """
    rows = pipeline.shape[0]
    following = head + 1 if head + 1 < rows else 0
    for i in range(10):
        u = (
            set_points[0, i]
            + set_points[3, i] * (set_points[1, i] - position[i])
            + set_points[4, i] * (set_points[2, i] - velocity[i])
        )
        bound = 2.0 * torque_limit[i] * (1.0 - abs(velocity[i]) / speed_limit[i])
        bound = max(0.0, min(torque_limit[i], bound))
        pipeline[head, i] = max(-bound, min(bound, u))
        applied[i] = pipeline[following, i] * torque_constant[i]
    return following


@compiled
def gather(qpos: FloatArray, indices: npt.NDArray[np.int64], out: FloatArray) -> None:
    """out[i] = qpos[indices[i]]."""
    for i in range(out.shape[0]):
        out[i] = qpos[indices[i]]


@compiled
def count_drives(
    position: FloatArray,
    counts_per_rad: FloatArray,
    taps: FloatArray,
    counts: FloatArray,
    newest: int,
    measured_position: FloatArray,
    measured_velocity: FloatArray,
) -> int:
    """Encoders of the drives: count, truncate toward zero, filter the velocity.

    Args:
        position: True. Shape (10,), in rad.
        counts_per_rad: Shape (10,).
        taps: Of the velocity filter, newest first, in 1/s. Shape (n,).
        counts: Ring of the last counts. Shape (n, 10).
        newest: Row of the newest counts before this step.
        measured_position: Result. Shape (10,), in rad.
        measured_velocity: Result. Shape (10,), in rad/s.

    Returns:
        The new `newest`.
    """
    n = taps.shape[0]
    newest = newest + 1 if newest + 1 < n else 0
    for i in range(10):
        count = math.trunc(position[i] * counts_per_rad[i])
        counts[newest, i] = count
        measured_position[i] = count / counts_per_rad[i]
        total = 0.0
        row = newest
        for k in range(n):
            total += taps[k] * counts[row, i]
            row = row - 1 if row > 0 else n - 1
        measured_velocity[i] = total / counts_per_rad[i]
    return newest


@compiled
def count_joints(
    joints: FloatArray,
    noise: FloatArray,
    counts_per_rad: FloatArray,
    b: FloatArray,
    a: FloatArray,
    x: FloatArray,
    y: FloatArray,
) -> None:
    """Encoders of shin, tarsus and toe: noise, counts, truncation, velocity filter.

    Args:
        joints: True. Shape (6,), in rad.
        noise: To add. Shape (6,), in rad.
        counts_per_rad: Shape (6,).
        b: Feed-forward coefficients of the filter. Shape (4,), in 1/s.
        a: Feedback coefficients after the leading 1. Shape (2,).
        x: Last four readings, newest first. Shape (4, 6), in rad.
        y: Last two velocities, newest first. Shape (2, 6), in rad/s.
    """
    for i in range(6):
        x[3, i] = x[2, i]
        x[2, i] = x[1, i]
        x[1, i] = x[0, i]
        x[0, i] = math.trunc((joints[i] + noise[i]) * counts_per_rad[i]) / counts_per_rad[i]
        new = b[0] * x[0, i] + b[1] * x[1, i] + b[2] * x[2, i] + b[3] * x[3, i]
        new -= a[0] * y[0, i] + a[1] * y[1, i]
        y[1, i] = y[0, i]
        y[0, i] = new
