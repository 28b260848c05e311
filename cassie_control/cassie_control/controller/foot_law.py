"""Where the swing foot goes for a CoM that touches down with a velocity, and what it can reach.

Compiled; everything is in m, s and the heading frame, positions from the CoM at touchdown.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from cassie_gaits.compiled import compiled

LEAST_GAIN = 0.3
"""Share of a gain that is left at any speed."""


class Aim(NamedTuple):
    """Foot placement as a law of the velocity at touchdown.

    Attributes:
        ux, uy: Of the swing foot from the CoM in steady walking.
        vx, vy: Velocity at touchdown in steady walking.
        gain_forward, gain_backward, gain_y: Of the error of that velocity, in place. In s.
        speed: Low-passed, ahead.
        fade: Share by which sagittal gains fall with speed. In 1/(m/s).
    """

    ux: float
    uy: float
    vx: float
    vy: float
    gain_forward: float
    gain_backward: float
    gain_y: float
    speed: float
    fade: float


class Reach(NamedTuple):
    """Where the swing foot can be set down.

    Attributes:
        side: Of the swing leg.
        hip_x, hip_y: Swing hip from the CoM.
        far: Greatest distance from the hip fore and aft.
        inward, outward: Greatest distance from the hip sideways.
        apart: Least sideways distance from the stance foot.
        easy: Distance from the CoM outward from which a step is rather made quicker.
        slippery: The same from which the ground may not bear a foot.
        far_share: Of the way beyond that, how much a foot still goes.
        far_most: By which it is held back at most; held back more, a speed to the side would grow
            from step to step.
    """

    side: float
    hip_x: float
    hip_y: float
    far: float
    inward: float
    outward: float
    apart: float
    easy: float
    slippery: float
    far_share: float
    far_most: float


@compiled
def foot(
    aim: Aim, reach: Reach, end: tuple[float, float, float, float]
) -> tuple[float, float, float]:
    """Where the foot goes for a CoM that touches down as `end` says, kept within reach.

    Returns:
        u_x, u_y, and how far out of easy reach the law wanted it. In m.
    """
    _, y_end, vx, vy = end
    side, hip_x, hip_y, far, inward, outward, apart, easy, slippery, far_share, far_most = reach
    wanted_x = aim.ux + _sagittal_gain(aim, vx) * (vx - aim.vx)
    wanted_y = aim.uy + aim.gain_y * (vy - aim.vy)
    ux = hip_x + min(far, max(-far, wanted_x - hip_x))
    out = side * hip_y + min(outward, max(-inward, side * (wanted_y - hip_y)))
    held = out - min(far_most, (1.0 - far_share) * max(0.0, out - slippery))
    # Feet that would meet are worse than a foot out of the hip's reach.
    nearest = apart - side * y_end
    out = max(out, nearest)
    # The sooner a foot lands to catch a fall, the nearer: that needs less friction.
    missed = max(math.hypot(wanted_x - ux, wanted_y - side * out), out - easy)
    return ux, side * max(held, nearest), missed


@compiled
def _sagittal_gain(aim: Aim, vx: float) -> float:
    """Of the error of the velocity at touchdown, `vx`: less of it, the faster. In s."""
    forward = max(LEAST_GAIN, 1.0 - aim.fade * max(0.0, aim.speed, vx))
    # Walking backward steadily asks for no less; a push does.
    backward = max(LEAST_GAIN, 1.0 - aim.fade * max(0.0, min(0.0, aim.speed) - vx))
    back = backward * aim.gain_backward
    # From backward to forward gain over a stretch of velocity, so that the law is continuous.
    return back + min(1.0, max(0.0, 0.5 + vx / 0.4)) * (forward * aim.gain_forward - back)
