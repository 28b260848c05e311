"""Parameters of the state estimators."""

from __future__ import annotations

from dataclasses import dataclass

from cassie_msgs.tunables import tunable

ESTIMATORS = ("invariant", "kinematic")

BRIDGED = 0.02
"""Time without samples, or without an estimate, over which the last estimate holds. In s."""

CARRYING_RATIO = 0.6
"""Ratio of the feet's force to the weight from which the feet alone carry the robot, no gantry."""

ON_GROUND = 0.5
"""Contact probability from which a foot counts as on the ground; its force there is
`EstimatorConfig.contact_force`."""


@dataclass(frozen=True, kw_only=True)
class FilterConfig:
    """Noise, delays and thresholds that the invariant filter assumes."""

    gyro_noise: float = tunable(1e-3, "rad/s/sqrt(Hz)", 1e-6, 1.0, "Noise density of the gyro")
    accelerometer_noise: float = tunable(
        0.02, "m/s^2/sqrt(Hz)", 1e-5, 10.0, "Noise density of the accelerometer"
    )
    gyro_drift: float = tunable(1e-5, "rad/s/sqrt(s)", 0.0, 0.1, "Random walk of the gyro's bias")
    gyro_bias: float = tunable(
        1e-4, "rad/s", 0.0, 0.1, "Saturation of the gyro's bias; a VN-100 stays within 5e-5"
    )
    accelerometer_drift: float = tunable(
        1e-4, "m/s^2/sqrt(s)", 0.0, 1.0, "Random walk of the accelerometer's bias"
    )
    stance_noise: float = tunable(
        0.002, "m/sqrt(s)", 1e-5, 1.0, "Random walk of the contact point of a loaded foot"
    )
    swing_noise: float = tunable(
        3.0,
        "m/sqrt(s)",
        0.1,
        100.0,
        "Random walk of the contact point of a foot that slips or is in the air",
    )
    kinematics_noise: float = tunable(
        0.0003, "m", 1e-5, 0.1, "Error of a foot's position from the encoders"
    )
    tilt_error: float = tunable(
        0.006, "rad", 1e-4, 0.5, "Error of the IMU's own roll and pitch, nearly constant"
    )
    heading_error: float = tunable(0.02, "rad", 1e-4, 3.0, "Error of the IMU's own yaw")
    error_time: float = tunable(
        10.0, "s", 0.01, 1000.0, "Correlation time of the errors of the IMU's own attitude"
    )
    attitude_delay: float = tunable(
        0.002, "s", 0.0, 0.05, "Delay of the IMU's orientation", live=False
    )
    slip_gate: float = tunable(
        3.0,
        "",
        1.0,
        100.0,
        "Innovation, in standard deviations, at which a foot counts as slipping",
    )
    slip_time: float = tunable(
        0.1, "s", 0.001, 1.0, "Time constant with which a foot that slipped is trusted again"
    )


@dataclass(frozen=True, kw_only=True)
class EstimatorConfig:
    """Which estimator runs, and its parameters."""

    estimator: str = tunable(
        "invariant",
        choices=ESTIMATORS,
        description="Contact-aided invariant filter, or the paper's velocity of the loaded leg",
        live=False,
    )
    velocity_bandwidth: float = tunable(
        60.0, "1/s", 1.0, 500.0, "Kinematic: bandwidth of the correction by the loaded leg"
    )
    velocity_noise: float = tunable(
        0.03, "m/s", 0.001, 1.0, "Kinematic: standard deviation of the loaded leg's velocity"
    )
    height_bandwidth: float = tunable(
        30.0, "1/s", 1.0, 500.0, "Bandwidth with which the ground's height follows the loaded feet"
    )
    load_from: float = tunable(100.0, "N", 0.0, 300.0, "Foot force up to which the load is 0")
    load_span: float = tunable(100.0, "N", 1.0, 400.0, "Increase of foot force from load 0 to 1")
    contact_force: float = tunable(60.0, "N", 5.0, 300.0, "Foot force of contact probability 0.5")
    contact_width: float = tunable(12.0, "N", 1.0, 100.0, "Force that changes contact odds e-fold")
    distrust_time: float = tunable(
        1.0, "s", 0.05, 100.0, "Time for which a sensor stays rejected after a fault", live=False
    )
    filter: FilterConfig = FilterConfig()
