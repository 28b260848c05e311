"""Walking by virtual constraints, a gait library and leg-angle adjustment."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from cassie_control.config import WalkConfig
from cassie_control.control.drives import drive, figures
from cassie_control.control.load import Payload
from cassie_control.control.outputs import (
    FOOT_SW,
    LENGTH_ST,
    LENGTH_SW,
    STEP_TYPE,
    YAW_ST,
    YAW_SW,
    desire,
    measure,
)
from cassie_control.control.robot import Readings, RecordArray
from cassie_control.planner.footstep import placement
from cassie_control.planner.hold import PositionHold
from cassie_control.planner.plan import Commanded, Placement, StepAhead
from cassie_control.planner.terrain import GroundSlope
from cassie_control.planner.timing import LEFT, StepTiming
from cassie_gaits import robot
from cassie_gaits.gait_grid import read_row
from cassie_gaits.gait_library import GaitLibrary
from cassie_msgs.layout import Gait, GaitResult, Mode, MotorCommand, RobotState

FloatArray = npt.NDArray[np.float64]

_LEAD = 0.5  # rad that a turning command runs ahead of the robot at most


class WalkingController:
    """The nine outputs of eq:h0, driven to a gait from the library.

    Desired outputs are Bezier polynomials in phase, interpolated over the filtered sagittal
    velocity and, in a library that has them, the mean velocity to the side of the last two steps
    and the commanded turning rate. Their first two coefficients are reset at each touchdown so that
    position and velocity continue. Swing leg pitch, roll and length get what leg-angle adjustment
    (`planner.footstep`) asks for, faded in over the step; hip yaws turn towards the heading.

    Beside the paper, and left out under its own law: the swing leg's angles go the way of least
    effort between their ends, torques accelerate it (`control.drives`), and the stance leg's length
    lets the hip travel level (`control.outputs`), which takes the bounce out of fast walking, or
    along the slope that the feet find (`planner.terrain`). While no velocity is commanded,
    `planner.hold` leads back to the place.

    At a touchdown the legs' lengths go on from those desired, not from those measured: the knees
    press by the difference. The weight is fed forward to both legs in proportion to their forces.

    Actuated joints follow eq:IK and eq:hdtilde (`control.drives`). Torso roll and pitch act
    through the stance hip, in proportion to the load on the stance leg: the drive's own loop then
    damps it at 2 kHz. The stance toe gives no torque. `planner.timing` says when a step ends.

    A gait that is made while the robot walks (`offer`) moves the whole library by its difference to
    the library's gait of the same speeds, from a touchdown on. So the gait still follows the
    measured velocity. The slope of its swing foot stays this controller's own.

    Attributes:
        timing: Phase, stance leg and velocities.
        payload: What the feet carry beyond the robot's own mass.
        outputs, rates: As last measured. Shape (9,), in rad, m, rad/s and m/s.
        desired, desired_rates: The same, desired.

    Args:
        config: Gains.
        library: Gaits.
        period: Of control. In s.

    Source:
        Sections "Virtual Constraints" to "Gait Library and Stabilization by Leg Angle Adjustment".
    """

    def __init__(self, config: WalkConfig, library: GaitLibrary, period: float) -> None:
        self._period = period
        self.library = library
        self._gaits, self._speeds = library.table, library.speed_range
        self.timing = StepTiming(config, library.interpolate(0.0)[2], period)
        self.outputs = np.zeros(9)
        self.rates = np.zeros(9)
        self._step: RecordArray = np.zeros(1, STEP_TYPE)
        step = self._step[0]
        self.desired: FloatArray = step["desired"]
        self.desired_rates: FloatArray = step["desired_rates"]
        self._start: FloatArray = step["start"]
        self._start_rates: FloatArray = step["start_rates"]
        self._commanded = Commanded()
        self._ahead = StepAhead()
        self._hold = PositionHold(period)
        self._slope = GroundSlope(period)
        self.payload = Payload()
        self._offered, self._is_offered = Gait(), False
        self._moved = np.zeros_like(library.table[2])
        self._change = np.zeros(self._moved.shape[1])
        self._heading = 0.0
        self._sideways = 0.0
        self._latency = 0.0
        self._placement: Placement = placement(config)
        self.config = config
        self.configure(config)
        self._practise()

    def configure(self, config: WalkConfig) -> None:
        """Take over new gains; walking goes on, with the sums it has unless the law changes."""
        if config.as_in_paper != self.config.as_in_paper:
            self._placement = placement(config)
        self.timing.configure(config)
        self.config = config
        self.allow_for(self._latency)

    def allow_for(self, latency: float) -> None:
        """Take over how late the drives act on commands, beyond their own delay. In s."""
        self._latency = latency
        self._placement.config = self.config.late.placement(self.config, latency)
        self._figures = figures(self.config, self._period, latency)

    def _practise(self) -> None:
        """Walk for one tick: the first calls load the compiled functions, or make them.

        The robot must not wait for that when it begins to walk.
        """
        state, readings = RobotState(), Readings()
        state.q[2] = state.com_position[2] = 0.9
        state.q[6:] = (0.0, 0.0, 0.5, -1.2, 0.0, robot.NEUTRAL_TARSUS + 1.2, -1.6) * 2
        readings.update(state)
        self.start(readings, LEFT)
        self.step(readings, Mode(), MotorCommand())
        self.start(readings, LEFT)

    @property
    def gait_speed(self) -> float:
        """Speed at which the library is read. In m/s."""
        low, high = self._speeds
        return max(low, min(high, self.timing.velocity[0]))

    def start(self, readings: Readings, stance: int) -> None:
        """Begin with a step on a stance leg."""
        self.timing.start(stance)
        self._heading = readings.yaw
        self._sideways = 0.0
        self._hold.release()
        self._slope.reset()
        self.payload.reset()
        self._gaits, self._is_offered = self.library.table, False
        self._step["tracked"] = 0.0
        self._placement.reset()
        self._begin_step(readings)

    def step(
        self, readings: Readings, mode: Mode, command: MotorCommand, spread: float = 0.0
    ) -> bool:
        """Fill in the set-points; the feet land `spread` (m) farther out than usual.

        Returns:
            Whether a step ended at this tick.
        """
        timing, commanded = self.timing, self._commanded
        _, vx, vy, yaw_rate, _, _, _, roll, pitch, *trims = mode.floats.tolist()
        commanded.vx, commanded.vy = vx, vy
        if vx == vy == yaw_rate == 0.0:
            commanded.vx, commanded.vy = self._hold.velocity(self.config, readings)
        else:
            self._hold.release()
        commanded.spread = spread
        commanded.pitch_trim, commanded.roll_trim = trims[0], trims[1]
        self._turn(readings.yaw, yaw_rate)
        ended = timing.advance(readings)
        if ended:
            mean_velocity = timing.end_step()
            self._sideways = mean_velocity[1]
            self._placement.touchdown(mean_velocity, timing.velocity, commanded)
            if self._is_offered:
                self._take_up()
            self._begin_step(readings)
        self.payload.step(readings.legs[0].force + readings.legs[1].force, ended)
        self._find_slope(readings, ended)
        self._look_ahead(readings, yaw_rate)
        self._adjust(readings, roll + trims[3], pitch + trims[2], command)
        return ended

    @property
    def slope(self) -> float:
        """Rise of the ground ahead, as the feet find it. In rad."""
        return math.atan(self._slope.ahead)

    def offer(self, gait: Gait) -> None:
        """Walk on a gait from the next touchdown on; on the library if it was not found."""
        self._offered.copy_from(gait)
        self._is_offered = True

    def _take_up(self) -> None:
        """Move the library to the gait that was offered."""
        gait, change = self._offered, self._change
        self._is_offered = False
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
        np.add(rows, change, out=self._moved)
        self._gaits = axes, lengths, self._moved

    def _turn(self, yaw: float, yaw_rate: float) -> None:
        """Turn the heading to follow; it waits where the robot does not come along."""
        lead = self._heading - yaw
        if abs(lead) < _LEAD or lead * yaw_rate < 0.0:
            self._heading += yaw_rate * self._period

    def _find_slope(self, readings: Readings, touchdown: bool) -> None:
        """Follow the ground's slope; the paper's law takes it for level."""
        if self.config.as_in_paper:
            return
        stance, swing = readings.legs[self.timing.stance], readings.legs[1 - self.timing.stance]
        if touchdown:
            self._slope.touchdown(self.config, stance, swing)
        self._slope.stand(self.config, readings, stance, self.timing.phase)

    def measure(self, readings: Readings) -> None:
        """Bring `outputs` and `rates` up to date; nothing else needs them every tick."""
        stance, swing = readings.legs[self.timing.stance], readings.legs[1 - self.timing.stance]
        measure(readings, stance, swing, self.outputs, self.rates)

    def _begin_step(self, readings: Readings) -> None:
        """Outputs of the new step start where the legs are, eq. of continuity."""
        self.measure(readings)
        self._start[:] = self.outputs
        if not self.config.as_in_paper and self.timing.steps > 0:
            # Knees hold the weight by what lacks to the length they aim at: it must not jump.
            self._start[LENGTH_ST] = self.desired[LENGTH_SW]
            self._start[LENGTH_SW] = self.desired[LENGTH_ST]
        self._start_rates[:] = self.rates
        # Measured rates jump at the impact: what the motors hold goes on from rest.
        self._start_rates[[YAW_ST, LENGTH_ST, YAW_SW, LENGTH_SW, FOOT_SW]] = 0.0

    def _look_ahead(self, readings: Readings, yaw_rate: float) -> None:
        """Desired outputs at this phase as the gait has them, and the rest of the step."""
        timing, ahead = self.timing, self._ahead
        timing.step_time, ahead.yaw, rise, ahead.pitch, ahead.roll, ahead.length = desire(
            self._figures,
            readings.records,
            *self._gaits,
            self.gait_speed,
            self._sideways,
            yaw_rate,
            self._step,
            timing.stance,
            timing.phase,
            timing.rate,
            self._heading,
        )
        left = max(0.0, 1.0 - timing.phase)
        ahead.elapsed, ahead.step_time = timing.elapsed, timing.step_time
        ahead.remaining = left * timing.step_time
        ahead.earliest = left * self.config.quickest_step
        ahead.velocity = timing.velocity
        ahead.rise = rise - self._slope.sunk
        ahead.slope = self._slope.ahead, self._slope.left

    def _adjust(self, readings: Readings, roll: float, pitch: float, command: MotorCommand) -> None:
        """Leg-angle adjustment and turning, faded in over the step, with the torso at an angle."""
        timing, ahead = self.timing, self._ahead
        stance, swing = readings.legs[timing.stance], readings.legs[1 - timing.stance]
        end = self._placement.swing_end(readings, stance, swing, self._commanded, ahead)
        timing.plan(end.remaining)
        drive(
            self._figures,
            readings.records,
            readings.pair,
            self._step,
            command.record,
            timing.rate,
            end.pitch,
            end.roll,
            end.length,
            end.lead,
            timing.velocity[0],
            roll,
            pitch,
            ahead.slope[0],
            ahead.slope[1],
        )
