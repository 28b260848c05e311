"""Feet that slip, and the grip that the ground is found to have, compiled.

A stance leg holds the weight along the line from its foot to the CoM. Where that asks for more
friction than there is, what is too much of its torques drives the foot away: the farther it is,
the more they ask, and in 0.1 s it ran away at 3 m/s. So no foot is put where the ground cannot bear
that line once it is known.

While a loaded foot slips, the ground bears what it holds of the robot,

    grip = mass |a| / force,

a the CoM's horizontal acceleration. Feet then land no farther out than `walk.grip_share` of that
allows (`pendulum`), until it is forgotten.
"""

from __future__ import annotations

import math
from typing import Any

from cassie_gaits.compiled import compiled

FIRM = 2.0
"""Grip of ground on which no foot has slipped."""

_SMOOTH = 0.02  # s, over which slip and the CoM's acceleration are taken
_SLIPPING = 0.25  # m/s; where feet stand it stays below, but for 60 ms after touchdown
_LANDED = 0.06  # s after touchdown, from which on that counts
_LEAST = 0.2  # grip that is believed
_FORGOTTEN = 0.05  # 1/s


@compiled
def feel_slip(figure: Any, robot: Any, step: Any) -> None:
    """Bring slip and grip up to date; the first tick of walking begins them."""
    share = figure.period / (_SMOOTH + figure.period)
    for k in range(2):
        if step.tracked == 0.0:
            step.slip[:, k] = 0.0
            step.com_track[k] = robot.com_velocity[k]
        step.com_track[k] += share * (robot.com_velocity[k] - step.com_track[k])
        for i in range(2):
            step.slip[i, k] += share * (robot.load[i] * robot.slip[i, k] - step.slip[i, k])
    step.grip = min(FIRM, step.grip + figure.period * _FORGOTTEN)
    i = int(step.stance)
    landed = robot.load[i] >= 1.0 and step.phase >= _LANDED * step.rate
    if landed and math.hypot(step.slip[i, 0], step.slip[i, 1]) > _SLIPPING:
        x = robot.com_velocity[0] - step.com_track[0]
        y = robot.com_velocity[1] - step.com_track[1]
        force = max(100.0, robot.force[0] + robot.force[1])
        found = figure.mass * math.hypot(x, y) / (_SMOOTH * force)
        step.grip = min(step.grip, max(_LEAST, found))
