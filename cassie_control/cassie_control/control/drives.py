"""Set-points of the drives while walking: eq:IK, eq:hdtilde, and feed-forward torques.

The hip. The stance hip regulates the torso: the hip drive's set-point is the measured hip angle
plus the torso's error. If set-points are late by D, the drive's damping torque is
kd (v(t - D) - v(t)). This is 0 at the frequency 1 / D, which for 20 ms is near the 42 Hz of the
oscillation of hip and leaf springs. So a share of the hip's motion q is replaced by the low-passed
motion of the thigh in space. With theta the thigh's angle in space (hip roll plus torso roll, hip
pitch less torso pitch) and w = 2 pi thigh_track,

    phi' = rho + 2 w (theta - phi),   rho' = w^2 (theta - phi),
    q_f  = q + thigh_angle (phi - theta),   q_f' = q' + thigh_rate (rho - theta'),

and q_f takes the place of q in the set-point. The filter follows a steady swing without lag. The
drive damps motion relative to it at 2 kHz, late or not. `thigh_angle` and `thigh_rate` are below 1
without latency: with all of the motion replaced, damping torques that the drive applies 3 ms late
would cause oscillation at that frequency. With late drives both become 1 (`gains`).

The swing leg. Torques accelerate the swing leg as its desired outputs require. In its plane the leg
is a double pendulum of the thigh's pitch in space p and knee k, with relaxed springs (the tarsus
turns against the knee) and the foot kept level. About the hip roll axis its inertia depends on the
knee:

    u_pitch = A p'' + B k'' + A' p' k' + B' k'^2
    u_knee  = B p'' + C k'' - A' p'^2 / 2
    u_roll  = R r'' + R' r' k'

with A, B, C and R functions of the knee angle, drives' armature included. A', B' and R' are their
derivatives by the knee angle. u_knee leaves out C' k'^2 / 2, as C is nearly constant, and
-R' r'^2 / 2, which is 0.3 Nm at 1 rad/s. Gravity is left to the position loop: it holds a hanging
leg within 0.01 rad.

Source:
    Cubic polynomials fitted to the mass matrix of `cassie_gaits.dynamics` for knees of -2.4 to
    -0.75 rad, error below 0.001 kg m^2 (a test holds that).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from cassie_control.control.forces import load_share, swing_foot_load
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
)
from cassie_control.control.robot import MAX_COMMANDED_LENGTH, MAX_LEG_LENGTH, Robot
from cassie_gaits import virtual_leg
from cassie_gaits.compiled import compiled
from cassie_gaits.names import (
    HIP_PITCH,
    HIP_ROLL,
    HIP_YAW,
    KNEE,
    LEG_DRIVE_COUNT,
    TOE,
    TOE_DRIVE,
)
from cassie_gaits.virtual_leg import KNEE_OFFSET, SHIN, THIGH, nearest_knee_angle
from cassie_msgs.layout import MotorCommand

ROLL_AXIS, PITCH_AXIS = 0, 1
"""Axes of a hip in `Step.hip` and `Step.filtered_thigh`."""


@compiled
def filter_hips(gain: Gains, robot: Robot, step: Step) -> None:
    """Compute the hip angles and rates in which a share of the measured motion is low-passed.

    Args:
        gain: Constants of the law.
        robot: The robot now.
        step: Gets phi and rho, q_f and q_f' of the equations above for roll and pitch of both legs.
            The filter begins with the measured motion.

    Source:
        Critically damped alpha-beta filter with the equations above.
    """
    w, dt = 2.0 * math.pi * gain.thigh_track, gain.period
    torso = (robot.roll, robot.roll_rate), (-robot.pitch, -robot.pitch_rate)
    for i in range(2):
        for axis, joint in ((ROLL_AXIS, HIP_ROLL), (PITCH_AXIS, HIP_PITCH)):
            hip, hip_rate = robot.joints[i, joint], robot.rates[i, joint]
            angle, rate = hip + torso[axis][0], hip_rate + torso[axis][1]
            if step.thighs_filtered == 0.0:
                step.filtered_thigh[i, axis], step.filtered_thigh_rates[i, axis] = angle, rate
            else:
                predicted = step.filtered_thigh[i, axis] + dt * step.filtered_thigh_rates[i, axis]
                step.filtered_thigh[i, axis] = predicted + 2.0 * w * dt * (angle - predicted)
                step.filtered_thigh_rates[i, axis] += w * w * dt * (angle - predicted)
            step.hip[i, axis] = hip + gain.thigh_angle * (step.filtered_thigh[i, axis] - angle)
            step.hip_rates[i, axis] = hip_rate + gain.thigh_rate * (
                step.filtered_thigh_rates[i, axis] - rate
            )
    step.thighs_filtered = 1.0


class DriveLaw(NamedTuple):
    """Gains and set-points of a drive."""

    kp: float
    kd: float
    position: float
    velocity: float


# A, B, C and R by rising power of the knee angle, in kg m^2.
_A = (1.0411, -0.1591, -0.3106, -0.0599)
_B = (0.5699, -0.0817, -0.1565, -0.0302)
_C = (0.4899, -0.0042, -0.0024, -0.0004)
_R = (1.3723, -0.1943, -0.4381, -0.0809)

_MIN_LENGTH = 0.4  # m, shortest leg that is commanded
_MIN_SWING_LENGTH = 0.45  # m, shortest leg for the inertia


@compiled
def drive_stance(gain: Gains, robot: Robot, i: int, step: Step, command: MotorCommand) -> None:
    """Set-points of the stance leg, whose hip regulates torso roll and pitch.

    With q_f and q_f' of `filter_hips` and the load l on the leg, 0..1, the hip gets

        q_d = q_f + l (desired - measured torso angle),    q_d' = l (q_f' - l torso rate),

    for roll with the opposite sign of both torso terms. An unloaded stance leg thus holds its
    joints until it carries the torso. The toe gives no torque.

    Args:
        gain: Constants of the law.
        robot: The robot now.
        i: Number of the leg.
        step: The step, with the desired outputs.
        command: Gains and set-points of the leg are changed in place.

    Source:
        eq:IK, eq:hdtilde.
    """
    q, v, load, base = robot.joints[i], robot.rates[i], robot.load[i], LEG_DRIVE_COUNT * i
    hip_roll, roll_rate = step.hip[i, ROLL_AXIS], step.hip_rates[i, ROLL_AXIS]
    hip_pitch, pitch_rate = step.hip[i, PITCH_AXIS], step.hip_rates[i, PITCH_AXIS]
    desired, rates = step.desired, step.desired_rates
    knee, knee_rate = _knee_motion(desired[LENGTH_ST], rates[LENGTH_ST])
    command.position[base + HIP_ROLL] = hip_roll - load * (desired[ROLL] - robot.roll)
    command.position[base + HIP_YAW] = desired[YAW_ST]
    command.position[base + HIP_PITCH] = hip_pitch + load * (desired[PITCH] - robot.pitch)
    command.position[base + KNEE] = knee
    command.position[base + TOE_DRIVE] = q[TOE]
    command.velocity[base + HIP_ROLL] = (roll_rate + load * robot.roll_rate) * load
    command.velocity[base + HIP_YAW] = rates[YAW_ST]
    command.velocity[base + HIP_PITCH] = (pitch_rate - load * robot.pitch_rate) * load
    command.velocity[base + KNEE] = knee_rate
    command.velocity[base + TOE_DRIVE] = v[TOE]
    for k in range(TOE_DRIVE):
        command.kp[base + k], command.kd[base + k] = gain.kp[k], gain.kd[k]
    command.kp[base + HIP_ROLL] = gain.kp_torso_roll
    command.kd[base + HIP_ROLL] = gain.kd_torso_roll
    command.kp[base + HIP_PITCH] = gain.kp_torso_pitch
    command.kd[base + HIP_PITCH] = gain.kd_torso_pitch
    command.kp[base + TOE_DRIVE] = command.kd[base + TOE_DRIVE] = 0.0


@compiled
def drive_swing(gain: Gains, robot: Robot, i: int, step: Step, command: MotorCommand) -> None:
    """Set-points of the swing leg: every joint tracks, the toe as far as the foot is unloaded.

    As far as the foot still carries weight, its hip regulates the torso, as the stance hip does: a
    leg that swings against the ground would tip the torso over.

    The commanded leg length leads the measured one by at most `Gains.max_swing_lag` while the leg
    shortens: a foot that is held back, as by the edge of a riser, must not load the springs.

    With F the foot's force, the drive laws of the hip's roll and pitch are blended, without the
    feed-forward torque:

        u = (1 - sat((F - 30 N) / 100 N)) u_swing + load / max(1, sum of loads) u_stance,

    with u_stance that of a stance hip at full load.

    Args:
        gain: Constants of the law.
        robot: The robot now.
        i: Number of the leg.
        step: The step, with the desired outputs.
        command: Gains and set-points of the leg are changed in place.

    Source:
        eq:IK.
    """
    q, v, base = robot.joints[i], robot.rates[i], LEG_DRIVE_COUNT * i
    desired, rates = step.desired, step.desired_rates
    length = max(desired[LENGTH_SW], virtual_leg.length(q[KNEE]) - gain.max_swing_lag)
    knee, knee_rate = _knee_motion(length, rates[LENGTH_SW])
    hip_pitch = desired[PITCH_SW] + robot.pitch + virtual_leg.lean(knee) - virtual_leg.HIP_OFFSET
    command.position[base + HIP_ROLL] = desired[ROLL_SW] - robot.roll
    command.position[base + HIP_YAW] = desired[YAW_SW]
    command.position[base + HIP_PITCH] = hip_pitch
    command.position[base + KNEE] = knee
    command.position[base + TOE_DRIVE] = virtual_leg.toe_angle(
        desired[FOOT_SW], robot.pitch, q[HIP_PITCH]
    )
    command.velocity[base + HIP_ROLL] = rates[ROLL_SW] - robot.roll_rate
    command.velocity[base + HIP_YAW] = rates[YAW_SW]
    command.velocity[base + HIP_PITCH] = virtual_leg.hip_pitch_rate(
        knee, rates[PITCH_SW], robot.pitch_rate, knee_rate
    )
    command.velocity[base + KNEE] = knee_rate
    command.velocity[base + TOE_DRIVE] = rates[FOOT_SW] + robot.pitch_rate - v[HIP_PITCH]
    for k in range(LEG_DRIVE_COUNT):
        command.kp[base + k], command.kd[base + k] = gain.kp[k], gain.kd[k]
    command.kp[base + TOE_DRIVE] *= 1.0 - robot.load[i]
    command.kd[base + TOE_DRIVE] *= 1.0 - robot.load[i]
    own_weight = 1.0 - swing_foot_load(robot.force[i])
    torso_weight = load_share(robot, i)
    hip, rate = step.hip[i, ROLL_AXIS], step.hip_rates[i, ROLL_AXIS]
    position, velocity = hip - desired[ROLL] + robot.roll, rate + robot.roll_rate
    torso = DriveLaw(gain.kp_torso_roll, gain.kd_torso_roll, position, velocity)
    _blend_laws(command, base + HIP_ROLL, own_weight, torso_weight, torso)
    hip, rate = step.hip[i, PITCH_AXIS], step.hip_rates[i, PITCH_AXIS]
    position, velocity = hip + desired[PITCH] - robot.pitch, rate - robot.pitch_rate
    torso = DriveLaw(gain.kp_torso_pitch, gain.kd_torso_pitch, position, velocity)
    _blend_laws(command, base + HIP_PITCH, own_weight, torso_weight, torso)


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
    length = min(MAX_COMMANDED_LENGTH, max(_MIN_LENGTH, length))
    knee = nearest_knee_angle(length)
    return knee, virtual_leg.knee_rate(knee, length, length_rate)


@compiled
def add_swing_inertia(gain: Gains, robot: Robot, i: int, step: Step, command: MotorCommand) -> None:
    """Add the torques that accelerate the swing leg, as far as it is off the ground.

    The stance hip transmits their reaction on the torso to the ground.

    Args:
        gain: Constants of the law.
        robot: The robot now.
        i: Number of the swing leg.
        step: The step, with the rates and accelerations of the desired outputs.
        command: Torques are added.
    """
    weight = gain.swing_inertia * (1.0 - robot.load[i])
    length = min(MAX_LEG_LENGTH, max(_MIN_SWING_LENGTH, step.desired[LENGTH_SW]))
    v, a = step.desired_rates, step.accelerations
    roll, pitch, knee = inertia_torques(
        (v[ROLL_SW], v[PITCH_SW], v[LENGTH_SW]),
        (a[ROLL_SW], a[PITCH_SW], a[LENGTH_SW]),
        nearest_knee_angle(length),
    )
    swing, stance = LEG_DRIVE_COUNT * i, LEG_DRIVE_COUNT * (1 - i)
    command.torque[swing + HIP_ROLL] += weight * roll
    command.torque[swing + HIP_PITCH] += weight * pitch
    command.torque[swing + KNEE] += weight * knee
    reaction = weight * robot.load[1 - i]
    command.torque[stance + HIP_ROLL] -= reaction * roll
    command.torque[stance + HIP_PITCH] -= reaction * pitch


@compiled
def inertia_torques(
    rates: tuple[float, float, float],
    accelerations: tuple[float, float, float],
    knee: float,
) -> tuple[float, float, float]:
    """Torques of hip roll, hip pitch and knee that accelerate a swinging leg.

    Args:
        rates: Desired rates of leg roll, leg pitch and leg length. In rad/s and m/s.
        accelerations: Desired accelerations of leg roll, leg pitch and leg length. In rad/s^2 and
            m/s^2.
        knee: Knee angle that gives the desired leg length. In rad.

    Returns:
        Torques. In Nm.
    """
    roll_rate, leg_pitch_rate, length_rate = rates
    roll_acceleration, leg_pitch_acceleration, length_acceleration = accelerations
    sine, cosine = math.sin(knee + KNEE_OFFSET), math.cos(knee + KNEE_OFFSET)
    product = SHIN * THIGH
    length = virtual_leg.length(knee)
    # Derivatives of leg length and leg pitch by the knee angle, at a fixed hip pitch.
    d_length = -product * sine / length
    d2_length = (-product * cosine - d_length * d_length) / length
    knee_rate = length_rate / d_length
    knee_acceleration = (length_acceleration - d2_length * knee_rate * knee_rate) / d_length
    d_leg_pitch = SHIN * (SHIN + THIGH * cosine) / (length * length)
    d2_leg_pitch = (-SHIN * THIGH * sine - 2.0 * d_leg_pitch * length * d_length) / (
        length * length
    )
    pitch_rate = leg_pitch_rate - d_leg_pitch * knee_rate
    pitch_acceleration = leg_pitch_acceleration - d_leg_pitch * knee_acceleration
    pitch_acceleration -= d2_leg_pitch * knee_rate * knee_rate
    a, d_a = _cubic(_A, knee), _cubic_derivative(_A, knee)
    b, d_b = _cubic(_B, knee), _cubic_derivative(_B, knee)
    c = _cubic(_C, knee)
    r, d_r = _cubic(_R, knee), _cubic_derivative(_R, knee)
    roll_torque = r * roll_acceleration + d_r * roll_rate * knee_rate
    pitch_torque = a * pitch_acceleration + b * knee_acceleration
    pitch_torque += d_a * pitch_rate * knee_rate + d_b * knee_rate * knee_rate
    knee_torque = b * pitch_acceleration + c * knee_acceleration - 0.5 * d_a * pitch_rate**2
    return roll_torque, pitch_torque, knee_torque


@compiled
def _cubic(c: tuple[float, float, float, float], x: float) -> float:
    return c[0] + x * (c[1] + x * (c[2] + x * c[3]))


@compiled
def _cubic_derivative(c: tuple[float, float, float, float], x: float) -> float:
    return c[1] + x * (2.0 * c[2] + x * 3.0 * c[3])
