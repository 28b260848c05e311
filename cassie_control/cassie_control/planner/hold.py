"""Stepping in place without drift, by the estimated position."""

from __future__ import annotations

import math

from cassie_control.config import WalkConfig
from cassie_control.control.robot import Readings

_HOLD_DELAY = 1.2  # s without a commanded velocity until the position is held
_AVERAGING_TIME = 0.8  # s, at the end of the delay: about two steps of sway


class PositionHold:
    """A velocity that leads back to the place where walking was last stopped.

    Once no velocity has been commanded for a while, the pelvis's estimated position, averaged over
    two steps, is held: velocity = hold_gain * (place - position). A push beyond `hold_distance`
    moves the place along, so that the robot does not walk back for long. The estimate drifts by a
    few per cent of the distance walked, which this law cannot observe.

    Args:
        period: Control period. In s.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self.release()

    def release(self) -> None:
        """Forget the place."""
        self._still_time = 0.0
        self._ticks = 0
        self._position_sum = self._place = (0.0, 0.0)

    def velocity(self, config: WalkConfig, readings: Readings) -> tuple[float, float]:
        """Velocity to walk with while none is commanded: forward and to the left, in m/s."""
        self._still_time += self._period
        x, y, _, yaw = readings.state.q[:4].tolist()
        if self._still_time < _HOLD_DELAY:
            if self._still_time >= _HOLD_DELAY - _AVERAGING_TIME:
                sum_x, sum_y = self._position_sum[0] + x, self._position_sum[1] + y
                self._position_sum = (sum_x, sum_y)
                self._ticks += 1
                self._place = (sum_x / self._ticks, sum_y / self._ticks)
            return 0.0, 0.0
        east, north = self._place[0] - x, self._place[1] - y
        scale = max(1.0, math.hypot(east, north) / config.hold_distance)
        east, north = east / scale, north / scale
        self._place = (x + east, y + north)
        c, s, gain = math.cos(yaw), math.sin(yaw), config.hold_gain
        return gain * (c * east + s * north), gain * (c * north - s * east)
