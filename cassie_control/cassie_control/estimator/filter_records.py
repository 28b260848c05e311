"""Records in which the invariant filter keeps its state and its figures, for compiled functions."""

from __future__ import annotations

import numpy as np

from cassie_control.estimator.filter_kernels import SIZE

FILTER_TYPE = np.dtype(
    [
        ("rotation", float, (3, 3)),  # IMU to world
        ("points", float, (4, 3)),  # world: velocity, position of the IMU, left, right contact
        ("gyro_bias", float, 3),  # rad/s
        ("accelerometer_bias", float, 3),  # m/s^2
        ("covariance", float, (SIZE, SIZE)),
        ("soles", float, (2, 3, 3)),  # orientation of each foot in the world at the last sample
        ("ground", float),  # rise of the ground ahead, along the feet
        ("doubt", float, 2),  # 0..1, of each foot: 1 when it slips, fading
    ]
)
"""State of the filter."""

NOISE_TYPE = np.dtype(
    [
        ("period", float),  # s
        ("gyro", float),  # variances by time: (rad/s)^2 s
        ("accelerometer", float),  # (m/s^2)^2 s
        ("gyro_bias", float),  # (rad/s)^2 / s
        ("largest_gyro_bias", float),  # rad/s
        ("accelerometer_bias", float),  # (m/s^2)^2 / s
        ("stance", float),  # m^2/s, of a contact under load
        ("swing", float),  # m^2/s, of a foot in the air
        ("kinematics", float),  # m^2, of a foot's position from the pelvis
        ("tilt", float),  # rad^2, of the IMU's own roll and pitch, as white noise
        ("heading", float),  # rad^2, of its yaw
        ("hanging", float),  # (m/s)^2, of the velocity of a robot that does not touch the ground
        ("gate", float),  # squared Mahalanobis distance beyond which a foot slips
        ("slip_decay", float),  # of the doubt, over one period
        ("attitude_delay", float),  # s
        ("sole_radius", float),  # m
        ("sole_line", float, 3),  # from the middle of the sole's centre line to its front, toe link
        ("sole_flat", float),  # m, height of a sole's end over the ground below which both touch
        ("ground_time", float),  # s, in which the ground's rise is learned from a still foot
        ("ground_still", float),  # rad/s, turn rate of such a foot
    ]
)
"""What the filter takes for granted."""
