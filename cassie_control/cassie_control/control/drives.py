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

from cassie_control.control.forces import carried_share, damped_weight, holding_torques
from cassie_control.control.gains import Gains
from cassie_control.control.outputs import Step, adjust
from cassie_control.control.robot import Robot
from cassie_control.planner.terrain import GroundSlope
from cassie_control.planner.timing import StepTiming, plan
from cassie_gaits import virtual_leg
from cassie_gaits.compiled import compiled
from cassie_gaits.leg import LegPair
from cassie_gaits.records import FloatArray, RecordArray, Records
from cassie_gaits.virtual_leg import KNEE_OFFSET, SHIN, THIGH, nearest_knee_angle
from cassie_msgs.layout import MotorCommand


@compiled
def _thigh(robot: Robot, i: int, axis: int) -> tuple[float, float]:
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
            angle, rate = _thigh(robot, i, axis)
            if step.tracked == 0.0:
                step.thigh[i, axis], step.thigh_rates[i, axis] = angle, rate
            else:
                ahead = step.thigh[i, axis] + dt * step.thigh_rates[i, axis]
                step.thigh[i, axis] = ahead + 2.0 * w * dt * (angle - ahead)
                step.thigh_rates[i, axis] += w * w * dt * (angle - ahead)
    step.tracked = 1.0


@compiled
def steady_hip(gain: Gains, robot: Robot, i: int, axis: int, step: Step) -> tuple[float, float]:
    """Hip roll (`axis` 0) or pitch (1) of leg `i`, with the track's share. In rad and rad/s."""
    angle, rate = _thigh(robot, i, axis)
    joint = 2 * axis
    return (
        robot.joints[i, joint] + gain.thigh_angle * (step.thigh[i, axis] - angle),
        robot.rates[i, joint] + gain.thigh_rate * (step.thigh_rates[i, axis] - rate),
    )


ROLL, YAW_ST, PITCH, LENGTH_ST, ROLL_SW, YAW_SW, PITCH_SW, LENGTH_SW, FOOT_SW = range(9)
_SHORTEST, _LONGEST = 0.4, 0.97  # m, range of the commanded leg length
_SHORTEST_SWING, _LONGEST_SWING = 0.45, 0.95  # m, range of the leg length for the inertia
_LIFTED, _LIFTING = 30.0, 100.0  # N, foot force up to which the leg swings; increase until it holds


@compiled
def drive(
    gains: Records[Gains],
    robots: Records[Robot],
    pairs: Records[LegPair],
    timings: Records[StepTiming],
    slopes: Records[GroundSlope],
    modes: RecordArray,
    steps: Records[Step],
    commands: RecordArray,
    pitch: float,
    roll: float,
    length: float,
    remaining: float,
    lead: float,
) -> None:
    """Compute set-points of the drives from the adjusted desired outputs.

    Args:
        gains, robots, slopes: Constants of the law, the robot and the ground. Shape (1,).
        pairs: Kinematics of both legs. Shape (1,).
        timings: Phase, whose rate follows `remaining`. Shape (1,).
        modes: `Mode.record`, with the torso's angles. Shape (1,).
        steps: The step; changed in place. Shape (1,).
        commands: Result, `MotorCommand.record`. Shape (1,).
        pitch, roll, length, remaining, lead: Result of leg-angle adjustment, `plan.SwingEnd`.

    Source:
        eq:IK and eq:hdtilde (README of cassie_gaits, Errata).
    """
    gain, robot, step, command = gains[0], robots[0], steps[0], commands[0]
    timing, slope, mode = timings[0], slopes[0], modes[0]
    plan(timing, remaining)
    step.new_rate, step.speed = timing.rate, timing.velocity[0]
    step.pitch, step.roll, step.length, step.lead = pitch, roll, length, lead
    step.torso_roll, step.torso_pitch = mode.roll + mode.trims[3], mode.pitch + mode.trims[2]
    step.slope_ahead, step.slope_left = slope.ahead, slope.left
    step.foothold = slope.foothold
    adjust(gain, robot, step)
    stance = step.stance
    track_thighs(gain, robot, step)
    _drive_stance(gain, robot, stance, step, command)
    _drive_swing(gain, robot, 1 - stance, step, command)
    weight = damped_weight(gain, robot, step)
    for i in range(2):
        share = carried_share(gain, robot, step, i)
        _hold_weight(robot, i, weight * share, pairs[0].states[i].ankle_jacobian, command)
    _push_swing(gain, robot, 1 - stance, step, command)


@compiled
def _drive_stance(gain: Gains, robot: Robot, i: int, step: Step, command: MotorCommand) -> None:
    """Set-points of the stance leg, whose hip regulates torso roll and pitch.

    The hip's set-point is q_hip + load (desired - measured torso angle), with q_hip of `steady_hip`
    and the load on the leg, 0..1; for roll the sign of the second term is -. The toe gives no
    torque.
    """
    q, v, load, at = robot.joints[i], robot.rates[i], robot.load[i], 5 * i
    hip_roll, roll_rate = steady_hip(gain, robot, i, 0, step)
    hip_pitch, pitch_rate = steady_hip(gain, robot, i, 1, step)
    desired, rates = step.desired, step.desired_rates
    knee, knee_rate = _knee(desired[LENGTH_ST], rates[LENGTH_ST])
    command.position[at] = hip_roll - load * (desired[ROLL] - robot.roll)
    command.position[at + 1] = desired[YAW_ST]
    command.position[at + 2] = hip_pitch + load * (desired[PITCH] - robot.pitch)
    command.position[at + 3] = knee
    command.position[at + 4] = q[6]
    # An unloaded stance leg holds its joints until it carries the torso.
    hold = load if load < 1.0 else 1.0
    command.velocity[at] = (roll_rate + load * robot.roll_rate) * hold
    command.velocity[at + 1] = rates[YAW_ST]
    command.velocity[at + 2] = (pitch_rate - load * robot.pitch_rate) * hold
    command.velocity[at + 3] = knee_rate
    command.velocity[at + 4] = v[6]
    for k in range(4):
        command.kp[at + k], command.kd[at + k] = gain.kp[k], gain.kd[k]
    command.kp[at], command.kd[at] = gain.kp_torso_roll, gain.kd_torso_roll
    command.kp[at + 2], command.kd[at + 2] = gain.kp_torso_pitch, gain.kd_torso_pitch
    command.kp[at + 4] = command.kd[at + 4] = 0.0


@compiled
def _drive_swing(gain: Gains, robot: Robot, i: int, step: Step, command: MotorCommand) -> None:
    """Set-points of the swing leg: every joint tracks, the toe as far as the foot is unloaded.

    As far as the foot still carries weight, its hip regulates the torso, as the stance hip does: a
    leg that swings against the ground would tip the torso over.

    The commanded leg length leads the measured one by at most `swing_lag` while the leg shortens. A
    toe that slides up the face of a riser is held back by up to 240 N. With a larger error, knee
    and springs would throw the foot up by 0.4 m as it comes free, and it would land far too short.
    """
    q, v, at = robot.joints[i], robot.rates[i], 5 * i
    desired, rates = step.desired, step.desired_rates
    length = max(desired[LENGTH_SW], virtual_leg.length(q[3]) - gain.swing_lag)
    knee, knee_rate = _knee(length, rates[LENGTH_SW])
    hip_pitch = desired[PITCH_SW] + robot.pitch + virtual_leg.lean(knee) - virtual_leg.HIP_OFFSET
    command.position[at] = desired[ROLL_SW] - robot.roll
    command.position[at + 1] = desired[YAW_SW]
    command.position[at + 2] = hip_pitch
    command.position[at + 3] = knee
    command.position[at + 4] = virtual_leg.toe_angle(desired[FOOT_SW], robot.pitch, q[2])
    command.velocity[at] = rates[ROLL_SW] - robot.roll_rate
    command.velocity[at + 1] = rates[YAW_SW]
    command.velocity[at + 2] = virtual_leg.hip_pitch_rate(
        knee, rates[PITCH_SW], robot.pitch_rate, knee_rate
    )
    command.velocity[at + 3] = knee_rate
    command.velocity[at + 4] = rates[FOOT_SW] + robot.pitch_rate - v[2]
    for k in range(5):
        command.kp[at + k], command.kd[at + k] = gain.kp[k], gain.kd[k]
    command.kp[at + 4] *= 1.0 - robot.load[i]
    command.kd[at + 4] *= 1.0 - robot.load[i]
    own = 1.0 - min(1.0, max(0.0, (robot.force[i] - _LIFTED) / _LIFTING))
    held = robot.load[i] / max(1.0, robot.load[0] + robot.load[1])
    hip, rate = steady_hip(gain, robot, i, 0, step)
    law = (gain.kp_torso_roll, hip - desired[ROLL] + robot.roll)
    _share(command, at, own, held, law, (gain.kd_torso_roll, rate + robot.roll_rate))
    hip, rate = steady_hip(gain, robot, i, 1, step)
    law = (gain.kp_torso_pitch, hip + desired[PITCH] - robot.pitch)
    _share(command, at + 2, own, held, law, (gain.kd_torso_pitch, rate - robot.pitch_rate))


@compiled
def _share(
    command: MotorCommand,
    drive: int,
    own: float,
    share: float,
    position: tuple[float, float],
    rate: tuple[float, float],
) -> None:
    """Combine two laws of a drive: `own` times its own torque plus `share` times the other law's.

    Args:
        command: With the drive's own gains and set-points; changed in place.
        drive: Number of the drive.
        own, share: Weights of the two laws, 0..1.
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
def _knee(length: float, length_rate: float) -> tuple[float, float]:
    """Knee angle and rate of a leg length, clamped to its range; in rad and rad/s."""
    length = min(_LONGEST, max(_SHORTEST, length))
    knee = nearest_knee_angle(length)
    return knee, virtual_leg.knee_rate(knee, length, length_rate)


@compiled
def _hold_weight(
    robot: Robot, i: int, weight: float, jacobian: FloatArray, command: MotorCommand
) -> None:
    """Set the torques with which leg `i` holds a weight (N), along the line from foot to CoM."""
    x, y = robot.com[0] - robot.ankle[i, 0], robot.com[1] - robot.ankle[i, 1]
    z = max(0.4, robot.com[2] - robot.ankle[i, 2])
    held = holding_torques(jacobian, robot.tilt, weight, x / z, y / z)
    for k in range(4):
        command.torque[5 * i + k] = held[k]
    command.torque[5 * i + 4] = 0.0


@compiled
def _push_swing(gain: Gains, robot: Robot, i: int, step: Step, command: MotorCommand) -> None:
    """Add the torques that accelerate the swing leg, as far as it is off the ground.

    The stance hip transmits their reaction on the torso to the ground.
    """
    share = gain.swing_inertia * (1.0 - robot.load[i])
    length = min(_LONGEST_SWING, max(_SHORTEST_SWING, step.desired[LENGTH_SW]))
    v, a = step.desired_rates, step.accelerations
    roll, pitch, knee = inertia_torques(
        (v[ROLL_SW], v[PITCH_SW], v[LENGTH_SW]),
        (a[ROLL_SW], a[PITCH_SW], a[LENGTH_SW]),
        nearest_knee_angle(length),
        gain.inertia,
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
    bend = knee + KNEE_OFFSET
    sine, cosine = math.sin(bend), math.cos(bend)
    squares, product = SHIN * SHIN + THIGH * THIGH, SHIN * THIGH
    length = math.sqrt(squares + 2.0 * product * cosine)
    # length(k) and hip pitch = leg pitch + lean(k), each differentiated twice by time.
    slope = -product * sine / length
    bow = (-product * cosine - slope * slope) / length
    knee_rate = rates[2] / slope
    knee_acceleration = (accelerations[2] - bow * knee_rate * knee_rate) / slope
    share = SHIN * (SHIN + THIGH * cosine) / (length * length)
    share_slope = (-SHIN * THIGH * sine - 2.0 * share * length * slope) / (length * length)
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
