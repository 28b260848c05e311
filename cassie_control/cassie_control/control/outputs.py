"""The nine outputs of eq:h0: how they are measured, and how they are desired during a step.

`STEP_TYPE` is the record of a step, which compiled functions share. `walking` has the reasoning.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from cassie_control.control.robot import LegReadings, Readings, RecordArray
from cassie_gaits import virtual_leg
from cassie_gaits.compiled import compiled
from cassie_gaits.gait_grid import read_row

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

ROLL, YAW_ST, PITCH, LENGTH_ST, ROLL_SW, YAW_SW, PITCH_SW, LENGTH_SW, FOOT_SW = range(9)
"""Rows of eq:h0; `cassie_gaits.gait_library.OUTPUTS` names them."""


def measure(
    readings: Readings,
    stance: LegReadings,
    swing: LegReadings,
    outputs: FloatArray,
    rates: FloatArray,
) -> None:
    """Outputs h_0 and their rates.

    Args:
        readings: The robot now.
        stance, swing: Its legs.
        outputs: Result. Shape (9,), in rad and m.
        rates: Result, their time derivatives. Shape (9,), in rad/s and m/s.

    Source:
        eq:h0 and eq:AbsoluteQuantities (README of cassie_gaits, Errata).
    """
    st, sw, st_rate, sw_rate = stance.joints, swing.joints, stance.rates, swing.rates
    outputs[:] = (
        readings.roll,
        st[1],
        readings.pitch,
        virtual_leg.length(st[3]),
        virtual_leg.roll(readings.roll, sw[0]),
        sw[1],
        virtual_leg.pitch(readings.pitch, sw[2], sw[3]),
        virtual_leg.length(sw[3]),
        virtual_leg.foot_pitch(readings.pitch, sw[2], sw[6]),
    )
    rates[:] = (
        readings.roll_rate,
        st_rate[1],
        readings.pitch_rate,
        virtual_leg.length_rate(st[3], st_rate[3]),
        readings.roll_rate + sw_rate[0],
        sw_rate[1],
        virtual_leg.pitch_rate(sw[3], readings.pitch_rate, sw_rate[2], sw_rate[3]),
        virtual_leg.length_rate(sw[3], sw_rate[3]),
        -readings.pitch_rate + sw_rate[2] + sw_rate[6],
    )


STEP_TYPE = np.dtype(
    [
        # Before leg-angle adjustment:
        ("stance", float),  # number of the leg
        ("phase", float),
        ("rate", float),  # of the phase, 1/s
        ("step_time", float),  # s
        ("heading", float),  # to follow, rad
        ("yaw_rate", float),  # commanded, rad/s
        # What adjustment is asked with:
        ("yaw", float),  # swing hip yaw at touchdown, rad
        ("turn", float),  # half of the turn of this step, rad
        ("rise", float),  # how much the gait's stance leg still grows, m
        ("gait_pitch", float),  # the gait's swing leg at touchdown, rad, rad, m
        ("gait_roll", float),
        ("gait_length", float),
        # What it answers, and the torso wanted:
        ("new_rate", float),  # of the phase, 1/s
        ("pitch", float),  # swing leg at touchdown, rad, rad, m
        ("roll", float),
        ("length", float),
        ("lead", float),  # s, by which the foot touches down before the step's end
        ("speed", float),  # low-passed, forward, m/s
        ("torso_roll", float),  # rad
        ("torso_pitch", float),
        ("slope_ahead", float),  # rise of the ground over distance
        ("slope_left", float),
        # Outputs of eq:h0, rad and m, in the order of `outputs`:
        ("start", float, 9),  # where this step began
        ("start_rates", float, 9),  # per s
        ("gait", float, (9, 6)),  # Bezier coefficients of this step
        ("desired", float, 9),
        ("desired_rates", float, 9),  # per s
        ("accelerations", float, 9),  # desired, per s^2
        # Of each leg, hip roll and pitch less the torso's, see `track_thighs`:
        ("tracked", float),  # 1 once the tracks have begun
        ("thigh", float, (2, 2)),  # rad
        ("thigh_rates", float, (2, 2)),  # rad/s
    ]
)
"""A step of walking."""


_LONGEST = 0.95  # m, of a stance leg that travels level
_LIFT = 0.05  # m, by which a swing leg is drawn up whose foot is pressed down,
_LIFTED, _LIFTING = 30.0, 100.0  # beginning at this force, until as much beyond it. In N


@compiled
def desire(
    figures: RecordArray,
    robots: RecordArray,
    axes: FloatArray,
    lengths: IntArray,
    rows: FloatArray,
    speed: float,
    sideways: float,
    yaw_rate: float,
    steps: RecordArray,
    stance: int,
    phase: float,
    rate: float,
    heading: float,
) -> tuple[float, float, float, float, float, float]:
    """Desired outputs as the gait has them, and what leg-angle adjustment is to know.

    Args:
        figures: Constants of the law, `drives.FIGURES_TYPE`. Shape (1,).
        robots: The robot now.
        axes, lengths, rows: `GaitLibrary.table`.
        speed, sideways: At which the gait is read. In m/s.
        yaw_rate: The same, as commanded. In rad/s.
        steps: The step; changed in place.
        stance: Number of the leg.
        phase, rate: Of the step, and in 1/s.
        heading: To follow. In rad.

    Returns:
        The gait's step time (s), and of the step: `yaw`, `rise`, `gait_pitch`, `gait_roll` and
        `gait_length`.
    """
    figure, robot, step = figures[0], robots[0], steps[0]
    row = np.empty(rows.shape[1])
    read_row(axes, lengths, rows, speed, sideways, yaw_rate, row)
    step.stance, step.phase, step.rate, step.step_time = stance, phase, rate, 1.0 / row[-1]
    step.heading, step.yaw_rate = heading, yaw_rate
    gait = step.gait
    # The row has the gait in right stance, then that in left stance.
    _begin(figure, row[54 * (1 - stance) : 54 * (2 - stance)].reshape(9, 6), step)
    basis = np.empty((6, 3))
    _basis(min(1.0, step.phase), basis)
    for i in range(9):
        value = rate = acceleration = 0.0
        for k in range(6):
            value += gait[i, k] * basis[k, 0]
            rate += gait[i, k] * basis[k, 1]
            acceleration += gait[i, k] * basis[k, 2]
        step.desired[i] = value
        step.desired_rates[i] = rate * step.rate
        step.accelerations[i] = acceleration * step.rate**2
    step.turn = 0.5 * step.yaw_rate * step.step_time
    yaw = step.turn + figure.heading_gain * (step.heading - robot.yaw)
    step.yaw = max(-figure.yaw_limit, min(figure.yaw_limit, yaw))
    step.rise = gait[LENGTH_ST, 5] - step.desired[LENGTH_ST]
    step.gait_pitch, step.gait_roll = gait[PITCH_SW, 5], gait[ROLL_SW, 5]
    step.gait_length = gait[LENGTH_SW, 5]
    return step.step_time, step.yaw, step.rise, step.gait_pitch, step.gait_roll, step.gait_length


@compiled
def _begin(figure: Any, library_gait: FloatArray, step: Any) -> None:
    """The gait, begun where the legs were at touchdown; the torso's own is continuous."""
    gait = step.gait
    for i in range(9):
        for k in range(6):
            gait[i, k] = library_gait[i, k]
        if i not in (ROLL, PITCH):
            gait[i, 0] = step.start[i]
            gait[i, 1] = step.start[i] + step.start_rates[i] * (step.step_time / 5.0)
    if figure.straight > 0.0:
        for i in (ROLL_SW, PITCH_SW):
            for k in range(2):
                a, b = figure.least_effort[k, 0], figure.least_effort[k, 1]
                c, d = figure.least_effort[k, 2], figure.least_effort[k, 3]
                gait[i, 2 + k] = a * gait[i, 0] + b * gait[i, 1] + c * gait[i, 4] + d * gait[i, 5]


@compiled
def adjust(figure: Any, robot: Any, step: Any) -> None:
    """Leg-angle adjustment and turning, faded in over the step; `desire` comes before.

    Args:
        figure: Constants of the law, of `drives.FIGURES_TYPE`.
        robot: The robot now.
        step: The step, with what adjustment answered; changed in place.
    """
    gait, rate = step.gait, step.new_rate
    phase = min(1.0, step.phase)
    landing_pitch, landing_roll = gait[PITCH_SW, 5], gait[ROLL_SW, 5]
    if step.lead > 0.0:
        basis = np.empty((6, 3))
        _basis(1.0 - step.lead * rate, basis)
        landing_pitch = landing_roll = 0.0
        for k in range(6):
            landing_pitch += gait[PITCH_SW, k] * basis[k, 0]
            landing_roll += gait[ROLL_SW, k] * basis[k, 0]
    _level_hips(figure, robot, step, phase)
    _fade_in(step, PITCH_SW, step.pitch - landing_pitch, phase, rate)
    _fade_in(step, ROLL_SW, step.roll - landing_roll, phase, rate)
    _fade_in(step, LENGTH_SW, step.length - gait[LENGTH_SW, 5], phase, rate)
    _fade_in(step, YAW_SW, step.yaw - gait[YAW_SW, 5], phase, rate)
    _fade_in(step, FOOT_SW, math.atan(step.slope_ahead), phase, rate)
    _turn_body(step, phase, rate)
    _lift(robot, step, phase)
    if step.phase > 1.0:
        _reach_down(figure, step, rate)
    step.desired[ROLL] += step.torso_roll
    step.desired[PITCH] += step.torso_pitch


@compiled
def _fade_in(step: Any, row: int, change: float, phase: float, rate: float) -> None:
    r = 1.0 - phase
    step.desired[row] += _fade(phase) * change
    step.desired_rates[row] += rate * (20.0 * r * r * r * phase) * change
    step.accelerations[row] += 20.0 * r * r * (r - 3.0 * phase) * rate**2 * change


@compiled
def _turn_body(step: Any, phase: float, rate: float) -> None:
    """Stance hip yaw from where the foot landed to the end of this step's turn.

    The commanded turn goes at an even rate, so that the foot need not accelerate the body, for
    which a line of contact has little friction: only what the foot landed beside it is faded out.
    """
    r = 1.0 - phase
    _fade_in(step, YAW_ST, -step.gait[YAW_ST, 5], phase, rate)
    step.desired[YAW_ST] += step.turn * (_fade(phase) - 2.0 * phase)
    step.desired_rates[YAW_ST] += step.turn * rate * (20.0 * r * r * r * phase - 2.0)
    step.accelerations[YAW_ST] += step.turn * rate**2 * 20.0 * r * r * (r - 3.0 * phase)


@compiled
def _level_hips(figure: Any, robot: Any, step: Any, phase: float) -> None:
    """Let the stance leg grow and shrink so that its hip travels level, as far as wanted.

    On a slope the hip travels along it, at the height it has where the CoM is above the foot.
    """
    back = max(0.0, min(1.0, -3.0 * step.speed))
    share = figure.level * _fade(phase)
    share *= 1.0 + back * (figure.level_back - 1.0)
    height = step.gait[LENGTH_SW, 5] * math.cos(step.gait[PITCH_SW, 5])
    x = robot.tilt[0, 0] * figure.hip_x + robot.tilt[0, 2] * figure.hip_z
    i = int(step.stance)
    x -= robot.ankle[i, 0]
    height += step.slope_ahead * x + step.slope_left * (robot.com[1] - robot.ankle[i, 1])
    length = min(_LONGEST, math.hypot(height, x))
    step.desired[LENGTH_ST] += share * (length - step.desired[LENGTH_ST])
    rate = (x + step.slope_ahead * height) * robot.velocity[0] / length
    step.desired_rates[LENGTH_ST] += share * (rate - step.desired_rates[LENGTH_ST])


@compiled
def _lift(robot: Any, step: Any, phase: float) -> None:
    """Draw up a swing leg whose foot is still pressed down, as where a push leans on it."""
    pressed = min(1.0, max(0.0, (robot.force[1 - int(step.stance)] - _LIFTED) / _LIFTING))
    due = min(1.0, max(0.0, 10.0 * (phase - 0.1))) * min(1.0, max(0.0, 5.0 * (0.7 - phase)))
    step.desired[LENGTH_SW] -= _LIFT * pressed * due


@compiled
def _reach_down(figure: Any, step: Any, rate: float) -> None:
    """The ground is later than planned: the swing leg grows until it finds it."""
    for i in range(9):
        step.desired_rates[i] = step.accelerations[i] = 0.0
    grown = figure.late_speed * (step.phase - 1.0) / rate
    step.desired[LENGTH_SW] += min(figure.late_reach, grown)
    if grown < figure.late_reach:
        step.desired_rates[LENGTH_SW] = figure.late_speed


@compiled
def _fade(phase: float) -> float:
    """See `bezier.fade`; a phase in [0, 1]."""
    r = 1.0 - phase
    value: float = 1.0 - r * r * r * r * (5.0 - 4.0 * r)
    return value


@compiled
def _basis(phase: float, out: FloatArray) -> None:
    """See `bezier.basis`. Shape (6, 3)."""
    s, r = phase, 1.0 - phase
    b0, b1, b2, b3, b4 = (
        r * r * r * r,
        4.0 * r * r * r * s,
        6.0 * r * r * s * s,
        4.0 * r * s * s * s,
        s * s * s * s,
    )
    c0, c1, c2, c3 = r * r * r, 3.0 * r * r * s, 3.0 * r * s * s, s * s * s
    out[0, 0], out[0, 1], out[0, 2] = b0 * r, -5.0 * b0, 20.0 * c0
    out[1, 0], out[1, 1], out[1, 2] = 5.0 * b0 * s, 5.0 * (b0 - b1), 20.0 * (c1 - 2.0 * c0)
    out[2, 0], out[2, 1] = 10.0 * c0 * s * s, 5.0 * (b1 - b2)
    out[2, 2] = 20.0 * (c2 - 2.0 * c1 + c0)
    out[3, 0], out[3, 1] = 10.0 * r * r * c3, 5.0 * (b2 - b3)
    out[3, 2] = 20.0 * (c3 - 2.0 * c2 + c1)
    out[4, 0], out[4, 1], out[4, 2] = 5.0 * r * b4, 5.0 * (b3 - b4), 20.0 * (c2 - 2.0 * c3)
    out[5, 0], out[5, 1], out[5, 2] = b4 * s, 5.0 * b4, 20.0 * c3
