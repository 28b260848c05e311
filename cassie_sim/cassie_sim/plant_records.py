"""Records in which drives and sensors keep their numbers: C structures for compiled functions.

The classes that own a record hand out views of its fields under their names.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

RecordArray = npt.NDArray[np.void]

TAPS = 9
"""Length of the drives' velocity filter, in physics steps."""

DRIVES_TYPE = np.dtype(
    [
        ("set_points", float, (5, 10)),  # rows torque, position, velocity, kp, kd
        ("damping", float, 10),  # kd while damped, in Nms/rad
        ("torque_limit", float, 10),  # in Nm
        ("speed_limit", float, 10),  # without load, in rad/s
        ("torque_constant", float, 10),  # real by nominal torque
        ("applied", float, 10),  # torques that act now, in Nm
        ("head", np.int64),  # row of the torques under way to fill next
        ("age", np.int64),  # physics steps since the last valid command
        ("timeout", np.int64),  # the same, after which the drives damp
        ("powered", np.int64),
        ("damped", np.int64),
    ]
)
"""The ten drives, see `drives.Drives`."""

SENSORS_TYPE = np.dtype(
    [
        ("position", float, 10),  # of the drives as measured, in rad
        ("velocity", float, 10),  # in rad/s
        ("joints", float, 6),  # shin, tarsus, toe of both legs as measured, in rad
        ("joint_rates", float, 6),  # in rad/s
        ("imu", float, 6),  # sums since the last sample: rad/s, m/s^2
        ("count", np.int64),  # of what is in these sums
        ("faithful", np.int64),  # whether the encoders count; the truth else
        ("counts_per_rad", float, 10),
        ("joint_counts_per_rad", float, 6),
        ("taps", float, TAPS),  # velocity filter of the drives, newest first, in 1/s
        ("counts", float, (TAPS, 10)),  # ring of the last counts
        ("newest", np.int64),  # its row
        ("b", float, 4),  # velocity filter of the joints, feed-forward, in 1/s
        ("a", float, 2),  # the same, feedback after the leading 1
        ("joint_x", float, (4, 6)),  # last readings, newest first, in rad
        ("joint_y", float, (2, 6)),  # last velocities, newest first, in rad/s
        ("noise_row", np.int64),  # of the joints' noise to add next
        ("attitude_row", np.int64),  # of the newest attitude
        ("attitude_bias", float, 2),  # roll and pitch error, in rad
        ("wander", float, 2),  # slow roll and pitch error, in rad
        ("wander_decay", float),  # of it from sample to sample
        ("wander_sigma", float),  # what comes to it, in rad
        ("yaw_drift", float),  # in rad/s
        ("time", float),  # since the start, in s
        ("period", float),  # between samples, in s
        ("imu_sigma", float, 6),  # noise of a sample: rad/s, m/s^2
        ("imu_bias", float, 6),
    ]
)
"""Encoders, their filters and the IMU, see `sensors`."""
