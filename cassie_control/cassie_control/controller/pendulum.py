"""A walking pendulum of constant height: where it will be at touchdown, and when that should be.

Compiled; everything is in m, s and the heading frame, positions of the CoM from the stance toe
joint, u the swing foot's from the CoM at touchdown. `side` is 1 if the left leg swings, else -1.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from cassie_gaits.compiled import compiled

_TIMES = 9  # touchdown times that are compared
_LATENESS = 0.02  # m^2/s^2, what a change of the step's time costs against a foot out of reach


class Fall(NamedTuple):
    """A CoM that coasts for a moment, then falls away from the stance foot.

    Attributes:
        x, y, vx, vy: Now.
        rate: w = sqrt(g / height). In 1/s.
        coasting: Time that is left of coasting.
    """

    x: float
    y: float
    vx: float
    vy: float
    rate: float
    coasting: float


class Aim(NamedTuple):
    """Foot placement as a linear law of the velocity at touchdown.

    Attributes:
        ux, uy: Of the swing foot from the CoM in steady walking.
        vx, vy: Velocity at touchdown in steady walking.
        gain_forward, gain_backward, gain_y: Of the error of that velocity. In s.
    """

    ux: float
    uy: float
    vx: float
    vy: float
    gain_forward: float
    gain_backward: float
    gain_y: float


class Reach(NamedTuple):
    """Where the swing foot can be set down.

    Attributes:
        side: Of the swing leg.
        hip_x, hip_y: Swing hip from the CoM.
        far: Greatest distance from the hip fore and aft.
        inward, outward: Greatest distance from the hip sideways.
        apart: Least sideways distance from the stance foot.
    """

    side: float
    hip_x: float
    hip_y: float
    far: float
    inward: float
    outward: float
    apart: float


@compiled
def fallen(fall: Fall, remaining: float) -> tuple[float, float, float, float]:
    """Position and velocity of the CoM after a time: x, y, vx, vy."""
    x, y, vx, vy, w, coasting = fall
    coasting = min(coasting, remaining)
    sinh, cosh = math.sinh(w * (remaining - coasting)), math.cosh(w * (remaining - coasting))
    x += vx * coasting
    y += vy * coasting
    return (
        x * cosh + vx / w * sinh,
        y * cosh + vy / w * sinh,
        w * x * sinh + vx * cosh,
        w * y * sinh + vy * cosh,
    )


@compiled
def foot(
    aim: Aim, reach: Reach, end: tuple[float, float, float, float]
) -> tuple[float, float, float]:
    """Where the foot goes for a CoM that touches down as `end` says, kept within reach.

    Returns:
        u_x, u_y, and how far out of reach the law wanted it. In m.
    """
    _, y_end, vx, vy = end
    side, hip_x, hip_y, far, inward, outward, apart = reach
    # From backward to forward gain over a stretch of velocity, so that the law is continuous.
    forward = min(1.0, max(0.0, 0.5 + vx / 0.4))
    gain = aim.gain_backward + forward * (aim.gain_forward - aim.gain_backward)
    wanted_x = aim.ux + gain * (vx - aim.vx)
    wanted_y = aim.uy + aim.gain_y * (vy - aim.vy)
    ux = hip_x + min(far, max(-far, wanted_x - hip_x))
    out = side * (wanted_y - hip_y)
    out = min(outward, max(-inward, out))
    # Feet that would meet are worse than a foot out of the hip's reach.
    out = max(out, apart - side * (y_end + hip_y))
    uy = hip_y + side * out
    return ux, uy, math.hypot(wanted_x - ux, wanted_y - uy)


@compiled
def touchdown_time(
    fall: Fall, aim: Aim, reach: Reach, planned: float, earliest: float, latest: float
) -> float:
    """Time to touchdown at which the foot that the law wants is nearest to within reach.

    Args:
        planned: Time to the gait's own touchdown, which is kept where it serves as well.
        earliest, latest: Bounds of the result.
    """
    best, least = planned, _cost(fall, aim, reach, planned, 0.0)
    if least < 1e-4 * _LATENESS:
        return planned
    for i in range(_TIMES):
        time = earliest + (latest - earliest) * i / (_TIMES - 1)
        cost = _cost(fall, aim, reach, time, time - planned)
        if cost < least:
            best, least = time, cost
    return best


@compiled
def _cost(fall: Fall, aim: Aim, reach: Reach, time: float, change: float) -> float:
    missed = foot(aim, reach, fallen(fall, time))[2]
    value: float = missed * missed + _LATENESS * change * change
    return value
