"""How the ground rises, as the feet find it while walking."""

from __future__ import annotations

import math

from cassie_control.config import WalkConfig
from cassie_control.control.robot import LegReadings, Readings
from cassie_gaits import virtual_leg

_SETTLED = 0.25  # phase from which the stance foot lies flat
_STEEPEST = 0.6  # of a slope that is believed
_RATE_TIME = 0.03  # s, low-pass of the stance foot's pitch rate
_TURNS = (0.4, 0.8)  # rad/s of it up to which the foot rests, and turns for certain
_TURNED_UP = (0.02, 0.04)  # rad since it settled, up to which the ground holds, or gives way
_STEPS_UP = 3  # steps up in a row; on uneven ground there is one that is not among as many
_EVEN, _DEEPEST = 0.01, 0.08  # m of steps up that are none, and the most that is believed


class GroundSlope:
    """Slope of the ground, ahead and to the left, from the stance foot and from touchdowns.

    The stance toe gives no torque, so that its sole lies on the ground: its pitch is the slope
    ahead. To the side it follows from the heights at which both feet stand at a touchdown,

        (z_new - z_old - slope_x (x_new - x_old)) / (y_new - y_old).

    Both are low-passed and bounded: the first over time of standing on a foot, the second over
    steps, and by as much less as the feet are close to each other.

    Ahead, a fall is believed within `slope_time` and a rise within `slope_rise_time`. On uneven
    ground single footholds tilt by 0.1 to 0.2 either way. A foot that expects the ground too low
    lands early, which costs a little speed; one that expects it too high lands late, and the robot
    falls ahead meanwhile: two such steps took it from 0.4 to 1.2 m/s. So the estimate leans to the
    low side where footholds differ, and is exact where they agree.

    A foot whose heel sinks into sand turns up for as long as it is loaded, by 0.05 to 0.3 rad (on
    hard ground by 0.003, on grass by 0.015), fast at first and then ever slower. While a foot turns
    fast its pitch is no slope, nor once it has turned up: what it shows as it slows down, 0.5, was
    taken for a rise of 0.2, and it ran away. Instead a rise that was believed fades then, which
    errs to the low side, too.

    Each new foot then lands higher than the one that has sunk meanwhile, by `sunk`: the least of
    the last three numerators above. Taken for level, that ground met the swing foot early and short
    of where it had to be, and it ran away forward. Their mean would be a rise on uneven ground,
    too, where it threw two robots of four.

    Attributes:
        ahead, left: Rise over distance, heading frame.
        sunk: By how much the stance foot sinks until the next one lands. In m.

    Args:
        period: Of control. In s.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self.reset()

    def reset(self) -> None:
        """Level ground that holds."""
        self.ahead = self.left = self.sunk = 0.0
        self._pitch = self._rate = self._settled = 0.0
        self._steps_up = (0.0,) * _STEPS_UP

    def stand(
        self, config: WalkConfig, readings: Readings, stance: LegReadings, phase: float
    ) -> None:
        """Take in one tick on a stance leg."""
        if config.slope_time <= 0.0:
            return
        q = stance.joints
        pitch = virtual_leg.foot_pitch(readings.pitch, q[2], q[6], q[3] + q[4] + q[5])
        rate, self._pitch = (pitch - self._pitch) / self._period, pitch
        self._rate += self._period / _RATE_TIME * (rate - self._rate)
        if phase < _SETTLED:
            self._settled = pitch
        if stance.load < 1.0 or phase < _SETTLED:
            return
        seen = max(-_STEEPEST, min(_STEEPEST, math.tan(pitch)))
        seen += _share(pitch - self._settled, _TURNED_UP) * (min(0.0, self.ahead) - seen)
        time = config.slope_rise_time if seen > self.ahead else config.slope_time
        rests = 1.0 - _share(abs(self._rate), _TURNS)
        self.ahead += rests * self._period / time * (seen - self.ahead)

    def touchdown(self, config: WalkConfig, new: LegReadings, old: LegReadings) -> None:
        """Take in a touchdown, with both feet on the ground."""
        if config.slope_time <= 0.0:
            return
        x, y, z = (a - b for a, b in zip(new.ankle, old.ankle, strict=True))
        error = z - self.ahead * x - self.left * y
        self.left += config.slope_share * error * y / (y * y + 0.01)
        self.left = max(-_STEEPEST, min(_STEEPEST, self.left))
        self._steps_up = (*self._steps_up[1:], error)
        self.sunk = max(0.0, min(_DEEPEST, min(self._steps_up) - _EVEN))


def _share(value: float, between: tuple[float, float]) -> float:
    """Of the way between two bounds: 0 below, 1 above."""
    low, high = between
    return max(0.0, min(1.0, (value - low) / (high - low)))
