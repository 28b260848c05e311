"""Set-points of the drives while walking: eq:IK, eq:hdtilde, and feed-forward torques.

The hip. The stance hip regulates the torso: the hip drive's set-point is the measured hip angle
plus the torso's error. If set-points are late by D, the drive's damping torque is
kd (v(t - D) - v(t)). This is 0 at the frequency 1 / D, which for 20 ms is near the 42 Hz of the
oscillation of hip and leaf springs. So a share of the hip's motion is replaced by a low-passed
track of the leg in space, hip angle less torso angle. The track follows a steady swing without lag,

    x' = r + 2 w (thigh - x),   r' = w^2 (thigh - x),

and the drive damps motion relative to it at 2 kHz, late or not. Only a share is replaced: with all
of it, damping torques that the drive applies 3 ms late would cause oscillation at that frequency.

The swing leg. Torques accelerate the swing leg as its desired outputs require. In its plane the leg
is a double pendulum of hip pitch p and knee k, with relaxed springs (the tarsus turns against the
knee) and the foot kept level. About the hip roll axis its inertia depends on the knee:

    u_pitch = A p'' + B k'' + A' p' k' + B' k'^2
    u_knee  = B p'' + C k'' - A' p'^2 / 2
    u_roll  = R r'' + R' r' k'

with A, B, C and R functions of the knee angle, drives' armature included. A', B' and R' are their
derivatives by the knee angle. Gravity is left to the position loop: it holds a hanging leg within
0.01 rad.

Source:
    Cubic polynomials fitted to the mass matrix of `cassie_gaits.dynamics` for knees of -2.4 to
    -0.75 rad, error below 0.001 kg m^2 (a test holds that).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from cassie_control.control.forces import carried_share, damped_weight, holding_torques
from cassie_control.control.gains import Gains
from cassie_control.control.outputs import (
    FOOT_SW,
    LENGTH_ST,
    LENGTH_SW,
    PITCH,
    PITCH_SW,
    ROLL,
    ROLL_SW,
    YAW_ST,
    YAW_SW,
    Step,
    adjust_outputs,
)
from cassie_control.control.robot import Robot
from cassie_control.planner.terrain import GroundSlope
from cassie_control.planner.timing import StepTiming, adapt_phase_rate
from cassie_gaits import virtual_leg
from cassie_gaits.compiled import compiled
from cassie_gaits.leg import LegPair
from cassie_gaits.records import FloatArray, RecordArray, Records
from cassie_gaits.virtual_leg import KNEE_OFFSET, SHIN, THIGH, nearest_knee_angle
from cassie_msgs.layout import MotorCommand


@compiled
def _thigh_motion(robot: Robot, i: int, axis: int) -> tuple[float, float]:
    """Angle and rate of leg `i` in space, by roll (`axis` 0) or pitch (1). In rad and rad/s."""
    if axis == 0:
        return robot.joints[i, 0] + robot.roll, robot.rates[i, 0] + robot.roll_rate
    return robot.joints[i, 2] - robot.pitch, robot.rates[i, 2] - robot.pitch_rate


@compiled
def track_thighs(gain: Gains, robot: Robot, step: Step) -> None:
    """Update the tracks of both legs; a new track begins with the measured motion."""
    w, dt = 2.0 * math.pi * gain.thigh_track, gain.period
    for i in range(2):
        for axis in range(2):
            angle, rate = _thigh_motion(robot, i, axis)
            if step.thigh_tracking == 0.0:
                step.thigh_track[i, axis], step.thigh_track_rates[i, axis] = angle, rate
            else:
                predicted = step.thigh_track[i, axis] + dt * step.thigh_track_rates[i, axis]
                step.thigh_track[i, axis] = predicted + 2.0 * w * dt * (angle - predicted)
                step.thigh_track_rates[i, axis] += w * w * dt * (angle - predicted)
    step.thigh_tracking = 1.0


@compiled
def filtered_hip(gain: Gains, robot: Robot, i: int, axis: int, step: Step) -> tuple[float, float]:
    """Hip roll (`axis` 0) or pitch (1) of leg `i`, with the track's share. In rad and rad/s."""
    angle, rate = _thigh_motion(robot, i, axis)
    joint = 2 * axis
    return (
        robot.joints[i, joint] + gain.thigh_angle * (step.thigh_track[i, axis] - angle),
        robot.rates[i, joint] + gain.thigh_rate * (step.thigh_track_rates[i, axis] - rate),
    )


class DriveLaw(NamedTuple):
    """Gains and set-points of a drive."""

    kp: float
    kd: float
    position: float
    velocity: float


_MIN_LENGTH, _MAX_LENGTH = 0.4, 0.97  # m, range of the commanded leg length
_MIN_SWING_LENGTH, _MAX_SWING_LENGTH = 0.45, 0.95  # m, range of the leg length for the inertia
_MIN_COM_HEIGHT = 0.4  # m above the toe joint
_LOADED_FORCE = 30.0  # N, foot force from which the swing hip also regulates the torso
_LOADED_FORCE_SPAN = 100.0  # N, further force at which it only regulates the torso


@compiled
def set_drives(
    gains: Records[Gains],
    robots: Records[Robot],
    pairs: Records[LegPair],
    timings: Records[StepTiming],
    slopes: Records[GroundSlope],
    modes: RecordArray,
    steps: Records[Step],
    commands: RecordArray,
    landing_pitch: float,
    landing_roll: float,
    landing_length: float,
    remaining: float,
    contact_lead: float,
) -> None:
    """Compute set-points of the drives from the adjusted desired outputs.

    Args:
        gains, robots, slopes: Constants of the law, the robot and the ground. Shape (1,).
        pairs: Kinematics of both legs. Shape (1,).
        timings: Phase, whose rate follows `remaining`. Shape (1,).
        modes: `Mode.record`, with the torso's angles. Shape (1,).
        steps: The step; changed in place. Shape (1,).
        commands: Result, `MotorCommand.record`. Shape (1,).
        landing_pitch, landing_roll, landing_length, remaining, contact_lead: Result of leg-angle
            adjustment, see `placement.SwingTarget`.

    Source:
        eq:IK and eq:hdtilde (README of cassie_gaits, Errata).
    """
    gain, robot, step, command = gains[0], robots[0], steps[0], commands[0]
    timing, slope, mode = timings[0], slopes[0], modes[0]
    adapt_phase_rate(timing, remaining)
    step.adjusted_rate, step.vx = timing.rate, timing.velocity[0]
    step.landing_pitch, step.landing_roll = landing_pitch, landing_roll
    step.landing_length, step.contact_lead = landing_length, contact_lead
    step.torso_roll, step.torso_pitch = mode.roll + mode.trims[3], mode.pitch + mode.trims[2]
    step.slope_ahead, step.slope_left = slope.ahead, slope.left
    step.foothold_height = slope.foothold_height
    adjust_outputs(gain, robot, step)
    stance = step.stance
    track_thighs(gain, robot, step)
    _drive_stance(gain, robot, stance, step, command)
    _drive_swing(gain, robot, 1 - stance, step, command)
    weight = damped_weight(gain, robot, step)
    for i in range(2):
        share = carried_share(gain, robot, step, i)
        _set_weight_torques(robot, i, weight * share, pairs[0].states[i].ankle_jacobian, command)
    _add_swing_inertia(gain, robot, 1 - stance, step, command)


@compiled
def _drive_stance(gain: Gains, robot: Robot, i: int, step: Step, command: MotorCommand) -> None:
    """Set-points of the stance leg, whose hip regulates torso roll and pitch.

    The hip's set-point is q_hip + load (desired - measured torso angle), with q_hip of
    `filtered_hip` and the load on the leg, 0..1; for roll the sign of the second term is -. The toe
    gives no torque.
    """
    q, v, load, base = robot.joints[i], robot.rates[i], robot.load[i], 5 * i
    hip_roll, roll_rate = filtered_hip(gain, robot, i, 0, step)
    hip_pitch, pitch_rate = filtered_hip(gain, robot, i, 1, step)
    desired, rates = step.desired, step.desired_rates
    knee, knee_rate = _knee_motion(desired[LENGTH_ST], rates[LENGTH_ST])
    command.position[base] = hip_roll - load * (desired[ROLL] - robot.roll)
    command.position[base + 1] = desired[YAW_ST]
    command.position[base + 2] = hip_pitch + load * (desired[PITCH] - robot.pitch)
    command.position[base + 3] = knee
    command.position[base + 4] = q[6]
    # An unloaded stance leg holds its joints until it carries the torso.
    hold = load if load < 1.0 else 1.0
    command.velocity[base] = (roll_rate + load * robot.roll_rate) * hold
    command.velocity[base + 1] = rates[YAW_ST]
    command.velocity[base + 2] = (pitch_rate - load * robot.pitch_rate) * hold
    command.velocity[base + 3] = knee_rate
    command.velocity[base + 4] = v[6]
    for k in range(4):
        command.kp[base + k], command.kd[base + k] = gain.kp[k], gain.kd[k]
    command.kp[base], command.kd[base] = gain.kp_torso_roll, gain.kd_torso_roll
    command.kp[base + 2], command.kd[base + 2] = gain.kp_torso_pitch, gain.kd_torso_pitch
    command.kp[base + 4] = command.kd[base + 4] = 0.0


@compiled
def _drive_swing(gain: Gains, robot: Robot, i: int, step: Step, command: MotorCommand) -> None:
    """Set-points of the swing leg: every joint tracks, the toe as far as the foot is unloaded.

    As far as the foot still carries weight, its hip regulates the torso, as the stance hip does: a
    leg that swings against the ground would tip the torso over.

    The commanded leg length leads the measured one by at most `swing_lag` while the leg shortens. A
    toe that slides up the face of a riser is held back by up to 240 N. With a larger error, knee
    and springs would throw the foot up by 0.4 m as it comes free, and it would land far too short.
    """
    q, v, base = robot.joints[i], robot.rates[i], 5 * i
    desired, rates = step.desired, step.desired_rates
    length = max(desired[LENGTH_SW], virtual_leg.length(q[3]) - gain.swing_lag)
    knee, knee_rate = _knee_motion(length, rates[LENGTH_SW])
    hip_pitch = desired[PITCH_SW] + robot.pitch + virtual_leg.lean(knee) - virtual_leg.HIP_OFFSET
    command.position[base] = desired[ROLL_SW] - robot.roll
    command.position[base + 1] = desired[YAW_SW]
    command.position[base + 2] = hip_pitch
    command.position[base + 3] = knee
    command.position[base + 4] = virtual_leg.toe_angle(desired[FOOT_SW], robot.pitch, q[2])
    command.velocity[base] = rates[ROLL_SW] - robot.roll_rate
    command.velocity[base + 1] = rates[YAW_SW]
    command.velocity[base + 2] = virtual_leg.hip_pitch_rate(
        knee, rates[PITCH_SW], robot.pitch_rate, knee_rate
    )
    command.velocity[base + 3] = knee_rate
    command.velocity[base + 4] = rates[FOOT_SW] + robot.pitch_rate - v[2]
    for k in range(5):
        command.kp[base + k], command.kd[base + k] = gain.kp[k], gain.kd[k]
    command.kp[base + 4] *= 1.0 - robot.load[i]
    command.kd[base + 4] *= 1.0 - robot.load[i]
    own_weight = 1.0 - min(1.0, max(0.0, (robot.force[i] - _LOADED_FORCE) / _LOADED_FORCE_SPAN))
    torso_weight = robot.load[i] / max(1.0, robot.load[0] + robot.load[1])
    hip, rate = filtered_hip(gain, robot, i, 0, step)
    position, velocity = hip - desired[ROLL] + robot.roll, rate + robot.roll_rate
    torso = DriveLaw(gain.kp_torso_roll, gain.kd_torso_roll, position, velocity)
    _blend_laws(command, base, own_weight, torso_weight, torso)
    hip, rate = filtered_hip(gain, robot, i, 1, step)
    position, velocity = hip + desired[PITCH] - robot.pitch, rate - robot.pitch_rate
    torso = DriveLaw(gain.kp_torso_pitch, gain.kd_torso_pitch, position, velocity)
    _blend_laws(command, base + 2, own_weight, torso_weight, torso)


@compiled
def _blend_laws(
    command: MotorCommand, drive: int, own_weight: float, other_weight: float, other: DriveLaw
) -> None:
    """Give a drive the weighted sum of its own law's torque and another law's.

    Args:
        command: With the drive's own gains and set-points; changed in place.
        drive: Number of the drive.
        own_weight, other_weight: Weights of the two laws, 0..1.
        other: The other law.
    """
    kp, other_kp = own_weight * command.kp[drive], other_weight * other.kp
    kd, other_kd = own_weight * command.kd[drive], other_weight * other.kd
    total_kp, total_kd = max(1e-6, kp + other_kp), max(1e-6, kd + other_kd)
    position, velocity = command.position[drive], command.velocity[drive]
    command.kp[drive], command.kd[drive] = total_kp, total_kd
    command.position[drive] = (kp * position + other_kp * other.position) / total_kp
    command.velocity[drive] = (kd * velocity + other_kd * other.velocity) / total_kd


@compiled
def _knee_motion(length: float, length_rate: float) -> tuple[float, float]:
    """Knee angle and rate of a leg length, clamped to its range; in rad and rad/s."""
    length = min(_MAX_LENGTH, max(_MIN_LENGTH, length))
    knee = nearest_knee_angle(length)
    return knee, virtual_leg.knee_rate(knee, length, length_rate)


@compiled
def _set_weight_torques(
    robot: Robot, i: int, weight: float, jacobian: FloatArray, command: MotorCommand
) -> None:
    """Set the torques with which leg `i` holds a weight (N), along the line from foot to CoM."""
    x, y = robot.com[0] - robot.ankle[i, 0], robot.com[1] - robot.ankle[i, 1]
    z = max(_MIN_COM_HEIGHT, robot.com[2] - robot.ankle[i, 2])
    torques = holding_torques(jacobian, robot.tilt, weight, x / z, y / z)
    for k in range(4):
        command.torque[5 * i + k] = torques[k]
    command.torque[5 * i + 4] = 0.0


@compiled
def _add_swing_inertia(
    gain: Gains, robot: Robot, i: int, step: Step, command: MotorCommand
) -> None:
    """Add the torques that accelerate the swing leg, as far as it is off the ground.

    The stance hip transmits their reaction on the torso to the ground.
    """
    weight = gain.swing_inertia * (1.0 - robot.load[i])
    length = min(_MAX_SWING_LENGTH, max(_MIN_SWING_LENGTH, step.desired[LENGTH_SW]))
    v, a = step.desired_rates, step.accelerations
    roll, pitch, knee = inertia_torques(
        (v[ROLL_SW], v[PITCH_SW], v[LENGTH_SW]),
        (a[ROLL_SW], a[PITCH_SW], a[LENGTH_SW]),
        nearest_knee_angle(length),
        gain.inertia,
    )
    swing, stance = 5 * i, 5 - 5 * i
    command.torque[swing] += weight * roll
    command.torque[swing + 2] += weight * pitch
    command.torque[swing + 3] += weight * knee
    reaction = weight * robot.load[1 - i]
    command.torque[stance] -= reaction * roll
    command.torque[stance + 2] -= reaction * pitch


@compiled
def inertia_torques(
    rates: tuple[float, float, float],
    accelerations: tuple[float, float, float],
    knee: float,
    inertia: FloatArray,
) -> tuple[float, float, float]:
    """Torques of hip roll, hip pitch and knee that accelerate a swinging leg.

    Args:
        rates: Desired rates of leg roll, leg pitch and leg length. In rad/s and m/s.
        accelerations: Desired accelerations of leg roll, leg pitch and leg length. In rad/s^2 and
            m/s^2.
        knee: Knee angle that gives the desired leg length. In rad.
        inertia: See `gains.INERTIA`. Shape (4, 4), in kg m^2.

    Returns:
        Torques. In Nm.
    """
    roll_rate, leg_pitch_rate, length_rate = rates
    roll_acceleration, leg_pitch_acceleration, length_acceleration = accelerations
    sine, cosine = math.sin(knee + KNEE_OFFSET), math.cos(knee + KNEE_OFFSET)
    squares, product = SHIN * SHIN + THIGH * THIGH, SHIN * THIGH
    length = math.sqrt(squares + 2.0 * product * cosine)
    # length(k) and hip pitch = leg pitch + lean(k), with their derivatives by the knee angle k.
    d_length = -product * sine / length
    d2_length = (-product * cosine - d_length * d_length) / length
    knee_rate = length_rate / d_length
    knee_acceleration = (length_acceleration - d2_length * knee_rate * knee_rate) / d_length
    d_lean = SHIN * (SHIN + THIGH * cosine) / (length * length)
    d2_lean = (-SHIN * THIGH * sine - 2.0 * d_lean * length * d_length) / (length * length)
    pitch_rate = leg_pitch_rate - d_lean * knee_rate
    pitch_acceleration = leg_pitch_acceleration - d_lean * knee_acceleration
    pitch_acceleration -= d2_lean * knee_rate * knee_rate
    a, d_a = _cubic(inertia, 0, knee), _cubic_derivative(inertia, 0, knee)
    b, d_b = _cubic(inertia, 1, knee), _cubic_derivative(inertia, 1, knee)
    c = _cubic(inertia, 2, knee)
    r, d_r = _cubic(inertia, 3, knee), _cubic_derivative(inertia, 3, knee)
    roll_torque = r * roll_acceleration + d_r * roll_rate * knee_rate
    pitch_torque = a * pitch_acceleration + b * knee_acceleration
    pitch_torque += d_a * pitch_rate * knee_rate + d_b * knee_rate * knee_rate
    knee_torque = b * pitch_acceleration + c * knee_acceleration - 0.5 * d_a * pitch_rate**2
    return roll_torque, pitch_torque, knee_torque


@compiled
def _cubic(table: FloatArray, row: int, x: float) -> float:
    value: float = table[row, 0] + x * (table[row, 1] + x * (table[row, 2] + x * table[row, 3]))
    return value


@compiled
def _cubic_derivative(table: FloatArray, row: int, x: float) -> float:
    value: float = table[row, 1] + x * (2.0 * table[row, 2] + x * 3.0 * table[row, 3])
    return value
