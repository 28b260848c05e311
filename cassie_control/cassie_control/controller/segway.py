"""Riding a Segway: the operator, or Cassie herself, leans to go, to stop and to turn."""

from __future__ import annotations

import math

from cassie_control.controller.config import SegwayConfig
from cassie_control.controller.level import Level
from cassie_control.controller.moving_balance import MovingBalance
from cassie_control.controller.readings import LegReadings, Readings
from cassie_control.controller.standing import StandingController
from cassie_gaits import virtual_leg
from cassie_msgs.layout import Mode, MotorCommand

_GOES = 0.3  # m/s^2
_TILT_TIME = 0.3  # s, low-pass of the platform's tilt


class RidingController:
    """Standing in a crouch on what may drive off.

    The body is held as in standing, with gains of its own and with `MovingBalance`. On top:

        c_x* = com_x,  c_y* = com_y               while the operator leans (com_x or com_y not 0),
        c_x* = kp_speed (vx - v)                   while he does not: Cassie holds vx, and brakes
        c_y* = kp_yaw_rate (yaw_rate - r)          if that is 0, by what she herself feels,

    with v the sum of the ground's acceleration since riding began and r the yaw rate. v drifts, as
    nothing measures the speed of a vehicle: told to stop, she takes `rest_speed` for rest. c_x*
    keeps the feet's pressure, c_x* - h a / g, within `press_limit`, and gives way where the
    platform tilts against it: that is how a Segway says that it will go no faster.

    Args:
        config: Gains.
        period: Of control. In s.

    Source:
        Section "Riding a Segway": speed by CoM x, direction by CoM y against the bar, gains of the
        feet turned down.
    """

    def __init__(self, config: SegwayConfig, period: float) -> None:
        self._period = period
        self._balance = MovingBalance(config, period)
        self._stand = StandingController(config, period, self._balance)
        self._mode = Mode()
        self._level = Level(period)
        self._readings = Readings()
        self._tilt = 0.0

    @property
    def config(self) -> SegwayConfig:
        """Gains; new ones hold from the next step."""
        return self._balance.config

    @config.setter
    def config(self, config: SegwayConfig) -> None:
        self._stand.config = config

    @property
    def speed(self) -> float:
        """Forward, as Cassie estimates it. In m/s."""
        return self._balance.speed

    def start(self, readings: Readings) -> None:
        """Begin at rest, from the present pose."""
        self._stand.start(readings)
        self._level.start(readings.state)
        self._tilt = 0.0

    def step(self, readings: Readings, mode: Mode, command: MotorCommand) -> None:
        """Fill in the set-points.

        Args:
            readings: The robot now.
            mode: Set-points for vx, yaw_rate, height, CoM shift, roll and pitch.
            command: Result.
        """
        state = self._level.corrected(
            readings.state, self.config.level_time, self._balance.acceleration
        )
        readings = self._readings
        readings.update(state)
        wanted = self._mode
        wanted.copy_from(mode)
        if float(mode.com_x) == 0.0 == float(mode.com_y):
            self._hold(readings, mode, wanted)
        wanted.com_x[...] = self._bounded(readings, float(wanted.com_x))
        left = self._balance.rest(readings)[1]
        limit = self.config.press_limit_y
        wanted.com_y[...] = max(left - limit, min(left + limit, float(wanted.com_y)))
        self._stand.step(readings, wanted, command, 0.0)

    def _hold(self, readings: Readings, mode: Mode, wanted: Mode) -> None:
        """Lean so as to keep the commanded speed and yaw rate."""
        c, balance = self.config, self._balance
        vx, yaw_rate = float(mode.vx), float(mode.yaw_rate)
        if vx == 0.0 and abs(balance.speed) < c.rest_speed:
            balance.speed *= math.exp(-self._period / c.rest_time)
        wanted.com_x[...] = c.kp_speed * (vx - balance.speed)
        if vx != 0.0 or yaw_rate != 0.0:
            wanted.com_y[...] = c.kp_yaw_rate * (yaw_rate - readings.yaw_rate)

    def _bounded(self, readings: Readings, com_x: float) -> float:
        """Where the CoM may be without pressing too far out, or against the platform's tilt."""
        c = self.config
        tilt = 0.5 * sum(sole_tilt(leg, readings.pitch) for leg in readings.legs)
        self._tilt += self._period / _TILT_TIME * (tilt - self._tilt)
        against = min(0.0, math.copysign(1.0, com_x) * self._tilt + c.tilt_margin)
        com_x += math.copysign(1.0, com_x) * c.tilt_gain * against
        rest = self._balance.rest(readings)[0]
        # Ground that goes along with the lean is a vehicle, and needs more of it.
        along = self._balance.acceleration[0] / _GOES
        ahead = c.press_limit + c.press_more * max(0.0, min(1.0, along))
        back = c.press_limit + c.press_more * max(0.0, min(1.0, -along))
        return max(rest - back, min(rest + ahead, com_x))


def sole_tilt(leg: LegReadings, torso_pitch: float) -> float:
    """How far the sole of a leg is pitched forward, toe down. In rad."""
    _, _, hip_pitch, knee, shin, tarsus, toe = leg.joints
    return -virtual_leg.foot_pitch(torso_pitch, hip_pitch, toe, knee + shin + tarsus)
