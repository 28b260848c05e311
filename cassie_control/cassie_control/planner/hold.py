"""Stepping in place without wandering off, by the robot's own estimate of its position."""

from __future__ import annotations

import math

from cassie_control.config import WalkConfig
from cassie_control.control.robot import Readings

_SETTLING = 1.2  # s without a commanded velocity until a place is kept
_MEAN = 0.8  # s before that over which the place is the mean: about two steps, as the body sways


class PositionHold:
    """A velocity that leads back to the place where walking was last stopped.

    Once no velocity has been commanded for a while, the pelvis's estimated position, in the mean of
    two steps, is kept: velocity = hold_gain * (place - position), at most hold_speed. The estimate
    itself drifts by a few per cent of the distance walked, which nothing here can see.

    Args:
        period: Of control. In s.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self.release()

    def release(self) -> None:
        """Forget the place."""
        self._still = 0.0
        self._ticks = 0
        self._sum = (0.0, 0.0)

    def velocity(self, config: WalkConfig, readings: Readings) -> tuple[float, float]:
        """Velocity to walk with while none is commanded: forward and to the left, in m/s."""
        self._still += self._period
        x, y, _, yaw = readings.state.q[:4].tolist()
        if self._still < _SETTLING:
            if self._still >= _SETTLING - _MEAN:
                self._sum = (self._sum[0] + x, self._sum[1] + y)
                self._ticks += 1
            return 0.0, 0.0
        if config.hold_gain <= 0.0:
            return 0.0, 0.0
        east, north = self._sum[0] / self._ticks - x, self._sum[1] / self._ticks - y
        c, s = math.cos(yaw), math.sin(yaw)
        vx, vy = (
            config.hold_gain * (c * east + s * north),
            config.hold_gain * (c * north - s * east),
        )
        scale = config.hold_speed / max(config.hold_speed, math.hypot(vx, vy), 1e-9)
        return scale * vx, scale * vy
