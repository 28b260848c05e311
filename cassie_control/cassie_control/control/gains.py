"""Gains of the walking law, and the control period."""

from __future__ import annotations

from cassie_control.config import WalkConfig
from cassie_gaits.names import LEG_DRIVES
from cassie_gaits.records import FloatArray, Record, array, whole


class Gains(Record):
    """Gains of the walking law.

    Attributes with the name of a field of `config.WalkConfig` come from that field. Those of
    `_ZERO_IN_PAPER` are 0 under the paper's law, whose other differences are branches on
    `as_in_paper`.

    Attributes:
        as_in_paper: 1 under the paper's law, 0 with this project's additions to it.
        period: Control period. In s.
        latency: Latency of the drives that is compensated. In s.
        handover: Time in which the weight shifts from leg to leg if there is a latency. In s.
        kp, kd: Gains of hip_roll, hip_yaw, hip_pitch, knee and toe. In Nm/rad and Nms/rad.
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
    as_in_paper: int = whole()
    thigh_track: float
    thigh_angle: float
    thigh_rate: float
    period: float
    latency: float
    handover: float
    kp: FloatArray = array(5)
    kd: FloatArray = array(5)


_ZERO_IN_PAPER = ("clearance", "bounce_damping", "thigh_angle", "thigh_rate")


def make_gains(config: WalkConfig, period: float, latency: float = 0.0) -> Gains:
    """Gains of the walking law, from a configuration and the control period (s).

    Under the paper's law, the additions of `_ZERO_IN_PAPER` are 0, and drives that act late change
    no gain. Else, with a growing latency of the drives (`latency`, in s), the gains become those
    for late drives: the hips' set-points use the low-passed thighs alone.
    """
    result = Gains()
    result.take(config)
    result.kp[:] = [getattr(config.joints, f"kp_{name}") for name in LEG_DRIVES]
    result.kd[:] = [getattr(config.joints, f"kd_{name}") for name in LEG_DRIVES]
    if config.as_in_paper:
        for name in _ZERO_IN_PAPER:
            setattr(result, name, 0.0)
    else:
        _set_late_gains(result, config, latency)
    result.period = period
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
