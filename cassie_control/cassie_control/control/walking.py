"""Walking by virtual constraints, a gait library and leg-angle adjustment."""

from __future__ import annotations

import math

import numpy as np

from cassie_control.config import WalkConfig
from cassie_control.control.drives import (
    add_swing_inertia,
    drive_stance,
    drive_swing,
    filter_hips,
)
from cassie_control.control.forces import carry_weight
from cassie_control.control.gains import Gains, make_gains
from cassie_control.control.outputs import (
    FOOT_SW,
    Step,
    adjust_outputs,
    begin_step,
    evaluate_gait,
    measure,
)
from cassie_control.control.robot import Readings, Robot, nominal_readings
from cassie_control.planner.footstep import PendulumPlacement
from cassie_control.planner.hold import PositionHold
from cassie_control.planner.momentum import Masses
from cassie_control.planner.paper import PaperGains, PaperPlacement, plan_landing_by_paper
from cassie_control.planner.pendulum import PlacementGains, plan_landing
from cassie_control.planner.placement import (
    LEG_PITCH_TRIM,
    LEG_ROLL_TRIM,
    Commanded,
    Placement,
)
from cassie_control.planner.terrain import (
    GroundSlope,
    initialize_slope,
    update_at_touchdown,
    update_in_stance,
)
from cassie_control.planner.timing import (
    LEFT,
    RIGHT,
    StepTiming,
    adapt_phase_rate,
    advance,
    end_step,
)
from cassie_gaits.compiled import compiled
from cassie_gaits.gait_grid import read_row
from cassie_gaits.gait_library import GaitLibrary, gait_in_stance
from cassie_gaits.leg import LegPair
from cassie_gaits.records import FloatArray, IntArray, RecordArray, Records
from cassie_msgs.layout import Gait, GaitResult, Mode, MotorCommand
from cassie_msgs.schedule import GAIT_TICKS

_MAX_HEADING_LEAD = 0.5  # rad, saturation of the desired heading's lead over the robot's
_KEPT_SHIFT = 0.5  # of the library's shift at each touchdown without a gait that was found
_NO_SHIFT = 1e-3  # largest change of a coefficient below which the library is not shifted


@compiled
def advance_step(
    robots: Records[Robot],
    modes: RecordArray,
    timings: Records[StepTiming],
    steps: Records[Step],
    all_commanded: Records[Commanded],
) -> bool:
    """Advance the desired heading and the step's phase by one tick; True if the step ended.

    Args:
        robots: The robot now. Shape (1,).
        modes: `Mode.record`. Shape (1,).
        timings, steps: Changed in place. Shape (1,).
        all_commanded: Result, the mode's commands for the steps. Shape (1,).
    """
    step, timing, mode, commanded = steps[0], timings[0], modes[0], all_commanded[0]
    commanded.vx, commanded.vy, commanded.yaw_rate = mode.vx, mode.vy, mode.yaw_rate
    commanded.pitch_trim = mode.trims[LEG_PITCH_TRIM]
    commanded.roll_trim = mode.trims[LEG_ROLL_TRIM]
    yaw_rate = mode.yaw_rate
    # The desired heading waits where the robot does not follow.
    lead = step.heading - robots[0].yaw
    if abs(lead) < _MAX_HEADING_LEAD or lead * yaw_rate < 0.0:
        step.heading += yaw_rate * timing.period
    return advance(timings, robots)


@compiled
def compute_set_points(
    gains: Records[Gains],
    robots: Records[Robot],
    pairs: Records[LegPair],
    modes: RecordArray,
    all_commanded: Records[Commanded],
    pendulums: Records[PlacementGains],
    papers: Records[PaperGains],
    all_masses: Records[Masses],
    axes: FloatArray,
    lengths: IntArray,
    rows: FloatArray,
    timings: Records[StepTiming],
    slopes: Records[GroundSlope],
    steps: Records[Step],
    commands: RecordArray,
) -> None:
    """Set-points of the drives at this tick, after `advance_step`: the whole law, in its order.

    1. `update_in_stance`: the ground's slope, by the sole of the stance foot.
    2. `evaluate_gait`: desired outputs and their rates, by the gait at this phase.
    3. `carry_weight`: torques with which both legs carry the weight. Where the drives act late,
       these need the phase's rate before 5 changes it.
    4. `plan_landing`, or `plan_landing_by_paper`: where and when the swing foot lands.
    5. `adapt_phase_rate`: the phase's rate, so that the step ends then.
    6. `adjust_outputs`: desired outputs with this landing, the turn and a level path of the hip.
       Rates of 2 are by the phase's rate before 5, those of 6 by the one after.
    7. `filter_hips`: hip angles of the torso's set-points, in part low-passed.
    8. `drive_stance`, `drive_swing`: positions, velocities and gains of the drives.
    9. `add_swing_inertia`: adds the torques that accelerate the swing leg.

    `TorqueLearning` then adds torques, and `limits.limit` bounds the command.

    Args:
        gains, robots: Constants of the law and the robot now. Shape (1,).
        pairs: Kinematics of both legs. Shape (1,).
        modes: `Mode.record`. Shape (1,).
        all_commanded: Commands for the steps. Shape (1,).
        pendulums, papers: Gains of leg-angle adjustment, of this project's law and of the paper's;
            `Gains.pendulum_placement` says which counts. Shape (1,).
        all_masses: Masses of the robot. Shape (1,).
        axes, lengths, rows: `GaitLibrary.table`.
        timings, slopes, steps: Changed in place. Shape (1,).
        commands: Result, `MotorCommand.record`. Shape (1,).
    """
    gain, robot, mode, command = gains[0], robots[0], modes[0], commands[0]
    timing, slope, step = timings[0], slopes[0], steps[0]
    stance, swing = timing.stance, 1 - timing.stance
    update_in_stance(slopes, robots, stance, timing.phase)
    evaluate_gait(
        gains, robots, timings, slopes, axes, lengths, rows, mode.vy, mode.yaw_rate, steps
    )
    carry_weight(gain, robot, pairs, timing, slope, command)
    if gain.pendulum_placement:
        target = plan_landing(pendulums, robots, all_masses, timings, slopes, steps, all_commanded)
    else:
        target = plan_landing_by_paper(papers, robots, timings, steps, all_commanded)
    adapt_phase_rate(timing, target.remaining)
    adjust_outputs(gain, robot, mode, timing, slope, target, step)
    filter_hips(gain, robot, step)
    drive_stance(gain, robot, stance, step, command)
    drive_swing(gain, robot, swing, step, command)
    add_swing_inertia(gain, robot, swing, step, command)


class WalkingController:
    """The nine outputs of eq:h0, driven to a gait from the library.

    Desired outputs are Bezier polynomials in phase, interpolated over the filtered sagittal
    velocity, up to `gait_speed`. A library may also have axes for the commanded velocity sideways
    and turning rate. The first two coefficients of the legs' outputs are those of the posture at
    touchdown; only roll and pitch of the swing leg go on at their rates. Leg-angle adjustment
    (`planner.footstep`) changes pitch, roll and length of the swing leg, smoothly over the step;
    hip yaws turn towards the heading.

    Of the additions to the paper, README, Walking, has the equation of each, and says which of them
    stay under the paper's own law (`law`: paper). `compute_set_points` has their order.

    Actuated joints follow eq:IK and eq:hdtilde (`control.drives`). Torso roll and pitch act
    through the stance hip, in proportion to the load on the stance leg: the drive's own loop then
    damps the torso at 2 kHz. The stance toe gives no torque. `planner.timing` says when a step
    ends.

    A gait that is made while the robot walks (`offer`) shifts the whole library from a touchdown
    on. The shift is the gait's difference to the library's gait of the same speeds. So the gait
    still depends on the measured velocity. The slope of the swing foot is this controller's own.
    Where no gait was found, or none has come for two requests, the shift fades from touchdown to
    touchdown: beyond the library's speeds it is large.

    Attributes:
        timing: Phase, stance leg and velocities.
        plan: The present step: outputs desired and, after `measure`, measured.

    Args:
        config: Gains.
        library: Gaits.
        period: Control period. In s.

    Source:
        Sections "Virtual Constraints" to "Gait Library and Stabilization by Leg Angle Adjustment".
    """

    def __init__(self, config: WalkConfig, library: GaitLibrary, period: float) -> None:
        self._period = period
        self.library = library
        self._gaits, self._speeds = library.table, library.speed_range
        self.timing = StepTiming(config, library.interpolate(0.0)[2], period)
        self._position_hold = PositionHold(period)
        self._slope = GroundSlope(config, period)
        self._offered_gait, self._gait_is_offered = Gait(), False
        self._ticks_without_offer = 0
        self._shifted_rows = np.zeros_like(library.table[2])
        self._row_shift = np.zeros(self._shifted_rows.shape[1])
        self._step_shifts = [gait_in_stance(self._row_shift, leg) for leg in (LEFT, RIGHT)]
        self.plan = Step()
        self._commanded = Commanded()
        self._delays = 0.0, 0.0
        self._pendulum, self._paper = PendulumPlacement(config), PaperPlacement(config)
        self.config = config
        self.configure(config)
        self._compile_kernels()

    def configure(self, config: WalkConfig) -> None:
        """Use new gains; walking goes on, and so does the observer unless the law changes."""
        if config.law != self.config.law:
            self._pendulum.reset()
            self._paper.reset()
        for part in (self.timing, self._slope):
            part.configure(config)
        self.config = self._pendulum.config = self._paper.config = config
        self.set_delays(*self._delays)

    def set_delays(self, latency: float, torque_delay: float) -> None:
        """Use gains for drives that act late.

        Args:
            latency: Latency of the drives beyond their own delay. In s.
            torque_delay: The part of it after the drives have computed their torques. In s.
        """
        self._delays = latency, torque_delay
        self._gains = make_gains(self.config, self._period, latency, torque_delay)

    @property
    def _placement(self) -> Placement:
        """The law of leg-angle adjustment that the configuration names."""
        return self._pendulum if self._gains.pendulum_placement else self._paper

    def _compile_kernels(self) -> None:
        """Walk for one tick, so that compiled functions are loaded or compiled.

        The robot must not wait for that when it begins to walk.
        """
        readings = nominal_readings()
        self.start(readings, LEFT)
        self.step(readings, Mode(), MotorCommand())
        self._end_step(readings)
        self.start(readings, LEFT)

    @property
    def library_speed(self) -> float:
        """Speed at which the library is read. In m/s."""
        return self.within_library(float(self.timing.velocity[0]))

    def within_library(self, speed: float) -> float:
        """The nearest speed ahead at which the library is read. In m/s."""
        low, high = self._speeds
        return max(low, min(high, self.config.gait_speed, speed))

    def start(self, readings: Readings, stance: int) -> None:
        """Begin walking with a step on a stance leg."""
        self.timing.start(stance)
        self._position_hold.release()
        self._slope.start()
        initialize_slope(self._slope.records, readings.records)
        self._gaits, self._gait_is_offered = self.library.table, False
        self._row_shift[:] = 0.0
        self.plan.heading, self.plan.thighs_filtered = readings.yaw, 0.0
        self._placement.reset()
        begin_step(readings.records, stance, False, self.plan.records)

    def join(self, readings: Readings) -> None:
        """Go on, after `start`, within the step of a robot that walks already."""
        vx, vy, _ = readings.velocity
        stance_foot = readings.legs[self.timing.stance].foot
        self.timing.join(float(readings.com[0] - stance_foot[0]), (vx, vy))

    def step(self, readings: Readings, mode: Mode, command: MotorCommand) -> bool:
        """Fill in the set-points.

        Args:
            readings: The robot now.
            mode: Commanded velocities, torso angles and trims.
            command: Result.

        Returns:
            Whether a step ended at this tick.
        """
        commanded, timings, steps = self._commanded, self.timing.records, self.plan.records
        self._ticks_without_offer += 1
        ended = advance_step(readings.records, mode.record, timings, steps, commanded.records)
        if commanded.vx == commanded.vy == commanded.yaw_rate == 0.0:
            hold = self._position_hold.velocity(self.config, readings)
            commanded.vx, commanded.vy = hold
        else:
            self._position_hold.release()
        if ended:
            self._end_step(readings)
        compute_set_points(
            self._gains.records,
            readings.records,
            readings.pair,
            mode.record,
            commanded.records,
            self._pendulum.gains.records,
            self._paper.gains.records,
            self._pendulum.masses,
            *self._gaits,
            timings,
            self._slope.records,
            steps,
            command.record,
        )
        return ended

    def _end_step(self, readings: Readings) -> None:
        """Exchange stance and swing leg after a touchdown."""
        timing, step = self.timing, self.plan
        mean_velocity = end_step(timing.records)
        self._placement.touchdown(mean_velocity, tuple(timing.velocity.tolist()), self._commanded)
        keeps_lengths = bool(self._gains.keeps_lengths)
        self._shift_library()
        begin_step(readings.records, timing.stance, keeps_lengths, step.records)
        update_at_touchdown(self._slope.records, readings.records, timing.stance)

    @property
    def slope(self) -> float:
        """Estimated slope of the ground ahead, positive for a rise. In rad."""
        return math.atan(float(self._slope.ahead))

    def offer(self, gait: Gait) -> None:
        """Use a gait from the next touchdown on; less of the last one if no gait was found."""
        self._offered_gait.copy_from(gait)
        self._gait_is_offered = True
        self._ticks_without_offer = 0

    def _shift_library(self) -> None:
        """Shift the library to the gait that was offered, or back where there is none."""
        gait, change = self._offered_gait, self._row_shift
        axes, lengths, rows = self.library.table
        offered, self._gait_is_offered = self._gait_is_offered, False
        found = int(gait.result) == GaitResult.FOUND
        if offered and found:
            vx, vy, yaw_rate = float(gait.vx), float(gait.vy), float(gait.yaw_rate)
            read_row(axes, lengths, rows, vx, vy, yaw_rate, change)
            np.negative(change, out=change)
            change[-1] += 1.0 / float(gait.step_time)
            steps = gait.left_stance, gait.right_stance
            for shift, coefficients in zip(self._step_shifts, steps, strict=True):
                shift += coefficients.reshape(shift.shape)
                shift[FOOT_SW] -= float(gait.slope)
        elif found and self._ticks_without_offer <= 2 * GAIT_TICKS:
            return
        elif np.abs(change).max() < _NO_SHIFT:
            self._gaits = self.library.table
            return
        else:
            change *= _KEPT_SHIFT
        np.add(rows, change, out=self._shifted_rows)
        self._gaits = axes, lengths, self._shifted_rows

    def measure(self, readings: Readings) -> None:
        """Measure the outputs in `plan`; the law itself does not need them every tick."""
        measure(readings.records, self.timing.stance, self.plan.records)
