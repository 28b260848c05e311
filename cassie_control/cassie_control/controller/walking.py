"""Walking by virtual constraints, a gait library and leg-angle adjustment."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from cassie_control.controller.config import WalkConfig
from cassie_control.controller.foot_placement import PaperPlacement, PendulumPlacement, Wish
from cassie_control.controller.readings import WEIGHT, LegReadings, Readings
from cassie_gaits import bezier, virtual_leg
from cassie_gaits.gait_library import GaitLibrary
from cassie_msgs.layout import Mode, MotorCommand

FloatArray = npt.NDArray[np.float64]

LEFT, RIGHT = 0, 1

_REACH = 0.06  # m that the swing leg grows at most when the ground is late
_REACH_SPEED = 0.3  # m/s

# Rows of eq:h0.
ROLL, YAW_ST, PITCH, LENGTH_ST, ROLL_SW, YAW_SW, PITCH_SW, LENGTH_SW, FOOT_SW = range(9)


class WalkingController:
    """The nine outputs of eq:h0, driven to a gait from the library.

    Desired outputs are Bezier polynomials in phase, interpolated over the filtered sagittal
    velocity, whose first two coefficients are reset at each touchdown so that position and
    velocity continue. Swing leg pitch and roll get what leg-angle adjustment
    (`foot_placement`) asks for, faded in over the step; hip yaws turn towards the heading.

    Actuated joints follow eq:IK and eq:hdtilde (README, Errata). Torso roll and pitch act through
    the stance hip, in proportion to the load on the stance leg, with q_hip + (desired - measured
    torso angle) as its set-point: the drive's own loop then damps it at 2 kHz. The stance toe
    gives no torque. The weight is fed forward to both legs as they carry it.

    A step ends when the swing foot carries `touchdown_force` after phase `earliest_touchdown`,
    or at phase `latest_touchdown`.

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
        self.stance = LEFT
        self.phase = 0.0
        self.steps = 0
        self.step_time = library.interpolate(0.0)[2]
        self.velocity = (0.0, 0.0)
        self.outputs = np.zeros(9)
        self.rates = np.zeros(9)
        self.desired = np.zeros(9)
        self.desired_rates = np.zeros(9)
        self._buffer = np.zeros((2, 9, 6))
        self._start = np.zeros(9)
        self._start_rates = np.zeros(9)
        self._wish = Wish()
        self._heading = 0.0
        self._travel = (0.0, 0.0)
        self._elapsed = 0.0
        self._means: list[tuple[float, float]] = []
        self.configure(config)

    def configure(self, config: WalkConfig) -> None:
        """Take over new gains; walking goes on."""
        self.config = config
        self._filter = 1.0 - math.exp(-2.0 * math.pi * config.speed_filter * self._period)
        self._placement: PendulumPlacement | PaperPlacement = (
            PaperPlacement(config) if config.law == "paper" else PendulumPlacement(config)
        )

    @property
    def gait_speed(self) -> float:
        """Speed at which the library is read. In m/s."""
        low, high = self.library.speed_range
        return max(low, min(high, self.velocity[0]))

    def start(self, readings: Readings, stance: int) -> None:
        """Begin with a step on a stance leg."""
        self.stance = stance
        self.steps = 0
        self.phase = 0.0
        self.velocity = (0.0, 0.0)
        self._heading = readings.yaw
        self._means.clear()
        self._placement.reset()
        self._begin_step(readings)

    def step(self, readings: Readings, mode: Mode, command: MotorCommand) -> bool:
        """Fill in the set-points.

        Returns:
            Whether a step ended at this tick.
        """
        self._wish.vx, self._wish.vy = float(mode.vx), float(mode.vy)
        self._heading += float(mode.yaw_rate) * self._period
        self._filter_velocity(readings)
        self.phase += self._period / self.step_time
        ended = self._ended(readings)
        if ended:
            self.stance = 1 - self.stance
            self.steps += 1
            self._end_step()
            self._begin_step(readings)
        self._desire(readings, mode)
        stance, swing = readings.legs[self.stance], readings.legs[1 - self.stance]
        self._measure(readings, stance, swing)
        self._drive_stance(readings, stance, command, mode)
        self._drive_swing(readings, swing, command)
        return ended

    def _filter_velocity(self, readings: Readings) -> None:
        vx, vy = self.velocity
        vx += self._filter * (readings.velocity[0] - vx)
        vy += self._filter * (readings.velocity[1] - vy)
        self.velocity = (vx, vy)
        self._travel = (
            self._travel[0] + self._period * readings.velocity[0],
            self._travel[1] + self._period * readings.velocity[1],
        )
        self._elapsed += self._period

    def _ended(self, readings: Readings) -> bool:
        c = self.config
        if self.phase >= c.latest_touchdown:
            return True
        swing = readings.legs[1 - self.stance]
        return self.phase >= c.earliest_touchdown and swing.force > c.touchdown_force

    def _end_step(self) -> None:
        self._means.append(
            (self._travel[0] / max(self._elapsed, 1e-6), self._travel[1] / max(self._elapsed, 1e-6))
        )
        del self._means[:-2]
        mean_x = sum(mean[0] for mean in self._means) / len(self._means)
        mean_y = sum(mean[1] for mean in self._means) / len(self._means)
        self._placement.touchdown((mean_x, mean_y), self._wish)

    def _begin_step(self, readings: Readings) -> None:
        """Outputs of the new step start where the old one left them, eq. of continuity."""
        self.phase = 0.0
        self._travel = (0.0, 0.0)
        self._elapsed = 0.0
        self._measure(readings, readings.legs[self.stance], readings.legs[1 - self.stance])
        self._start[:] = self.outputs
        self._start_rates[:] = self.rates
        # Measured rates jump at the impact: what the motors hold goes on from rest.
        self._start_rates[[YAW_ST, LENGTH_ST, YAW_SW, LENGTH_SW, FOOT_SW]] = 0.0

    def _desire(self, readings: Readings, mode: Mode) -> None:
        """Desired outputs and rates at this phase."""
        right, left, step_time = self.library.interpolate(self.gait_speed, self._buffer)
        self.step_time = step_time
        gait = left if self.stance == LEFT else right
        gait[:, 0] = self._start
        gait[:, 1] = self._start + self._start_rates * (step_time / bezier.DEGREE)
        phase = min(1.0, self.phase)
        values = gait @ bezier.basis(phase)
        self.desired[:] = values[:, 0]
        np.multiply(values[:, 1], 1.0 / step_time, out=self.desired_rates)
        if self.phase > 1.0:
            self.desired_rates[:] = 0.0
            self._reach_down()
        self._adjust(readings, mode, gait, phase, step_time)
        self.desired[ROLL] = float(mode.roll) + float(mode.trims[3])
        self.desired[PITCH] = float(mode.pitch) + float(mode.trims[2])
        self.desired_rates[ROLL] = self.desired_rates[PITCH] = 0.0

    def _reach_down(self) -> None:
        """The ground is later than planned: the swing leg grows until it finds it."""
        late = (self.phase - 1.0) * self.step_time
        self.desired[LENGTH_SW] += min(_REACH, _REACH_SPEED * late)
        self.desired_rates[LENGTH_SW] = _REACH_SPEED

    def _adjust(
        self, readings: Readings, mode: Mode, gait: FloatArray, phase: float, step_time: float
    ) -> None:
        c = self.config
        stance, swing = readings.legs[self.stance], readings.legs[1 - self.stance]
        if isinstance(self._placement, PaperPlacement):
            self._placement.velocity = self.velocity
            self._placement.gait_end = (float(gait[PITCH_SW, 5]), float(gait[ROLL_SW, 5]))
        end = self._placement.swing_end(
            readings,
            stance,
            swing,
            self._wish,
            self._elapsed,
            max(0.0, 1.0 - self.phase) * step_time,
            step_time,
            float(gait[LENGTH_SW, 5]),
        )
        fade, rate = bezier.fade(phase), bezier.fade_derivative(phase) / step_time
        turn = 0.5 * float(mode.yaw_rate) * step_time
        error = self._heading - readings.yaw
        yaw = max(-c.yaw_limit, min(c.yaw_limit, turn + c.heading_gain * error))
        for row, change in (
            (PITCH_SW, end.pitch + float(mode.trims[0]) - float(gait[PITCH_SW, 5])),
            (ROLL_SW, end.roll + float(mode.trims[1]) - float(gait[ROLL_SW, 5])),
            (YAW_SW, yaw - float(gait[YAW_SW, 5])),
            (YAW_ST, -turn - float(gait[YAW_ST, 5])),
        ):
            self.desired[row] += fade * change
            self.desired_rates[row] += rate * change

    def _measure(self, readings: Readings, stance: LegReadings, swing: LegReadings) -> None:
        """Outputs h_0 and their rates, eq:h0 and eq:AbsoluteQuantities."""
        st, sw, st_rate, sw_rate = stance.joints, swing.joints, stance.rates, swing.rates
        self.outputs[:] = (
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
        self.rates[:] = (
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

    def _drive_stance(
        self, readings: Readings, leg: LegReadings, command: MotorCommand, mode: Mode
    ) -> None:
        c, j = self.config, self.config.joints
        desired, rates = self.desired.tolist(), self.desired_rates.tolist()
        q, v = leg.joints, leg.rates
        base = 5 * self.stance
        load = leg.load
        length = virtual_leg.clamp_length(desired[LENGTH_ST], 0.4, 0.97)
        knee = virtual_leg.knee_angle(length)
        knee_rate = virtual_leg.knee_rate(knee, length, rates[LENGTH_ST])
        command.position[base : base + 5] = (
            q[0] - load * (desired[ROLL] - readings.roll),
            desired[YAW_ST],
            q[2] + load * (desired[PITCH] - readings.pitch),
            knee,
            q[6],
        )
        command.velocity[base : base + 5] = (
            v[0] + load * readings.roll_rate,
            rates[YAW_ST],
            v[2] - load * readings.pitch_rate,
            knee_rate,
            v[6],
        )
        # An unloaded stance leg keeps its joints in place until it carries the torso.
        command.kp[base : base + 5] = (
            c.kp_torso_roll,
            j.kp_hip_yaw,
            c.kp_torso_pitch,
            j.kp_knee,
            0.0,
        )
        command.kd[base : base + 5] = (
            c.kd_torso_roll,
            j.kd_hip_yaw,
            c.kd_torso_pitch,
            j.kd_knee,
            0.0,
        )
        self._feed_forward(readings, leg, command, base)
        if load < 1.0:
            command.velocity[base] *= load
            command.velocity[base + 2] *= load

    def _drive_swing(self, readings: Readings, leg: LegReadings, command: MotorCommand) -> None:
        j = self.config.joints
        desired, rates = self.desired.tolist(), self.desired_rates.tolist()
        base = 5 * (1 - self.stance)
        length = virtual_leg.clamp_length(desired[LENGTH_SW], 0.4, 0.97)
        knee = virtual_leg.knee_angle(length)
        knee_rate = virtual_leg.knee_rate(knee, length, rates[LENGTH_SW])
        hip_pitch = virtual_leg.hip_pitch_angle(desired[PITCH_SW], readings.pitch, length)
        hip_rate = virtual_leg.hip_pitch_rate(knee, rates[PITCH_SW], readings.pitch_rate, knee_rate)
        command.position[base : base + 5] = (
            desired[ROLL_SW] - readings.roll,
            desired[YAW_SW],
            hip_pitch,
            knee,
            virtual_leg.toe_angle(desired[FOOT_SW], readings.pitch, leg.joints[2]),
        )
        command.velocity[base : base + 5] = (
            rates[ROLL_SW] - readings.roll_rate,
            rates[YAW_SW],
            hip_rate,
            knee_rate,
            rates[FOOT_SW] + readings.pitch_rate - leg.rates[2],
        )
        free = 1.0 - leg.load
        command.kp[base : base + 5] = (
            j.kp_hip_roll,
            j.kp_hip_yaw,
            j.kp_hip_pitch,
            j.kp_knee,
            j.kp_toe * free,
        )
        command.kd[base : base + 5] = (
            j.kd_hip_roll,
            j.kd_hip_yaw,
            j.kd_hip_pitch,
            j.kd_knee,
            j.kd_toe * free,
        )
        self._feed_forward(readings, leg, command, base)

    def _feed_forward(
        self, readings: Readings, leg: LegReadings, command: MotorCommand, base: int
    ) -> None:
        """Torques that hold the leg's share of the weight, along the line from foot to CoM."""
        total = readings.legs[0].load + readings.legs[1].load
        share = leg.load / total if total > 1.0 else leg.load
        x = readings.com[0] - leg.ankle[0]
        y = readings.com[1] - leg.ankle[1]
        z = max(0.4, readings.com[2] - leg.ankle[2])
        force = self.config.gravity * WEIGHT * share
        held = leg.weight_torques(readings.tilt, force, x / z, y / z)
        command.torque[base : base + 5] = (*held, 0.0)
