"""The accelerometer against the forces on the pelvis, compiled. See `faults` for the reasoning."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from cassie_gaits.compiled import compiled

FloatArray = npt.NDArray[np.float64]

KEPT = 192
"""Ticks of expected acceleration that are kept: longer than the longest of `_DELAYS` at 2 kHz."""

DELAYS = (0.02, 0.03, 0.04)
"""Delays that are looked for; those beside them fit one of these better than none. In s."""

_SPIKE_TIME, _SPIKES = 0.04, 3.0  # s; count, fading over it, that soles which bounce do not reach
_FROZEN = 0.016  # s, after which what carries noise does not keep its bits; a delay begins so
_FAST, _SLOW = 0.003, 0.02  # s, between which a signal must change to be compared
_POWER_TIME = 0.2  # s
_CARRIED, _CARRIED_TIME, _CARRIED_SHARE = 0.5, 0.3, 0.75  # of the weight; s; of that time
_UNSURE, _NOISE = 1.0, 0.3  # share of the expected power, and (m/s^2)^2, that count as a misfit
_NORMAL = 0.1  # of a misfit, by which being late must fit better
_LARGEST = 2.0  # of what is needed
_NEAREST = 0.005  # s, between the delays of which a blow fits none
# Of the expected power: walking, late by up to 40 ms or not, stays below 5, a push of 200 N for
# 40 ms gives 26. And for how long, in s, the legs' answer to it may look like a delay.
_BLOW, _BLOW_TIME = 16.0, 0.1

# Acceleration of the pelvis by the left leg's force times its lean ahead, its lean aside, and the
# force itself (1/kg), and by the torques of hip roll, hip yaw, hip pitch, knee, toe (1/(kg m)).
_AHEAD = (0.0431, -0.0035, 0.0013, 0.0012, -0.0241, -0.1339, -0.0199, 0.0283)
_ASIDE = (-0.0021, 0.0512, 0.0236, -0.2135, -0.0122, -0.0034, 0.0221, 0.0160)
_UPWARD = (0.0080, 0.0030, 0.0292, -0.0025, -0.0270, -0.0904, 0.0010, -0.0237)
_LEAST_HEIGHT = 0.4  # m


@compiled
def expect_acceleration(
    torques: FloatArray, forces: FloatArray, feet: FloatArray, expected: FloatArray
) -> None:
    """Acceleration that legs' forces and drives' torques give the pelvis.

    Newton's law: a leg's force leans with it, a hip's torque pushes the pelvis over the leg's
    length. The factors were fitted to walks on six grounds and hold for changes within a step (8
    to 50 Hz). Of these they explain 78 to 94 % of the variance ahead, 81 to 93 % aside and 89 to
    97 % upwards on other robots and grounds, at -0.7 to 1.6 m/s. Constant parts are not in it.

    Args:
        torques: Of the ten drives. Shape (10,), in Nm.
        forces: Of the feet. Shape (2,), in N.
        feet: Middle of each sole in the pelvis. Shape (2, 3), in m.
        expected: Result, pelvis frame. Shape (3,), in m/s^2.
    """
    for k in range(3):
        expected[k] = 0.0
    for i in range(2):
        side = 1.0 if i == 0 else -1.0  # the right leg is the left one's image
        height = min(feet[i, 2], -_LEAST_HEIGHT)
        t = torques[5 * i : 5 * i + 5]
        causes = (
            forces[i] * feet[i, 0] / height,
            side * forces[i] * feet[i, 1] / height,
            forces[i],
            side * t[0],
            side * t[1],
            t[2],
            t[3],
            t[4],
        )
        for k in range(8):
            expected[0] += _AHEAD[k] * causes[k]
            expected[1] += side * _ASIDE[k] * causes[k]
            expected[2] += _UPWARD[k] * causes[k]


@compiled
def look_at_acceleration(watch: Any, limit: Any, expected: FloatArray, force: float) -> None:
    """Compare the accelerometer with itself and with what is expected of the last sample.

    Args:
        watch: Of `faults.WATCH_TYPE`.
        limit: Of `faults.LIMITS_TYPE`.
        expected: Shape (3,), in m/s^2.
        force: Of both feet. In N.
    """
    dt, a = limit.period, watch.acceleration
    stands = 1.0 if force > _CARRIED * limit.weight else 0.0
    watch.blow = max(0.0, watch.blow - dt)
    watch.carried += (1.0 - math.exp(-dt / _CARRIED_TIME)) * (stands - watch.carried)
    # Neither what a gantry does is expected, nor anything true of sensors that fail.
    trusted = watch.bad.max() <= 0.0 and watch.bad_torque.max() <= 0.0
    known = trusted and watch.carried > _CARRIED_SHARE
    for k in range(3):
        watch.bad_acceleration[k] = max(0.0, watch.bad_acceleration[k] - dt)
        watch.same_acceleration[k] = watch.same_acceleration[k] + 1 if a[0, k] == a[1, k] else 0
        watch.acceleration_spikes[k] *= math.exp(-dt / _SPIKE_TIME)
        out = abs(a[1, k] - 0.5 * (a[0, k] + a[2, k]))
        # A step, as where a push begins or ends, is none.
        if out > max(limit.acceleration_spike, abs(a[0, k] - a[2, k])):
            watch.acceleration_spikes[k] += 1.0
        wrong = not abs(a[0, k]) <= limit.acceleration
        wrong = wrong or dt * watch.same_acceleration[k] > _FROZEN - 0.5 * dt
        wrong = wrong or watch.acceleration_spikes[k] > _SPIKES
        late = _late(watch, limit, k, a[1, k], expected[k])
        if not known:
            watch.late_acceleration[:, k] = 0.0
        if wrong or (late and known):
            watch.bad_acceleration[k] = limit.hold


@compiled
def _late(watch: Any, limit: Any, k: int, measured: float, expected: float) -> bool:
    """Whether an axis follows what was expected a while ago, and not by chance."""
    dt = limit.period
    if watch.ticks == 0:
        watch.smooth[:, k] = measured, measured, expected, expected
    band = [measured, expected]
    for j in range(2):
        fast, slow = watch.smooth[2 * j, k], watch.smooth[2 * j + 1, k]
        fast += (1.0 - math.exp(-dt / _FAST)) * (band[j] - fast)
        slow += (1.0 - math.exp(-dt / _SLOW)) * (fast - slow)
        watch.smooth[2 * j, k], watch.smooth[2 * j + 1, k] = fast, slow
        band[j] = fast - slow
    now, place = band[1], watch.ticks % KEPT
    watch.expected[place, k] = now
    watch.power[k] += (1.0 - math.exp(-dt / _POWER_TIME)) * (now * now - watch.power[k])
    scale = _UNSURE * watch.power[k] + _NOISE
    misfit, late = min(1.0, (band[0] - now) ** 2 / scale), False
    if _unexplained(watch, dt, k, band[0]) > _BLOW * scale:
        watch.blow = _BLOW_TIME
    for j in range(len(DELAYS)):
        count = int(DELAYS[j] / dt + 0.5)
        before = watch.expected[(watch.ticks - count) % KEPT, k] if watch.ticks >= count else now
        gain = misfit - min(1.0, (band[0] - before) ** 2 / scale) - _NORMAL
        if watch.blow > 0.0:
            gain = min(0.0, gain)
        total = max(0.0, watch.late_acceleration[j, k] + dt * gain)
        watch.late_acceleration[j, k] = min(_LARGEST * limit.late_acceleration[j, k], total)
        late = late or total > limit.late_acceleration[j, k]
    return late


@compiled
def _unexplained(watch: Any, dt: float, k: int, measured: float) -> float:
    """Least square (m^2/s^4) by which an axis is off what was expected now or up to 40 ms ago."""
    least, late = math.inf, 0.0
    while late < DELAYS[-1] + 0.5 * dt:
        count = int(late / dt + 0.5)
        if count > watch.ticks:
            break
        least = min(least, (measured - watch.expected[(watch.ticks - count) % KEPT, k]) ** 2)
        late += _NEAREST
    return least
