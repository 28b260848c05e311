"""Stepping in place without drift, by the estimated position."""

from __future__ import annotations

import math

from cassie_control.config import WalkConfig
from cassie_control.control.robot import Readings

_SETTLING = 1.2  # s without a commanded velocity until the position is held
_MEAN = 0.8  # s, end of that time: the position is averaged over it, about two steps of sway


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
        self._still = 0.0
        self._ticks = 0
        self._sum = self._place = (0.0, 0.0)

    def velocity(self, config: WalkConfig, readings: Readings) -> tuple[float, float]:
        """Velocity to walk with while none is commanded: forward and to the left, in m/s."""
        self._still += self._period
        x, y, _, yaw = readings.state.q[:4].tolist()
        if self._still < _SETTLING:
            if self._still >= _SETTLING - _MEAN:
                self._sum = (self._sum[0] + x, self._sum[1] + y)
                self._ticks += 1
                self._place = (self._sum[0] / self._ticks, self._sum[1] / self._ticks)
            return 0.0, 0.0
        east, north = self._place[0] - x, self._place[1] - y
        far = max(1.0, math.hypot(east, north) / config.hold_distance)
        east, north = east / far, north / far
        self._place = (x + east, y + north)
        c, s, gain = math.cos(yaw), math.sin(yaw), config.hold_gain
        return gain * (c * east + s * north), gain * (c * north - s * east)
