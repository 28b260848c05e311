"""Constants of the walking law: gains, the control period, and numbers of the robot."""

from __future__ import annotations

import math

import numpy as np

from cassie_control.config import WalkConfig
from cassie_control.control.robot import HIP_X, HIP_Z
from cassie_gaits import bezier, robot
from cassie_gaits.names import LEG_DRIVES
from cassie_gaits.records import FloatArray, Record, array


class Gains(Record):
    """Gains and other constants of the walking law.

    Attributes with the name of a field of `config.WalkConfig` come from that field, and are 0 where
    the paper's law leaves them out.

    Attributes:
        least_acceleration: 1 where the swing leg's angles have the least squared acceleration.
        share_force: 1 where the legs' shares of the weight follow their forces, 0 their loads.
        level: 1 where the stance hip travels level, 0 where its leg has the gait's length.
        swing_inertia: 1 where feed-forward torques accelerate the swing leg.
        swing_lag: Largest error of the swing leg's length while the leg shortens. In m.
        mass: Mass of the robot. In kg.
        period: Control period. In s.
        latency: Latency of the drives that is compensated. In s.
        handover: Time in which the weight shifts from leg to leg if there is a latency. In s.
        kp, kd: Gains of hip_roll, hip_yaw, hip_pitch, knee and toe. In Nm/rad and Nms/rad.
        hip_x, hip_z: Hip pitch axis in the pelvis frame. In m.
        inertia: Inertia of the swing leg, see `INERTIA`.
        least_acceleration_map: Matrix from a polynomial's first and last two coefficients to the
            two between.
    """

    kp_torso_roll: float
    kd_torso_roll: float
    kp_torso_pitch: float
    kd_torso_pitch: float
    clearance: float
    late_reach: float
    late_speed: float
    level_back: float
    bounce_damping: float
    heading_gain: float
    yaw_limit: float
    quickest_step: float
    least_acceleration: float
    share_force: float
    level: float
    swing_inertia: float
    swing_lag: float
    mass: float
    thigh_track: float
    thigh_angle: float
    thigh_rate: float
    period: float
    latency: float
    handover: float
    kp: FloatArray = array(5)
    kd: FloatArray = array(5)
    hip_x: float
    hip_z: float
    inertia: FloatArray = array(4, 4)
    least_acceleration_map: FloatArray = array(2, 4)


INERTIA = np.array(
    [
        [1.0411, -0.1591, -0.3106, -0.0599],  # A
        [0.5699, -0.0817, -0.1565, -0.0302],  # B
        [0.4899, -0.0042, -0.0024, -0.0004],  # C
        [1.3723, -0.1943, -0.4381, -0.0809],  # R
    ]
)
"""Coefficients of A, B, C and R by rising power of the knee angle. In kg m^2."""


def _least_acceleration_map() -> FloatArray:
    """Matrix from a polynomial's first and last two coefficients to the two between. Shape (2, 4).

    These two give the least integral of the squared second derivative.
    """
    bends = np.array([bezier.basis(phase)[:, 2] for phase in np.linspace(0.0, 1.0, 41)])
    ends = bends[:, (0, 1, 4, 5)]
    result: FloatArray = -np.linalg.lstsq(bends[:, 2:4], ends, rcond=None)[0]
    return result


_LEAST_ACCELERATION_MAP = _least_acceleration_map()
_MAX_SWING_LAG = 0.03  # m
_SWITCHES = ("least_acceleration", "share_force", "level", "swing_inertia")
_ZERO_IN_PAPER = (*_SWITCHES, "clearance", "bounce_damping", "thigh_angle", "thigh_rate")


def make_gains(config: WalkConfig, period: float, latency: float = 0.0) -> Gains:
    """Constants of the walking law, from a configuration and the control period (s).

    Under the paper's law, this project's additions to it are left out. With a growing latency of
    the drives (`latency`, in s) the gains become those for late drives.
    """
    result = Gains()
    for name in Gains.TYPE.names or ():
        if hasattr(config, name):
            setattr(result, name, getattr(config, name))
    for name in _SWITCHES:
        setattr(result, name, 1.0)
    result.kp[:] = [getattr(config.joints, f"kp_{name}") for name in LEG_DRIVES]
    result.kd[:] = [getattr(config.joints, f"kd_{name}") for name in LEG_DRIVES]
    result.swing_lag = _MAX_SWING_LAG
    if config.as_in_paper:
        result.swing_lag = math.inf
        for name in _ZERO_IN_PAPER:
            setattr(result, name, 0.0)
    else:
        _set_late_gains(result, config, latency)
    result.period = period
    result.mass = robot.total_mass()
    result.hip_x, result.hip_z = HIP_X, HIP_Z
    result.inertia[:], result.least_acceleration_map[:] = INERTIA, _LEAST_ACCELERATION_MAP
    return result


def _set_late_gains(result: Gains, config: WalkConfig, latency: float) -> None:
    """Change the gains to those for drives that act late."""
    late, share = config.late, config.late.walking_share(latency)
    if share == 0.0:
        return
    result.latency, result.handover = latency, late.handover
    # Late measurements must not shake the set-points: these use the track of the leg alone.
    for name, goal in (
        ("thigh_track", late.thigh_track),
        ("thigh_angle", 1.0),
        ("thigh_rate", 1.0),
    ):
        usual = getattr(result, name)
        setattr(result, name, usual + share * (goal - usual))
