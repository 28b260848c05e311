"""Gains of the walking law, and the control period."""

from __future__ import annotations

import math

from cassie_control.config import WalkConfig
from cassie_gaits.names import HIP_PITCH, KNEE, LEG_DRIVES
from cassie_gaits.records import FloatArray, Record, array, whole


class Gains(Record):
    """Gains of the walking law.

    Attributes with the name of a field of `config.WalkConfig` come from `WalkConfig.in_force`. With
    it, the first six tell the laws apart: additions to the paper's law are 1, and 0 under it.

    Attributes:
        pendulum_placement: Whether `planner.pendulum` places the feet, else `planner.paper`.
        keeps_lengths: Whether a step begins with the last desired leg lengths, else the measured.
        least_acceleration: Whether the swing leg's middle coefficients minimise its acceleration.
        level_hip: Weight of the level hip path.
        swing_inertia: Weight of the torques that accelerate the swing leg.
        share_by_force: Whether the feet's forces give the legs' shares of the weight, else the
            loads.
        max_swing_lag: Bound of a shortening leg's measured length behind the commanded one; without
            bound under the paper's law. In m.
        period: Control period. In s.
        latency: Latency of the drives that is compensated. In s.
        kp, kd: Gains of hip_roll, hip_yaw, hip_pitch, knee and toe. In Nm/rad and Nms/rad.
    """

    pendulum_placement: int = whole()
    keeps_lengths: int = whole()
    least_acceleration: int = whole()
    level_hip: float
    swing_inertia: float
    share_by_force: int = whole()
    max_swing_lag: float
    kp_torso_roll: float
    kd_torso_roll: float
    kp_torso_pitch: float
    kd_torso_pitch: float
    clearance: float
    late_reach: float
    late_speed: float
    level_back: float
    bounce_damping: float
    gait_speed: float
    heading_gain: float
    yaw_limit: float
    thigh_track: float
    thigh_angle: float
    thigh_rate: float
    period: float
    latency: float
    double_support: float
    kp: FloatArray = array(5)
    kd: FloatArray = array(5)


_MAX_SWING_LAG = 0.03  # m; in free swings the length lags by 0.01 m


def make_gains(
    config: WalkConfig, period: float, latency: float = 0.0, torque_delay: float = 0.0
) -> Gains:
    """Gains of the walking law.

    As the latency grows, the gains become those for late drives: the hips' set-points use the
    low-passed thighs alone. Where torques are late, the gains of knees and pitch are lower. Under
    the paper's law drives that act late change no gain.

    Args:
        config: Parameters of walking.
        period: Control period. In s.
        latency: Latency found in the drives. In s.
        torque_delay: The part of it after the drives have computed their torques. In s.
    """
    result = Gains()
    result.take(config.in_force())
    result.kp[:] = [getattr(config.joints, f"kp_{name}") for name in LEG_DRIVES]
    result.kd[:] = [getattr(config.joints, f"kd_{name}") for name in LEG_DRIVES]
    if config.as_in_paper:
        result.max_swing_lag = math.inf
    else:
        result.pendulum_placement = result.keeps_lengths = 1
        result.least_acceleration = result.share_by_force = 1
        result.level_hip = result.swing_inertia = 1.0
        result.max_swing_lag = _MAX_SWING_LAG
        _set_late_gains(result, config, latency)
        factor = config.late.factor(torque_delay)
        for drive in (HIP_PITCH, KNEE):
            result.kp[drive] *= factor
            result.kd[drive] *= factor
        result.kp_torso_pitch *= factor
        result.kd_torso_pitch *= factor
    result.period = period
    return result


def _set_late_gains(result: Gains, config: WalkConfig, latency: float) -> None:
    """Change the gains to those for drives that act late."""
    late, share = config.late, config.late.share(latency)
    if share == 0.0:
        return
    result.latency = latency
    # Late measurements must not shake the set-points: these use the low-passed thigh alone.
    for name, goal in (
        ("thigh_track", late.thigh_track),
        ("thigh_angle", 1.0),
        ("thigh_rate", 1.0),
    ):
        usual = getattr(result, name)
        setattr(result, name, usual + share * (goal - usual))
