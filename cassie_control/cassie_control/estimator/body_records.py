"""Record of what every estimator computes with, for compiled functions."""

from __future__ import annotations

import numpy as np

BODY_TYPE = np.dtype(
    [
        ("period", float),  # between samples, s
        ("mass", float),  # of the robot, kg
        ("pelvis_moment", float, 3),  # mass times centre of mass of the pelvis, kg m
        ("imu", float, 3),  # its position in the pelvis, m
        # Of the configuration, see `config`:
        ("load_from", float),  # N
        ("load_span", float),
        ("contact_force", float),
        ("contact_width", float),
        ("height_bandwidth", float),  # 1/s
        # Of the last sample:
        ("toe_torques", float, 2),  # Nm
        ("attitude", float, (3, 3)),  # IMU to world, as the IMU itself has it
        ("arms", float, (2, 3)),  # middle of each sole from the IMU, pelvis frame, m
        # What is remembered:
        ("scale", float, 3),  # share of late in which the feet carried it, the factor of their
        # springs' forces, and the time that it is averaged over, s
        ("ground", float),  # height of the ground under the loaded feet, m
    ]
)
"""The robot as every estimator has it."""
