"""Places where the feet stood, found from the load on each foot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cassie_bags.bag.rows import FloatArray, runs
from cassie_bags.signals.track import Track

_LOADED = 0.5  # load of a foot (0..1) above which the foot counts as standing
_MIN_DURATION = 0.1  # s, shortest time on the ground that counts as a placement


@dataclass(frozen=True)
class Placement:
    """One contact of one foot with the ground.

    Attributes:
        leg: 0 left, 1 right.
        t0: Time at which the foot began to carry load. In s.
        t1: Time at which the foot ceased to carry load. In s.
        heel: Heel end of the sole's centre line in the world, mean over that time. (3,), in m.
        tip: Tip end of the sole's centre line in the world, mean over that time. (3,), in m.
    """

    leg: int
    t0: float
    t1: float
    heel: FloatArray
    tip: FloatArray


def placements(track: Track) -> list[Placement]:
    """All placements of both feet in a run, in the order of their starts."""
    steps = []
    for leg in (0, 1):
        loaded = track.foot_load[:, leg] > _LOADED
        for start, end in runs(loaded):
            if not loaded[start]:
                continue
            t0, t1 = float(track.time[start]), float(track.time[end - 1])
            tip, heel = track.legs[start:end, leg, -2:].mean(axis=0)
            if t1 - t0 >= _MIN_DURATION and np.isfinite([tip, heel]).all():  # NaN: drives damp
                steps.append(Placement(leg, t0, t1, heel, tip))
    return sorted(steps, key=lambda placement: placement.t0)
