"""Walking by virtual constraints, a gait library and leg-angle adjustment."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from cassie_control.config import WalkConfig
from cassie_control.control.drives import set_drives
from cassie_control.control.gains import Gains, make_gains
from cassie_control.control.outputs import FOOT_SW, Step, begin_step, evaluate_gait, fade, measure
from cassie_control.control.robot import Readings, Robot
from cassie_control.planner.footstep import make_placement
from cassie_control.planner.hold import PositionHold
from cassie_control.planner.placement import Commanded, GaitStep, Placement
from cassie_control.planner.terrain import (
    GroundSlope,
    initialize_slope,
    step_up_height,
    update_at_touchdown,
    update_in_stance,
)
from cassie_control.planner.timing import LEFT, StepTiming, advance, end_step
from cassie_gaits import robot
from cassie_gaits.compiled import compiled
from cassie_gaits.gait_grid import read_row
from cassie_gaits.gait_library import GaitLibrary
from cassie_gaits.records import FloatArray, RecordArray, Records
from cassie_msgs.layout import Gait, GaitResult, Mode, MotorCommand, RobotState

IntArray = npt.NDArray[np.int64]

_MAX_HEADING_LEAD = 0.5  # rad, saturation of the desired heading's lead over the robot's


@compiled
def advance_step(
    robots: Records[Robot],
    timings: Records[StepTiming],
    yaw_rate: float,
    steps: Records[Step],
) -> bool:
    """Advance the desired heading and the step's phase by one tick; True if the step ended.

    Args:
        robots: The robot now. Shape (1,).
        timings, steps: Changed in place. Shape (1,).
        yaw_rate: Commanded yaw rate. In rad/s.
    """
    step, timing = steps[0], timings[0]
    # The desired heading waits where the robot does not follow.
    lead = step.heading - robots[0].yaw
    if abs(lead) < _MAX_HEADING_LEAD or lead * yaw_rate < 0.0:
        step.heading += yaw_rate * timing.period
    return advance(timings, robots)


@compiled
def plan_step(
    gains: Records[Gains],
    robots: Records[Robot],
    modes: RecordArray,
    timings: Records[StepTiming],
    axes: FloatArray,
    lengths: IntArray,
    rows: FloatArray,
    slopes: Records[GroundSlope],
    steps: Records[Step],
    gait_steps: Records[GaitStep],
) -> None:
    """Desired outputs at this phase by the gait, and the inputs of leg-angle adjustment.

    Args:
        gains, robots: Constants of the law and the robot now. Shape (1,).
        modes: `Mode.record`. Shape (1,).
        timings, slopes, steps: Changed in place. Shape (1,).
        axes, lengths, rows: `GaitLibrary.table`.
        gait_steps: Result, inputs of leg-angle adjustment. Shape (1,).
    """
    timing, step, slope, gait_step = timings[0], steps[0], slopes[0], gait_steps[0]
    update_in_stance(slopes, robots, timing.stance, timing.phase)
    step.clearance = gains[0].clearance + step_up_height(slope)
    evaluate_gait(gains, robots, timings, axes, lengths, rows, modes[0].yaw_rate, steps)
    remaining = max(0.0, 1.0 - timing.phase)
    gait_step.elapsed, gait_step.step_time = timing.elapsed, timing.step_time
    gait_step.remaining = remaining * timing.step_time
    gait_step.earliest = remaining * gains[0].quickest_step
    gait_step.velocity[0], gait_step.velocity[1] = timing.velocity[0], timing.velocity[1]
    gait_step.landing_pitch = step.gait_landing_pitch
    gait_step.landing_roll = step.gait_landing_roll
    gait_step.landing_length = step.gait_landing_length
    gait_step.landing_yaw = step.landing_yaw
    # Part of the foothold's height that the hip has already compensated.
    compensated = fade(min(1.0, timing.phase)) * slope.foothold_height
    gait_step.hip_rise = step.stance_extension - slope.sinkage + compensated
    gait_step.slope[0], gait_step.slope[1] = slope.ahead, slope.left


class WalkingController:
    """The nine outputs of eq:h0, driven to a gait from the library.

    Desired outputs are Bezier polynomials in phase, interpolated over the filtered sagittal
    velocity. A library may also have axes for the mean sideways velocity of the last two steps and
    the commanded turning rate. The first two coefficients are reset at each touchdown so that
    position and velocity continue. Leg-angle adjustment (`planner.footstep`) changes pitch, roll
    and length of the swing leg, smoothly over the step; hip yaws turn towards the heading.

    Three additions to the paper are left out under its own law. The swing leg's angles have the
    least squared acceleration between their ends. Torques accelerate the swing leg
    (`control.drives`). The stance leg's length lets the hip travel level (`control.outputs`), which
    removes the bounce of fast walking, or along the estimated slope (`planner.terrain`). While no
    velocity is commanded, `planner.hold` leads back to the place.

    At a touchdown the desired leg lengths continue from the last desired ones, not from those
    measured: the knees press by the difference. The weight is fed forward to both legs in
    proportion to their forces.

    Actuated joints follow eq:IK and eq:hdtilde (`control.drives`). Torso roll and pitch act
    through the stance hip, in proportion to the load on the stance leg: the drive's own loop then
    damps the torso at 2 kHz. The stance toe gives no torque. `planner.timing` says when a step
    ends.

    A gait that is made while the robot walks (`offer`) shifts the whole library from a touchdown
    on. The shift is the gait's difference to the library's gait of the same speeds. So the gait
    still depends on the measured velocity. The slope of the swing foot is this controller's own.

    Attributes:
        timing: Phase, stance leg and velocities.
        outputs, rates: Outputs and their rates as last measured. Shape (9,), in rad, m, rad/s and
            m/s.
        desired, desired_rates: Desired outputs and their rates. Shape (9,), in rad, m, rad/s and
            m/s.

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
        self._shifted_rows = np.zeros_like(library.table[2])
        self._row_shift = np.zeros(self._shifted_rows.shape[1])
        self._step = step = Step()
        self.outputs: FloatArray = step.measured
        self.rates: FloatArray = step.measured_rates
        self.desired: FloatArray = step.desired
        self.desired_rates: FloatArray = step.desired_rates
        self._commanded = Commanded()
        self._gait_step = GaitStep()
        self._latency = 0.0
        self._placement: Placement = make_placement(config)
        self.config = config
        self.configure(config)
        self._compile_kernels()

    def configure(self, config: WalkConfig) -> None:
        """Use new gains; walking goes on, and so does the observer unless the law changes."""
        if config.as_in_paper != self.config.as_in_paper:
            self._placement = make_placement(config)
        for part in (self.timing, self._slope):
            part.configure(config)
        self.config = config
        self.set_latency(self._latency)

    def set_latency(self, latency: float) -> None:
        """Use gains for a latency of the drives beyond their own delay. In s."""
        self._latency = latency
        self._placement.config = self.config
        self._gains = make_gains(self.config, self._period, latency)

    def _compile_kernels(self) -> None:
        """Walk for one tick, so that compiled functions are loaded or compiled.

        The robot must not wait for that when it begins to walk.
        """
        state, readings = RobotState(), Readings()
        state.q[2] = state.com_position[2] = 0.9
        state.q[6:] = (0.0, 0.0, 0.5, -1.2, 0.0, robot.NEUTRAL_TARSUS + 1.2, -1.6) * 2
        readings.update(state)
        self.start(readings, LEFT)
        self.step(readings, Mode(), MotorCommand())
        self._end_step(readings)
        self.start(readings, LEFT)

    @property
    def step_record(self) -> Records[Step]:
        """The present step, for compiled functions. Shape (1,)."""
        records: Records[Step] = self._step.records
        return records

    @property
    def gait_speed(self) -> float:
        """Speed at which the library is read. In m/s."""
        low, high = self._speeds
        return max(low, min(high, float(self.timing.velocity[0])))

    def start(self, readings: Readings, stance: int) -> None:
        """Begin walking with a step on a stance leg."""
        self.timing.start(stance)
        self._position_hold.release()
        self._slope.start()
        initialize_slope(self._slope.records, readings.records)
        self._gaits, self._gait_is_offered = self.library.table, False
        self._step.heading, self._step.mean_vy, self._step.thigh_tracking = readings.yaw, 0.0, 0.0
        self._placement.reset()
        begin_step(readings.records, stance, False, self._step.records)

    def step(
        self, readings: Readings, mode: Mode, command: MotorCommand, spread: float = 0.0
    ) -> bool:
        """Fill in the set-points; the feet land `spread` (m) farther out than usual.

        Returns:
            Whether a step ended at this tick.
        """
        commanded, timing = self._commanded, self.timing.records
        _, vx, vy, yaw_rate = mode.floats[:4].tolist()
        if vx == vy == yaw_rate == 0.0:
            vx, vy = self._position_hold.velocity(self.config, readings)
        else:
            self._position_hold.release()
        commanded.vx, commanded.vy, commanded.turn_rate = vx, vy, yaw_rate
        ended = advance_step(readings.records, timing, yaw_rate, self._step.records)
        commanded.spread = spread
        commanded.pitch_trim, commanded.roll_trim = mode.trims[:2].tolist()
        if ended:
            self._end_step(readings)
        plan_step(
            self._gains.records,
            readings.records,
            mode.record,
            timing,
            *self._gaits,
            self._slope.records,
            self._step.records,
            self._gait_step.records,
        )
        self._adjust(readings, mode, command)
        return ended

    def _end_step(self, readings: Readings) -> None:
        """Exchange stance and swing leg after a touchdown."""
        timing, step = self.timing, self._step
        mean_velocity = end_step(timing.records)
        step.mean_vy = mean_velocity[1]
        self._placement.touchdown(mean_velocity, tuple(timing.velocity.tolist()), self._commanded)
        keeps_lengths = not self.config.as_in_paper
        if self._gait_is_offered:
            self._shift_library()
        begin_step(readings.records, timing.stance, keeps_lengths, step.records)
        update_at_touchdown(self._slope.records, readings.records, timing.stance)

    @property
    def slope(self) -> float:
        """Estimated slope of the ground ahead, positive for a rise. In rad."""
        return math.atan(float(self._slope.ahead))

    def offer(self, gait: Gait) -> None:
        """Use a gait from the next touchdown on; the library alone if no gait was found."""
        self._offered_gait.copy_from(gait)
        self._gait_is_offered = True

    def _shift_library(self) -> None:
        """Shift the library to the gait that was offered."""
        gait, change = self._offered_gait, self._row_shift
        self._gait_is_offered = False
        axes, lengths, rows = self.library.table
        if int(gait.result) != GaitResult.FOUND:
            self._gaits = self.library.table
            return
        vx, vy, yaw_rate = gait.floats[:3].tolist()
        read_row(axes, lengths, rows, vx, vy, yaw_rate, change)
        np.negative(change, out=change)
        change[:54] += gait.right_stance
        change[54:108] += gait.left_stance
        change[108] += 1.0 / float(gait.step_time)
        for stance in (change[:54], change[54:108]):
            stance.reshape(9, 6)[FOOT_SW] -= float(gait.slope)
        np.add(rows, change, out=self._shifted_rows)
        self._gaits = axes, lengths, self._shifted_rows

    def measure(self, readings: Readings) -> None:
        """Update `outputs` and `rates`; the law itself does not need them every tick."""
        measure(readings.records, self.timing.stance, self._step.records)

    def _adjust(self, readings: Readings, mode: Mode, command: MotorCommand) -> None:
        """Fill in the set-points, with leg-angle adjustment, turning and the torso's angles."""
        stance, legs = self.timing.stance, readings.legs
        target = self._placement.swing_target(
            readings, legs[stance], legs[1 - stance], self._commanded, self._gait_step
        )
        set_drives(
            self._gains.records,
            readings.records,
            readings.pair,
            self.timing.records,
            self._slope.records,
            mode.record,
            self._step.records,
            command.record,
            target.pitch,
            target.roll,
            target.length,
            target.remaining,
            target.contact_lead,
        )
