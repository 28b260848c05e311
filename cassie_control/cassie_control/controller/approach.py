"""The way to a set-point with bounded rate and acceleration."""

from __future__ import annotations

import math


def approach(
    value: float,
    rate: float,
    target: float,
    fastest: float,
    acceleration: float,
    period: float,
    braking: float | None = None,
) -> tuple[float, float]:
    """The next value and rate on the way to a target, with bounded rate and acceleration.

    Args:
        value, rate: Now.
        target: Where to rest.
        fastest, acceleration: Bounds.
        period: In s.
        braking: Bound of the acceleration towards rest, if it is another one.
    """
    away, gain = target - value, acceleration * period
    loss = gain if braking is None else braking * period
    # The rate from which the acceleration just brakes, half a tick early as it acts a tick late.
    brake = math.sqrt(2.0 * loss / period * abs(away) + (0.5 * loss) ** 2) - 0.5 * loss
    wanted = math.copysign(min(fastest, max(0.0, brake)), away)
    change = gain if wanted * rate >= 0.0 and abs(wanted) > abs(rate) else loss
    rate += max(-change, min(change, wanted - rate))
    if abs(away) <= abs(rate) * period and abs(rate) <= 2.0 * loss:
        return target, 0.0
    return value + rate * period, rate
