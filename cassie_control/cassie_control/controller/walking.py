"""Walking by virtual constraints, a gait library and leg-angle adjustment."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from cassie_control.controller.config import WalkConfig
from cassie_control.controller.foot_placement import placement
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
    measure,
)
from cassie_control.controller.position_hold import PositionHold
from cassie_control.controller.readings import HIP_X, HIP_Z, LegReadings, Readings
from cassie_control.controller.step_ahead import Placement, StepAhead, Wish
from cassie_control.controller.step_timing import LEFT, StepTiming
from cassie_control.controller.swing_inertia import swing_torques
from cassie_control.controller.walking_drives import drive_stance, drive_swing
from cassie_gaits import bezier, virtual_leg
from cassie_gaits.gait_library import GaitLibrary
from cassie_msgs.layout import Mode, MotorCommand

FloatArray = npt.NDArray[np.float64]

_LEAD = 0.5  # rad that a turning command runs ahead of the robot at most


def _least_effort() -> FloatArray:
    """From a polynomial's first and last two coefficients to the two between. Shape (2, 4).

    They give the least integral of the squared second derivative.
    """
    bends = np.array([bezier.basis(phase)[:, 2] for phase in np.linspace(0.0, 1.0, 41)])
    ends = bends[:, (0, 1, 4, 5)]
    result: FloatArray = -np.linalg.lstsq(bends[:, 2:4], ends, rcond=None)[0]
    return result


_LEAST_EFFORT = _least_effort()


class WalkingController:
    """The nine outputs of eq:h0, driven to a gait from the library.

    Desired outputs are Bezier polynomials in phase, interpolated over the filtered sagittal
    velocity and, in a library that has them, the mean velocity to the side of the last two steps
    and the commanded turning rate. Their first two coefficients are reset at each touchdown so that
    position and velocity continue. Swing leg pitch, roll and length get what leg-angle adjustment
    (`foot_placement`) asks for, faded in over the step; hip yaws turn towards the heading.

    Beside the paper, and left out under its own law: the swing leg's angles go the way of least
    effort between their ends, torques accelerate it (`swing_inertia`), and the stance leg's length
    lets the hip travel level (`level`), which takes the bounce out of fast walking. While no
    velocity is commanded, `position_hold` leads back to the place.

    Actuated joints follow eq:IK and eq:hdtilde (`walking_drives`). Torso roll and pitch act
    through the stance hip, in proportion to the load on the stance leg: the drive's own loop then
    damps it at 2 kHz. The stance toe gives no torque. The weight is fed forward to both legs as
    they carry it. `step_timing` says when a step ends.

    Attributes:
        timing: Phase, stance leg and velocities.
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
        self.timing = StepTiming(config, library.interpolate(0.0)[2], period)
        self.outputs = np.zeros(9)
        self.rates = np.zeros(9)
        self.desired = np.zeros(9)
        self.desired_rates = np.zeros(9)
        self._accelerations = np.zeros(9)
        self._buffer = np.zeros((2, 9, 6))
        self._start = np.zeros(9)
        self._start_rates = np.zeros(9)
        self._wish = Wish()
        self._ahead = StepAhead()
        self._hold = PositionHold(period)
        self._heading = 0.0
        self._sideways = 0.0
        self._placement: Placement = placement(config)
        self.config = config
        self.configure(config)

    def configure(self, config: WalkConfig) -> None:
        """Take over new gains; walking goes on, with the sums it has unless the law changes."""
        if config.law != self.config.law:
            self._placement = placement(config)
        self._placement.config = config
        self.timing.configure(config)
        self.config = config
        own = config.law != "paper"
        self._straight = own
        self._level = config.level if own else 0.0
        self._inertia = config.swing_inertia if own else 0.0

    @property
    def gait_speed(self) -> float:
        """Speed at which the library is read. In m/s."""
        low, high = self.library.speed_range
        return max(low, min(high, self.timing.velocity[0]))

    def start(self, readings: Readings, stance: int) -> None:
        """Begin with a step on a stance leg."""
        self.timing.start(stance)
        self._heading = readings.yaw
        self._sideways = 0.0
        self._hold.release()
        self._placement.reset()
        self._begin_step(readings)

    def step(
        self, readings: Readings, mode: Mode, command: MotorCommand, spread: float = 0.0
    ) -> bool:
        """Fill in the set-points; the feet land `spread` (m) farther out than usual.

        Returns:
            Whether a step ended at this tick.
        """
        timing, wish = self.timing, self._wish
        wish.vx, wish.vy = float(mode.vx), float(mode.vy)
        if wish.vx == wish.vy == float(mode.yaw_rate) == 0.0:
            wish.vx, wish.vy = self._hold.velocity(self.config, readings)
        else:
            self._hold.release()
        wish.spread = spread
        wish.pitch_trim, wish.roll_trim = float(mode.trims[0]), float(mode.trims[1])
        self._turn(readings.yaw, float(mode.yaw_rate))
        ended = timing.advance(readings)
        if ended:
            mean_velocity = timing.end_step()
            self._sideways = mean_velocity[1]
            self._placement.touchdown(mean_velocity, timing.velocity, wish)
            self._begin_step(readings)
        self._desire(readings, mode)
        stance, swing = readings.legs[timing.stance], readings.legs[1 - timing.stance]
        desired, rates = self.desired.tolist(), self.desired_rates.tolist()
        at, to = 5 * timing.stance, 5 * (1 - timing.stance)
        drive_stance(self.config, readings, stance, desired, rates, command, at)
        drive_swing(self.config, readings, swing, desired, rates, command, to)
        self._push_swing(stance, swing, command, to)
        return ended

    def _turn(self, yaw: float, yaw_rate: float) -> None:
        """Turn the heading to follow; it waits where the robot does not come along."""
        lead = self._heading - yaw
        if abs(lead) < _LEAD or lead * yaw_rate < 0.0:
            self._heading += yaw_rate * self._period

    def measure(self, readings: Readings) -> None:
        """Bring `outputs` and `rates` up to date; nothing else needs them every tick."""
        stance, swing = readings.legs[self.timing.stance], readings.legs[1 - self.timing.stance]
        measure(readings, stance, swing, self.outputs, self.rates)

    def _begin_step(self, readings: Readings) -> None:
        """Outputs of the new step start where the legs are, eq. of continuity."""
        self.measure(readings)
        self._start[:] = self.outputs
        self._start_rates[:] = self.rates
        # Measured rates jump at the impact: what the motors hold goes on from rest.
        self._start_rates[[YAW_ST, LENGTH_ST, YAW_SW, LENGTH_SW, FOOT_SW]] = 0.0

    def _desire(self, readings: Readings, mode: Mode) -> None:
        """Desired outputs, rates and accelerations at this phase."""
        timing = self.timing
        right, left, step_time = self.library.interpolate(
            self.gait_speed, self._buffer, self._sideways, float(mode.yaw_rate)
        )
        timing.step_time = step_time
        gait = left if timing.stance == LEFT else right
        torso = gait[ROLL : PITCH + 1 : 2, :2].copy()  # the gait's own is continuous
        gait[:, 0] = self._start
        gait[:, 1] = self._start + self._start_rates * (step_time / bezier.DEGREE)
        gait[ROLL : PITCH + 1 : 2, :2] = torso
        if self._straight:
            for row in (ROLL_SW, PITCH_SW):
                gait[row, 2:4] = _LEAST_EFFORT @ gait[row, (0, 1, 4, 5)]
        phase = min(1.0, timing.phase)
        values = gait @ bezier.basis(phase)
        self.desired[:] = values[:, 0]
        np.multiply(values[:, 1], timing.rate, out=self.desired_rates)
        np.multiply(values[:, 2], timing.rate**2, out=self._accelerations)
        self._adjust(readings, mode, gait, phase)
        if timing.phase > 1.0:
            self.desired_rates[:] = 0.0
            self._accelerations[:] = 0.0
            self._reach_down()
        self.desired[ROLL] += float(mode.roll) + float(mode.trims[3])
        self.desired[PITCH] += float(mode.pitch) + float(mode.trims[2])

    def _reach_down(self) -> None:
        """The ground is later than planned: the swing leg grows until it finds it."""
        late = (self.timing.phase - 1.0) / self.timing.rate
        grown = self.config.late_speed * late
        self.desired[LENGTH_SW] += min(self.config.late_reach, grown)
        if grown < self.config.late_reach:
            self.desired_rates[LENGTH_SW] = self.config.late_speed

    def _adjust(self, readings: Readings, mode: Mode, gait: FloatArray, phase: float) -> None:
        """Leg-angle adjustment and turning, faded in over the step."""
        gait_end = gait[:, -1].tolist()
        c, timing, ahead = self.config, self.timing, self._ahead
        stance, swing = readings.legs[timing.stance], readings.legs[1 - timing.stance]
        turn = 0.5 * float(mode.yaw_rate) * timing.step_time
        error = self._heading - readings.yaw
        yaw = max(-c.yaw_limit, min(c.yaw_limit, turn + c.heading_gain * error))
        left = max(0.0, 1.0 - timing.phase)
        ahead.elapsed, ahead.step_time = timing.elapsed, timing.step_time
        ahead.remaining = left * timing.step_time
        ahead.earliest = left * c.quickest_step
        ahead.velocity = timing.velocity
        ahead.pitch, ahead.roll = gait_end[PITCH_SW], gait_end[ROLL_SW]
        ahead.length, ahead.yaw = gait_end[LENGTH_SW], yaw
        ahead.rise = gait_end[LENGTH_ST] - float(self.desired[LENGTH_ST])
        end = self._placement.swing_end(readings, stance, swing, self._wish, ahead)
        timing.plan(end.remaining)
        landing = gait_end
        if end.lead > 0.0:
            landing = (gait @ bezier.basis(1.0 - end.lead * timing.rate)[:, 0]).tolist()
        self._level_hips(readings, stance, gait_end, phase)
        fade, rate = bezier.fade(phase), timing.rate * bezier.fade_derivative(phase)
        r = 1.0 - phase
        acceleration = 20.0 * r * r * (r - 3.0 * phase) * timing.rate**2
        for row, change in (
            (PITCH_SW, end.pitch - landing[PITCH_SW]),
            (ROLL_SW, end.roll - landing[ROLL_SW]),
            (LENGTH_SW, end.length - gait_end[LENGTH_SW]),
            (YAW_SW, yaw - gait_end[YAW_SW]),
            (YAW_ST, -turn - gait_end[YAW_ST]),
        ):
            self.desired[row] += fade * change
            self.desired_rates[row] += rate * change
            self._accelerations[row] += acceleration * change

    def _level_hips(
        self, readings: Readings, stance: LegReadings, gait_end: list[float], phase: float
    ) -> None:
        """Let the stance leg grow and shrink so that its hip travels level, as far as wanted."""
        back = max(0.0, min(1.0, -3.0 * self.timing.velocity[0]))
        share = self._level * bezier.fade(phase)
        share *= 1.0 + back * (self.config.level_back - 1.0)
        height = gait_end[LENGTH_SW] * math.cos(gait_end[PITCH_SW])
        x = readings.tilt[0, 0] * HIP_X + readings.tilt[0, 2] * HIP_Z - stance.ankle[0]
        length = min(0.95, math.hypot(height, x))
        self.desired[LENGTH_ST] += share * (length - self.desired[LENGTH_ST])
        rate = x * readings.velocity[0] / length
        self.desired_rates[LENGTH_ST] += share * (rate - self.desired_rates[LENGTH_ST])

    def _push_swing(
        self, stance: LegReadings, swing: LegReadings, command: MotorCommand, base: int
    ) -> None:
        """Add the torques that accelerate the swing leg, as far as it is off the ground.

        The stance hip takes what they do to the torso to the ground.
        """
        share = self._inertia * (1.0 - swing.load)
        length = virtual_leg.clamp_length(float(self.desired[LENGTH_SW]), 0.45, 0.95)
        rates, accelerations = self.desired_rates, self._accelerations
        roll, pitch, knee = swing_torques(
            (float(rates[ROLL_SW]), float(rates[PITCH_SW]), float(rates[LENGTH_SW])),
            (
                float(accelerations[ROLL_SW]),
                float(accelerations[PITCH_SW]),
                float(accelerations[LENGTH_SW]),
            ),
            length,
        )
        command.torque[base] += share * roll
        command.torque[base + 2] += share * pitch
        carried = share * stance.load
        command.torque[5 - base] -= carried * roll
        command.torque[7 - base] -= carried * pitch
        command.torque[base + 3] += share * knee
