"""The nine outputs of eq:h0: their measured values, and their desired values during a step.

`Step` is the record of a step, which compiled functions share. `walking` has the reasoning.
"""

from __future__ import annotations

import math

import numpy as np

from cassie_control.control.forces import swing_foot_load
from cassie_control.control.gains import Gains
from cassie_control.control.robot import MAX_LEG_LENGTH, Robot, hip_pitch_ahead
from cassie_control.planner.placement import TORSO_PITCH_TRIM, TORSO_ROLL_TRIM, SwingTarget
from cassie_control.planner.terrain import GroundSlope, step_up_height
from cassie_control.planner.timing import StepTiming, backward_share
from cassie_gaits import virtual_leg
from cassie_gaits.bezier import COEFFICIENTS, fade, fade_derivatives, fill_basis
from cassie_gaits.compiled import compiled
from cassie_gaits.gait_grid import read_row
from cassie_gaits.gait_library import gait_in_stance
from cassie_gaits.names import HIP_PITCH, HIP_ROLL, HIP_YAW, KNEE, TOE
from cassie_gaits.records import FloatArray, IntArray, Record, Records, array
from cassie_msgs.layout import Mode

ROLL, YAW_ST, PITCH, LENGTH_ST, ROLL_SW, YAW_SW, PITCH_SW, LENGTH_SW, FOOT_SW = range(9)
"""Rows of eq:h0; `cassie_gaits.gait_library.OUTPUTS` names them."""

AT_END = COEFFICIENTS - 1
"""Place of the Bezier coefficient that is the polynomial's value at the end of the step."""


class Step(Record):
    """A step of walking. Arrays over outputs have the order of eq:h0 and are in rad and m.

    Attributes:
        heading: Desired heading. In rad.
        half_turn: Half of the turn of this step. In rad.
        landing_yaw: Swing hip yaw at touchdown. In rad.
        initial, initial_rates: Outputs and their rates at the beginning of this step.
        gait: Bezier coefficients of this step.
        desired, desired_rates, accelerations: Desired outputs and their time derivatives.
        measured, measured_rates: Outputs and their rates as last measured.
        thighs_filtered: 1 once the filters of the thighs have begun.
        filtered_thigh, filtered_thigh_rates: Low-passed roll and pitch of each thigh in space, and
            their rates, see `filter_hips`. In rad and rad/s.
        hip, hip_rates: Roll and pitch of each hip as the torso's set-points take them, and their
            rates, see `filter_hips`. In rad and rad/s.
    """

    heading: float
    half_turn: float
    landing_yaw: float
    initial: FloatArray = array(9)
    initial_rates: FloatArray = array(9)
    gait: FloatArray = array(9, COEFFICIENTS)
    desired: FloatArray = array(9)
    desired_rates: FloatArray = array(9)
    accelerations: FloatArray = array(9)
    measured: FloatArray = array(9)
    measured_rates: FloatArray = array(9)
    thighs_filtered: float
    filtered_thigh: FloatArray = array(2, 2)
    filtered_thigh_rates: FloatArray = array(2, 2)
    hip: FloatArray = array(2, 2)
    hip_rates: FloatArray = array(2, 2)


@compiled
def measure(robots: Records[Robot], stance: int, steps: Records[Step]) -> None:
    """Update `Step.measured` and `Step.measured_rates`: the outputs h_0 and their rates.

    Args:
        robots: The robot now. Shape (1,).
        stance: Number of the stance leg.
        steps: The step; changed in place. Shape (1,).

    Source:
        eq:h0 and eq:AbsoluteQuantities (README of cassie_gaits, Errata).
    """
    robot, h, rates = robots[0], steps[0].measured, steps[0].measured_rates
    st, sw = robot.joints[stance], robot.joints[1 - stance]
    st_rate, sw_rate = robot.rates[stance], robot.rates[1 - stance]
    h[ROLL] = robot.roll
    h[YAW_ST] = st[HIP_YAW]
    h[PITCH] = robot.pitch
    h[LENGTH_ST] = virtual_leg.length(st[KNEE])
    h[ROLL_SW] = virtual_leg.roll(robot.roll, sw[HIP_ROLL])
    h[YAW_SW] = sw[HIP_YAW]
    h[PITCH_SW] = virtual_leg.pitch(robot.pitch, sw[HIP_PITCH], sw[KNEE])
    h[LENGTH_SW] = virtual_leg.length(sw[KNEE])
    h[FOOT_SW] = virtual_leg.foot_pitch(robot.pitch, sw[HIP_PITCH], sw[TOE])
    rates[ROLL] = robot.roll_rate
    rates[YAW_ST] = st_rate[HIP_YAW]
    rates[PITCH] = robot.pitch_rate
    rates[LENGTH_ST] = virtual_leg.length_rate(st[KNEE], st_rate[KNEE])
    rates[ROLL_SW] = robot.roll_rate + sw_rate[HIP_ROLL]
    rates[YAW_SW] = sw_rate[HIP_YAW]
    rates[PITCH_SW] = virtual_leg.pitch_rate(
        sw[KNEE], robot.pitch_rate, sw_rate[HIP_PITCH], sw_rate[KNEE]
    )
    rates[LENGTH_SW] = virtual_leg.length_rate(sw[KNEE], sw_rate[KNEE])
    rates[FOOT_SW] = -robot.pitch_rate + sw_rate[HIP_PITCH] + sw_rate[TOE]


@compiled
def begin_step(
    robots: Records[Robot], stance: int, keeps_lengths: bool, steps: Records[Step]
) -> None:
    """Start the outputs of the new step at the measured ones.

    The swing leg's roll and pitch continue at the measured rates, leg lengths and sole at rate 0.
    `_turn_hip` gives the yaws' rates. The torso's outputs are the gait's.

    Args:
        robots: The robot now. Shape (1,).
        stance: Number of the new stance leg.
        keeps_lengths: Whether the legs' lengths start at the desired ones. The knees hold the
            weight by the difference of desired and measured length, which must not jump.
        steps: The step; changed in place. Shape (1,).
    """
    measure(robots, stance, steps)
    step = steps[0]
    for i in range(9):
        step.initial[i], step.initial_rates[i] = step.measured[i], step.measured_rates[i]
    if keeps_lengths:
        step.initial[LENGTH_ST], step.initial[LENGTH_SW] = (
            step.desired[LENGTH_SW],
            step.desired[LENGTH_ST],
        )
    # Measured rates jump at the impact, so these outputs start from rest.
    for i in (LENGTH_ST, LENGTH_SW, FOOT_SW):
        step.initial_rates[i] = 0.0


LEAST_ACCELERATION = np.array(
    [
        [-0.39820556608601937, 1.1447992929495692, 0.41183065863182233, -0.15842438549537166],
        [-0.15842438549537183, 0.4118306586318224, 1.1447992929495692, -0.3982055660860199],
    ]
)
"""Matrix from a polynomial's first and last two coefficients to the two between that give the least
squared second derivative at 41 even phases (a test holds that)."""

_MAX_SHORTENING = 0.05  # m, of a swing leg whose foot is loaded


@compiled
def evaluate_gait(
    gains: Records[Gains],
    robots: Records[Robot],
    timings: Records[StepTiming],
    slopes: Records[GroundSlope],
    axes: FloatArray,
    lengths: IntArray,
    rows: FloatArray,
    vy: float,
    yaw_rate: float,
    steps: Records[Step],
) -> None:
    """Desired outputs by the gait, and the turn of this step.

    Args:
        gains: Constants of the law. Shape (1,).
        robots, slopes: The robot and the ground now. Shape (1,).
        timings: Phase; gets the gait's step time. Shape (1,).
        axes, lengths, rows: `GaitLibrary.table`.
        vy, yaw_rate: Commanded velocity to the left and yaw rate, at which the gait is read. In m/s
            and rad/s.
        steps: The step; changed in place. Shape (1,).
    """
    gain, robot, timing, step = gains[0], robots[0], timings[0], steps[0]
    row = np.empty(rows.shape[1])
    read_row(axes, lengths, rows, min(gain.gait_speed, timing.velocity[0]), vy, yaw_rate, row)
    timing.step_time = 1.0 / row[-1]
    gait, stance = step.gait, timing.stance
    clearance = gain.clearance + step_up_height(slopes[0])
    _start_gait(gain, gait_in_stance(row, stance), timing.step_time, clearance, step)
    basis = np.empty((COEFFICIENTS, 3))
    fill_basis(min(1.0, timing.phase), basis)
    for i in range(9):
        value = rate = acceleration = 0.0
        for k in range(COEFFICIENTS):
            value += gait[i, k] * basis[k, 0]
            rate += gait[i, k] * basis[k, 1]
            acceleration += gait[i, k] * basis[k, 2]
        step.desired[i] = value
        step.desired_rates[i] = rate * timing.rate
        step.accelerations[i] = acceleration * timing.rate**2
    step.half_turn = 0.5 * yaw_rate * timing.step_time
    yaw = step.half_turn + gain.heading_gain * (step.heading - robot.yaw)
    step.landing_yaw = max(-gain.yaw_limit, min(gain.yaw_limit, yaw))


@compiled
def _start_gait(
    gain: Gains, library_gait: FloatArray, step_time: float, clearance: float, step: Step
) -> None:
    """Copy the gait and start it where the legs were at touchdown; the torso's is continuous.

    Args:
        gain: Constants of the law.
        library_gait: Coefficients of the gait. Shape (9, 6).
        step_time: Duration of the step by the gait. In s.
        clearance: Height added to the swing foot in mid-step. In m.
        step: The step; changed in place.
    """
    gait = step.gait
    for i in range(9):
        for k in range(COEFFICIENTS):
            gait[i, k] = library_gait[i, k]
        if i not in (ROLL, PITCH):
            gait[i, 0] = step.initial[i]
            gait[i, 1] = step.initial[i] + step.initial_rates[i] * (step_time / 5.0)
    # These two have the weight 10 s^2 (1 - s)^2: 5/8 in the middle of a step, 0 at its ends.
    for k in (2, 3):
        gait[LENGTH_SW, k] -= 1.6 * clearance
    if gain.least_acceleration:
        for i in (ROLL_SW, PITCH_SW):
            for k in range(2):
                a, b = LEAST_ACCELERATION[k, 0], LEAST_ACCELERATION[k, 1]
                c, d = LEAST_ACCELERATION[k, 2], LEAST_ACCELERATION[k, 3]
                gait[i, 2 + k] = a * gait[i, 0] + b * gait[i, 1] + c * gait[i, 4] + d * gait[i, 5]


@compiled
def adjust_outputs(
    gain: Gains,
    robot: Robot,
    mode: Mode,
    timing: StepTiming,
    slope: GroundSlope,
    target: SwingTarget,
    step: Step,
) -> None:
    """Add leg-angle adjustment and turning, smoothly over the step; called after `evaluate_gait`.

    Args:
        gain: Constants of the law.
        robot, slope: The robot and the ground now.
        mode: `Mode.record[0]`, with the torso's angles.
        timing: Phase, at its rate after leg-angle adjustment.
        target: Result of leg-angle adjustment.
        step: The step; changed in place.
    """
    gait, rate = step.gait, timing.rate
    phase = min(1.0, timing.phase)
    contact_pitch, contact_roll = _contact_angles(step, target.contact_lead, rate)
    _level_hip_path(gain, robot, timing, slope, phase, step)
    _add_correction(step, PITCH_SW, target.pitch - contact_pitch, phase, rate)
    _add_correction(step, ROLL_SW, target.roll - contact_roll, phase, rate)
    _add_correction(step, LENGTH_SW, target.length - gait[LENGTH_SW, AT_END], phase, rate)
    _add_correction(step, FOOT_SW, math.atan(slope.ahead), phase, rate)
    _turn_hip(step, YAW_ST, -step.half_turn, phase, rate)
    _turn_hip(step, YAW_SW, step.landing_yaw, phase, rate)
    _shorten_loaded_swing_leg(robot.force[1 - timing.stance], phase, step)
    if timing.phase > 1.0:
        _extend_late_swing_leg(gain, timing, step)
    step.desired[ROLL] += mode.roll + mode.trims[TORSO_ROLL_TRIM]
    step.desired[PITCH] += mode.pitch + mode.trims[TORSO_PITCH_TRIM]


@compiled
def _contact_angles(step: Step, contact_lead: float, rate: float) -> tuple[float, float]:
    """Pitch and roll of the gait's swing leg, in rad, `contact_lead` (s) before its end."""
    gait = step.gait
    pitch, roll = gait[PITCH_SW, AT_END], gait[ROLL_SW, AT_END]
    if contact_lead > 0.0:
        basis = np.empty((COEFFICIENTS, 3))
        fill_basis(1.0 - contact_lead * rate, basis)
        pitch = roll = 0.0
        for k in range(COEFFICIENTS):
            pitch += gait[PITCH_SW, k] * basis[k, 0]
            roll += gait[ROLL_SW, k] * basis[k, 0]
    return pitch, roll


@compiled
def _add_correction(step: Step, row: int, correction: float, phase: float, rate: float) -> None:
    """Add to an output a correction that grows smoothly from 0 at the beginning of the step.

    Args:
        step: The step; changed in place.
        row: Row of the output.
        correction: What is added at the end of the step. In the output's unit.
        phase, rate: Phase of the step, at most 1, and its rate. In 1/s.
    """
    first, second = fade_derivatives(phase)
    step.desired[row] += fade(phase) * correction
    step.desired_rates[row] += rate * first * correction
    step.accelerations[row] += second * rate**2 * correction


@compiled
def _turn_hip(step: Step, row: int, end: float, phase: float, rate: float) -> None:
    """Move a hip's yaw from its value at touchdown to the end of this step's turn.

    Both hips begin and end a step at minus the commanded yaw rate if it takes the gait's time. A
    foot on the ground then does not turn. So the stance foot need not accelerate the body: a line
    contact has little friction for that. And a foot that lands, or leaves, does not jump in its
    rate. All else changes smoothly in between. The yaws of the gait, which fit one turning rate
    each, do not count.

    Args:
        step: The step; changed in place.
        row: Row of the hip's yaw.
        end: The yaw at the end of the step. In rad.
        phase, rate: Phase of the step, at most 1, and its rate. In 1/s.
    """
    first, second = fade_derivatives(phase)
    turn = -2.0 * step.half_turn
    correction = end - turn - step.initial[row]
    step.desired[row] = step.initial[row] + turn * phase + fade(phase) * correction
    step.desired_rates[row] = rate * (turn + first * correction)
    step.accelerations[row] = rate**2 * second * correction


@compiled
def _level_hip_path(
    gain: Gains, robot: Robot, timing: StepTiming, slope: GroundSlope, phase: float, step: Step
) -> None:
    """Change the stance leg's length so that its hip travels level.

    With x the hip ahead of the toe joint, y the CoM left of it, and H_gait the height of the gait's
    swing hip at touchdown:

        H       = H_gait + slope_ahead x + slope_left y - foothold_height,
        length += weight fade(phase) (min(0.95 m, sqrt(H^2 + x^2)) - length).

    The weight is 1 forward, and changes to `level_back` from 0 to 1/3 m/s backward. So the hip
    travels parallel to the slope, and keeps its height over the ground around the foot. The rate
    leaves out those of the fade, of the rise to the side, and of the bound of 0.95 m (DECISIONS.md,
    Walking).
    """
    backward = backward_share(timing.velocity[0])
    weight = gain.level_hip * fade(phase) * (1.0 + backward * (gain.level_back - 1.0))
    hip_height = step.gait[LENGTH_SW, AT_END] * math.cos(step.gait[PITCH_SW, AT_END])
    i = timing.stance
    hip_x = hip_pitch_ahead(robot) - robot.toe_joint[i, 0]
    com_y = robot.com[1] - robot.toe_joint[i, 1]
    hip_height += slope.ahead * hip_x - slope.foothold_height + slope.left * com_y
    length = min(MAX_LEG_LENGTH, math.hypot(hip_height, hip_x))
    step.desired[LENGTH_ST] += weight * (length - step.desired[LENGTH_ST])
    rate = (hip_x + slope.ahead * hip_height) * robot.velocity[0] / length
    step.desired_rates[LENGTH_ST] += weight * (rate - step.desired_rates[LENGTH_ST])


@compiled
def _shorten_loaded_swing_leg(force: float, phase: float, step: Step) -> None:
    """Shorten a swing leg whose foot still carries a force F (N), as after a push to its side.

    With g(phase) a trapezoid:

        length -= 0.05 m sat((F - 30 N) / 100 N) g(phase).
    """
    load = swing_foot_load(force)
    # Trapezoid over the phase: from 0.1 on, full from 0.2 to 0.5, and 0 again from 0.7 on.
    window = min(1.0, max(0.0, 10.0 * (phase - 0.1))) * min(1.0, max(0.0, 5.0 * (0.7 - phase)))
    step.desired[LENGTH_SW] -= _MAX_SHORTENING * load * window


@compiled
def _extend_late_swing_leg(gain: Gains, timing: StepTiming, step: Step) -> None:
    """Extend the swing leg while touchdown is later than planned; all other rates are 0.

    length += min(late_reach, late_speed (phase - 1) / rate).
    """
    for i in range(9):
        step.desired_rates[i] = step.accelerations[i] = 0.0
    extension = gain.late_speed * (timing.phase - 1.0) / timing.rate
    step.desired[LENGTH_SW] += min(gain.late_reach, extension)
    if extension < gain.late_reach:
        step.desired_rates[LENGTH_SW] = gain.late_speed
