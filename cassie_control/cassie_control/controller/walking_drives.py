"""Desired outputs as set-points of the drives: eq:IK and eq:hdtilde (README, Errata).

Arguments are the same throughout: `desired` and `rates` are the nine desired outputs of eq:h0 in
rad, m, rad/s and m/s; `base` is the leg's first drive in the command.
"""

from __future__ import annotations

from cassie_control.controller.config import WalkConfig
from cassie_control.controller.outputs import (
    FOOT_SW,
    LENGTH_ST,
    LENGTH_SW,
    PITCH,
    PITCH_SW,
    ROLL,
    ROLL_SW,
    YAW_ST,
    YAW_SW,
)
from cassie_control.controller.readings import WEIGHT, LegReadings, Readings
from cassie_gaits import virtual_leg
from cassie_msgs.layout import MotorCommand

_SHORTEST, _LONGEST = 0.4, 0.97  # m, of the leg lengths that are set
_LIFTED, _LIFTING = 30.0, 100.0  # N on a foot below which its leg swings, and until it does not


def drive_stance(
    config: WalkConfig,
    readings: Readings,
    leg: LegReadings,
    desired: list[float],
    rates: list[float],
    command: MotorCommand,
    base: int,
) -> None:
    """Set-points of the stance leg.

    Torso roll and pitch act through the hip, in proportion to the load on the leg, with
    q_hip + (desired - measured torso angle) as its set-point. The toe gives no torque.
    """
    j = config.joints
    q, v, load = leg.joints, leg.rates, leg.load
    knee, knee_rate = _knee(desired[LENGTH_ST], rates[LENGTH_ST])
    command.position[base : base + 5] = (
        q[0] - load * (desired[ROLL] - readings.roll),
        desired[YAW_ST],
        q[2] + load * (desired[PITCH] - readings.pitch),
        knee,
        q[6],
    )
    # An unloaded stance leg keeps its joints in place until it carries the torso.
    hold = load if load < 1.0 else 1.0
    command.velocity[base : base + 5] = (
        (v[0] + load * readings.roll_rate) * hold,
        rates[YAW_ST],
        (v[2] - load * readings.pitch_rate) * hold,
        knee_rate,
        v[6],
    )
    kp, kd = config.kp_torso_roll, config.kd_torso_roll
    command.kp[base : base + 5] = (kp, j.kp_hip_yaw, config.kp_torso_pitch, j.kp_knee, 0.0)
    command.kd[base : base + 5] = (kd, j.kd_hip_yaw, config.kd_torso_pitch, j.kd_knee, 0.0)
    _feed_forward(config, readings, leg, command, base)


def drive_swing(
    config: WalkConfig,
    readings: Readings,
    leg: LegReadings,
    desired: list[float],
    rates: list[float],
    command: MotorCommand,
    base: int,
) -> None:
    """Set-points of the swing leg: every joint tracks, the toe as far as the foot is unloaded.

    As far as the foot still carries weight, its hip holds the torso, as the stance hip does: a
    leg that swings against the ground would throw the torso over.
    """
    j, free = config.joints, 1.0 - leg.load
    held = leg.load / max(1.0, readings.legs[0].load + readings.legs[1].load)
    lifted = 1.0 - min(1.0, max(0.0, (leg.force - _LIFTED) / _LIFTING))
    knee, knee_rate = _knee(desired[LENGTH_SW], rates[LENGTH_SW])
    length = virtual_leg.clamp_length(desired[LENGTH_SW], _SHORTEST, _LONGEST)
    q, v = leg.joints, leg.rates
    roll_kp, roll_position, roll_kd, roll_rate = _shared(
        lifted,
        held,
        (j.kp_hip_roll, desired[ROLL_SW] - readings.roll),
        (config.kp_torso_roll, q[0] - desired[ROLL] + readings.roll),
        (j.kd_hip_roll, rates[ROLL_SW] - readings.roll_rate),
        (config.kd_torso_roll, v[0] + readings.roll_rate),
    )
    pitch_rate = virtual_leg.hip_pitch_rate(knee, rates[PITCH_SW], readings.pitch_rate, knee_rate)
    pitch_kp, pitch_position, pitch_kd, pitch_rate = _shared(
        lifted,
        held,
        (j.kp_hip_pitch, virtual_leg.hip_pitch_angle(desired[PITCH_SW], readings.pitch, length)),
        (config.kp_torso_pitch, q[2] + desired[PITCH] - readings.pitch),
        (j.kd_hip_pitch, pitch_rate),
        (config.kd_torso_pitch, v[2] - readings.pitch_rate),
    )
    command.position[base : base + 5] = (
        roll_position,
        desired[YAW_SW],
        pitch_position,
        knee,
        virtual_leg.toe_angle(desired[FOOT_SW], readings.pitch, q[2]),
    )
    command.velocity[base : base + 5] = (
        roll_rate,
        rates[YAW_SW],
        pitch_rate,
        knee_rate,
        rates[FOOT_SW] + readings.pitch_rate - v[2],
    )
    command.kp[base : base + 5] = (roll_kp, j.kp_hip_yaw, pitch_kp, j.kp_knee, j.kp_toe * free)
    command.kd[base : base + 5] = (roll_kd, j.kd_hip_yaw, pitch_kd, j.kd_knee, j.kd_toe * free)
    _feed_forward(config, readings, leg, command, base)


def _shared(
    own: float,
    share: float,
    position: tuple[float, float],
    other_position: tuple[float, float],
    rate: tuple[float, float],
    other_rate: tuple[float, float],
) -> tuple[float, float, float, float]:
    """One drive between two laws: gain and set-point of each, first for position, then for rate.

    Returns:
        Gains and set-points at which the drive gives `own` of the first law's torque and `share`
        of the other one's: kp, position, kd, rate.
    """
    kp, kd = own * position[0], own * rate[0]
    more_kp, more_kd = share * other_position[0], share * other_rate[0]
    total_kp, total_kd = max(1e-6, kp + more_kp), max(1e-6, kd + more_kd)
    return (
        total_kp,
        (kp * position[1] + more_kp * other_position[1]) / total_kp,
        total_kd,
        (kd * rate[1] + more_kd * other_rate[1]) / total_kd,
    )


def _knee(length: float, length_rate: float) -> tuple[float, float]:
    """Knee angle and rate of a leg length, in rad and rad/s."""
    length = virtual_leg.clamp_length(length, _SHORTEST, _LONGEST)
    knee = virtual_leg.knee_angle(length)
    return knee, virtual_leg.knee_rate(knee, length, length_rate)


def _feed_forward(
    config: WalkConfig, readings: Readings, leg: LegReadings, command: MotorCommand, base: int
) -> None:
    """Torques that hold the leg's share of the weight, along the line from foot to CoM."""
    total = readings.legs[0].load + readings.legs[1].load
    share = leg.load / total if total > 1.0 else leg.load
    x = readings.com[0] - leg.ankle[0]
    y = readings.com[1] - leg.ankle[1]
    z = max(0.4, readings.com[2] - leg.ankle[2])
    force = config.gravity * WEIGHT * share
    held = leg.weight_torques(readings.tilt, force, x / z, y / z)
    command.torque[base : base + 5] = (*held, 0.0)
