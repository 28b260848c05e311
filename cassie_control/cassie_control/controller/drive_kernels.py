"""Set-points of the drives, compiled; `swing_inertia` explains the swing leg's torques."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from cassie_control.controller.desired_kernels import adjust
from cassie_control.controller.records import RecordArray
from cassie_control.controller.thigh_kernels import steady_hip, track_thighs
from cassie_control.controller.weight_kernels import (
    carried_share,
    damped_weight,
    holding_torques,
)
from cassie_gaits.compiled import compiled

FloatArray = npt.NDArray[np.float64]

ROLL, YAW_ST, PITCH, LENGTH_ST, ROLL_SW, YAW_SW, PITCH_SW, LENGTH_SW, FOOT_SW = range(9)
_SHORTEST, _LONGEST = 0.4, 0.97  # m, of the leg lengths that are set
_SHORTEST_SWING, _LONGEST_SWING = 0.45, 0.95  # m, for the swing leg's inertia
_LIFTED, _LIFTING = 30.0, 100.0  # N on a foot below which its leg swings, and until it does not


@compiled
def drive(
    figures: RecordArray,
    robots: RecordArray,
    pairs: RecordArray,
    steps: RecordArray,
    commands: RecordArray,
    rate: float,
    pitch: float,
    roll: float,
    length: float,
    lead: float,
    speed: float,
    torso_roll: float,
    torso_pitch: float,
    slope_ahead: float,
    slope_left: float,
) -> None:
    """Desired outputs, adjusted, as set-points of the drives.

    Source: eq:IK and eq:hdtilde (README of cassie_gaits, Errata).

    Args:
        figures, robots, steps: Figures, the robot now and the step, of `records`. Shape (1,).
        pairs: Kinematics of both legs, `leg_chain.LegPair.record`. Shape (1,).
        commands: Result, `MotorCommand.record`. Shape (1,).
        rate: Of the phase, new. In 1/s.
        pitch to slope_left: What adjustment answers, and the torso wanted, see `STEP_TYPE`.
    """
    figure, robot, step, command = figures[0], robots[0], steps[0], commands[0]
    step.new_rate, step.pitch, step.roll, step.length, step.lead = rate, pitch, roll, length, lead
    step.speed, step.torso_roll, step.torso_pitch = speed, torso_roll, torso_pitch
    step.slope_ahead, step.slope_left = slope_ahead, slope_left
    adjust(figure, robot, step)
    stance = int(step.stance)
    track_thighs(figure, robot, step)
    _drive_stance(figure, robot, stance, step, command)
    _drive_swing(figure, robot, 1 - stance, step, command)
    weight = damped_weight(figure, robot, step)
    for i in range(2):
        share = carried_share(figure, robot, step, i)
        _hold_weight(robot, i, weight * share, pairs[0].states[i].ankle_jacobian, command)
    _push_swing(figure, robot, 1 - stance, step, command)


@compiled
def _drive_stance(figure: Any, robot: Any, i: int, step: Any, command: Any) -> None:
    """Torso roll and pitch act through the hip, in proportion to the load on the leg.

    q_hip + (desired - measured torso angle) is its set-point, with `thigh_kernels`' q_hip. The toe
    gives no torque.
    """
    q, v, load, at = robot.joints[i], robot.rates[i], robot.load[i], 5 * i
    hip_roll, roll_rate = steady_hip(figure, robot, i, 0, step)
    hip_pitch, pitch_rate = steady_hip(figure, robot, i, 1, step)
    desired, rates = step.desired, step.desired_rates
    knee, knee_rate = _knee(figure, desired[LENGTH_ST], rates[LENGTH_ST])
    command.position[at] = hip_roll - load * (desired[ROLL] - robot.roll)
    command.position[at + 1] = desired[YAW_ST]
    command.position[at + 2] = hip_pitch + load * (desired[PITCH] - robot.pitch)
    command.position[at + 3] = knee
    command.position[at + 4] = q[6]
    # An unloaded stance leg keeps its joints in place until it carries the torso.
    hold = load if load < 1.0 else 1.0
    command.velocity[at] = (roll_rate + load * robot.roll_rate) * hold
    command.velocity[at + 1] = rates[YAW_ST]
    command.velocity[at + 2] = (pitch_rate - load * robot.pitch_rate) * hold
    command.velocity[at + 3] = knee_rate
    command.velocity[at + 4] = v[6]
    for k in range(4):
        command.kp[at + k], command.kd[at + k] = figure.kp[k], figure.kd[k]
    command.kp[at], command.kd[at] = figure.kp_torso_roll, figure.kd_torso_roll
    command.kp[at + 2], command.kd[at + 2] = figure.kp_torso_pitch, figure.kd_torso_pitch
    command.kp[at + 4] = command.kd[at + 4] = 0.0


@compiled
def _drive_swing(figure: Any, robot: Any, i: int, step: Any, command: Any) -> None:
    """Every joint tracks, the toe as far as the foot is unloaded.

    As far as the foot still carries weight, its hip holds the torso, as the stance hip does: a
    leg that swings against the ground would throw the torso over.
    """
    q, v, at = robot.joints[i], robot.rates[i], 5 * i
    desired, rates = step.desired, step.desired_rates
    knee, knee_rate = _knee(figure, desired[LENGTH_SW], rates[LENGTH_SW])
    sine, cosine = math.sin(knee + figure.knee_offset), math.cos(knee + figure.knee_offset)
    lean = math.atan2(-figure.shin * sine, figure.shin * cosine + figure.thigh)
    squares = figure.thigh * figure.thigh + figure.shin * figure.shin
    share = figure.shin * (figure.shin + figure.thigh * cosine)
    share /= squares + 2.0 * figure.thigh * figure.shin * cosine
    toe = desired[FOOT_SW] + robot.pitch - q[2] - figure.neutral_tarsus
    command.position[at] = desired[ROLL_SW] - robot.roll
    command.position[at + 1] = desired[YAW_SW]
    command.position[at + 2] = desired[PITCH_SW] + robot.pitch + lean - figure.hip_offset
    command.position[at + 3] = knee
    command.position[at + 4] = toe - figure.toe_offset
    command.velocity[at] = rates[ROLL_SW] - robot.roll_rate
    command.velocity[at + 1] = rates[YAW_SW]
    command.velocity[at + 2] = rates[PITCH_SW] - (share * knee_rate - robot.pitch_rate)
    command.velocity[at + 3] = knee_rate
    command.velocity[at + 4] = rates[FOOT_SW] + robot.pitch_rate - v[2]
    for k in range(5):
        command.kp[at + k], command.kd[at + k] = figure.kp[k], figure.kd[k]
    command.kp[at + 4] *= 1.0 - robot.load[i]
    command.kd[at + 4] *= 1.0 - robot.load[i]
    own = 1.0 - min(1.0, max(0.0, (robot.force[i] - _LIFTED) / _LIFTING))
    held = robot.load[i] / max(1.0, robot.load[0] + robot.load[1])
    hip, rate = steady_hip(figure, robot, i, 0, step)
    law = (figure.kp_torso_roll, hip - desired[ROLL] + robot.roll)
    _share(command, at, own, held, law, (figure.kd_torso_roll, rate + robot.roll_rate))
    hip, rate = steady_hip(figure, robot, i, 1, step)
    law = (figure.kp_torso_pitch, hip + desired[PITCH] - robot.pitch)
    _share(command, at + 2, own, held, law, (figure.kd_torso_pitch, rate - robot.pitch_rate))


@compiled
def _share(
    command: Any,
    drive: int,
    own: float,
    share: float,
    position: tuple[float, float],
    rate: tuple[float, float],
) -> None:
    """Divide a drive between its own law and another: `own` of its torque, `share` of the other's.

    Args:
        command: With the drive's own gains and set-points; changed in place.
        drive: Its number.
        own, share: 0..1.
        position, rate: Gain and set-point of the other law.
    """
    kp, other_kp = own * command.kp[drive], share * position[0]
    kd, other_kd = own * command.kd[drive], share * rate[0]
    total_kp, total_kd = max(1e-6, kp + other_kp), max(1e-6, kd + other_kd)
    aim, speed = command.position[drive], command.velocity[drive]
    command.kp[drive], command.kd[drive] = total_kp, total_kd
    command.position[drive] = (kp * aim + other_kp * position[1]) / total_kp
    command.velocity[drive] = (kd * speed + other_kd * rate[1]) / total_kd


@compiled
def _knee(figure: Any, length: float, length_rate: float) -> tuple[float, float]:
    """Knee angle and rate of a leg length, see `virtual_leg`; in rad and rad/s."""
    length = min(_LONGEST, max(_SHORTEST, length))
    knee = _knee_angle(figure, length)
    product = 2.0 * figure.thigh * figure.shin
    turn = 0.5 * product * math.sin(knee + figure.knee_offset)
    return knee, -length * length_rate / turn


@compiled
def _knee_angle(figure: Any, length: float) -> float:
    squares = figure.thigh * figure.thigh + figure.shin * figure.shin
    cosine = (length * length - squares) / (2.0 * figure.thigh * figure.shin)
    angle: float = -math.acos(min(1.0, max(-1.0, cosine))) - figure.knee_offset
    return angle


@compiled
def _hold_weight(robot: Any, i: int, weight: float, jacobian: FloatArray, command: Any) -> None:
    """Torques that hold a weight (N) with a leg, along the line from foot to CoM."""
    x, y = robot.com[0] - robot.ankle[i, 0], robot.com[1] - robot.ankle[i, 1]
    z = max(0.4, robot.com[2] - robot.ankle[i, 2])
    held = holding_torques(jacobian, robot.tilt, weight, x / z, y / z)
    for k in range(4):
        command.torque[5 * i + k] = held[k]
    command.torque[5 * i + 4] = 0.0


@compiled
def _push_swing(figure: Any, robot: Any, i: int, step: Any, command: Any) -> None:
    """Add the torques that accelerate the swing leg, as far as it is off the ground.

    The stance hip takes what they do to the torso to the ground.
    """
    share = figure.swing_inertia * (1.0 - robot.load[i])
    length = min(_LONGEST_SWING, max(_SHORTEST_SWING, step.desired[LENGTH_SW]))
    v, a = step.desired_rates, step.accelerations
    roll, pitch, knee = inertia_torques(
        (v[ROLL_SW], v[PITCH_SW], v[LENGTH_SW]),
        (a[ROLL_SW], a[PITCH_SW], a[LENGTH_SW]),
        _knee_angle(figure, length),
        figure.inertia,
        (figure.shin, figure.thigh, figure.knee_offset),
    )
    command.torque[5 * i] += share * roll
    command.torque[5 * i + 2] += share * pitch
    command.torque[5 * i + 3] += share * knee
    carried = share * robot.load[1 - i]
    command.torque[5 - 5 * i] -= carried * roll
    command.torque[7 - 5 * i] -= carried * pitch


@compiled
def inertia_torques(
    rates: tuple[float, float, float],
    accelerations: tuple[float, float, float],
    knee: float,
    inertia: FloatArray,
    sides: tuple[float, float, float],
) -> tuple[float, float, float]:
    """See `swing_inertia.swing_torques`; `sides` are shin, thigh (m) and knee offset (rad)."""
    shin, thigh, offset = sides
    bend = knee + offset
    sine, cosine = math.sin(bend), math.cos(bend)
    squares, product = shin * shin + thigh * thigh, shin * thigh
    length = math.sqrt(squares + 2.0 * product * cosine)
    # length(k) and hip pitch = leg pitch + lean(k), each differentiated twice by time.
    slope = -product * sine / length
    bow = (-product * cosine - slope * slope) / length
    knee_rate = rates[2] / slope
    knee_acceleration = (accelerations[2] - bow * knee_rate * knee_rate) / slope
    share = shin * (shin + thigh * cosine) / (length * length)
    share_slope = (-shin * thigh * sine - 2.0 * share * length * slope) / (length * length)
    pitch_rate = rates[1] - share * knee_rate
    pitch_acceleration = accelerations[1] - share * knee_acceleration
    pitch_acceleration -= share_slope * knee_rate * knee_rate
    a, a_slope = _cubic(inertia, 0, knee), _cubic_slope(inertia, 0, knee)
    b, b_slope = _cubic(inertia, 1, knee), _cubic_slope(inertia, 1, knee)
    c = _cubic(inertia, 2, knee)
    r, r_slope = _cubic(inertia, 3, knee), _cubic_slope(inertia, 3, knee)
    pitch = a * pitch_acceleration + b * knee_acceleration
    pitch += a_slope * pitch_rate * knee_rate + b_slope * knee_rate * knee_rate
    bending = b * pitch_acceleration + c * knee_acceleration - 0.5 * a_slope * pitch_rate**2
    return r * accelerations[0] + r_slope * rates[0] * knee_rate, pitch, bending


@compiled
def _cubic(table: FloatArray, row: int, x: float) -> float:
    value: float = table[row, 0] + x * (table[row, 1] + x * (table[row, 2] + x * table[row, 3]))
    return value


@compiled
def _cubic_slope(table: FloatArray, row: int, x: float) -> float:
    value: float = table[row, 1] + x * (2.0 * table[row, 2] + x * 3.0 * table[row, 3])
    return value
