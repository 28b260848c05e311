"""Stepping in place without wandering off, by the robot's own estimate of its position."""

from __future__ import annotations

import math

from cassie_control.config import WalkConfig
from cassie_control.control.robot import RecordArray, Robot
from cassie_gaits.compiled import compiled
from cassie_gaits.records import FloatArray, Record, Records, array

_SETTLING = 1.2  # s without a commanded velocity until a place is kept
_MEAN = 0.8  # s before that over which the place is the mean: about two steps, as the body sways


class PositionHold(Record):
    """A velocity that leads back to the place where walking was last stopped.

    Once no velocity has been commanded for a while, the pelvis's estimated position, in the mean of
    two steps, is kept: velocity = hold_gain * (place - position), at most hold_speed. The estimate
    itself drifts by a few per cent of the distance walked, which nothing here can see.

    Attributes:
        still: Time without a commanded velocity. In s.
        ticks: Positions in `sum`.
        sum: Of positions in the world, of which the place is the mean. In m.
        hold_gain, hold_speed: See `config.WalkConfig`.
        period: Of control. In s.
    """

    still: float
    ticks: float
    sum: FloatArray = array(2)
    hold_gain: float
    hold_speed: float
    period: float

    def __init__(self, config: WalkConfig, period: float) -> None:
        """Prepare for a control period in s."""
        super().__init__(period=period)
        self.configure(config)

    def configure(self, config: WalkConfig) -> None:
        """Take over new gains; the place stays."""
        self.hold_gain, self.hold_speed = config.hold_gain, config.hold_speed

    def start(self) -> None:
        """Forget the place."""
        release(self.records)


@compiled
def release(holds: Records[PositionHold]) -> None:
    """Forget the place."""
    hold = holds[0]
    hold.still = hold.ticks = hold.sum[0] = hold.sum[1] = 0.0


@compiled
def velocity_back(
    holds: Records[PositionHold], states: RecordArray, robots: Records[Robot]
) -> tuple[float, float]:
    """Velocity to walk with while none is commanded: forward and to the left, in m/s."""
    hold = holds[0]
    hold.still += hold.period
    x, y = states[0].q[0], states[0].q[1]
    if hold.still < _SETTLING:
        if hold.still >= _SETTLING - _MEAN:
            hold.sum[0] += x
            hold.sum[1] += y
            hold.ticks += 1.0
        return 0.0, 0.0
    if hold.hold_gain <= 0.0:
        return 0.0, 0.0
    east, north = hold.sum[0] / hold.ticks - x, hold.sum[1] / hold.ticks - y
    yaw = robots[0].yaw
    c, s = math.cos(yaw), math.sin(yaw)
    vx, vy = hold.hold_gain * (c * east + s * north), hold.hold_gain * (c * north - s * east)
    scale = hold.hold_speed / max(hold.hold_speed, math.hypot(vx, vy), 1e-9)
    return scale * vx, scale * vy
