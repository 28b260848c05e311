"""Places where the feet stood, found from the load on each foot."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cassie_bags.signals.track import Track

FloatArray = npt.NDArray[np.float64]

LOADED = 0.5
"""Load of a foot (0..1) above which the foot counts as standing."""

SHORTEST = 0.1
"""Shortest time on the ground that counts as a placement. In s."""


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


def placements(track: Track, shortest: float = SHORTEST) -> list[Placement]:
    """All placements of both feet, in the order of their starts.

    Args:
        track: Signals of a run.
        shortest: Shortest time of a placement. In s.
    """
    found = []
    for leg in (0, 1):
        for start, end in _runs(track.foot_load[:, leg] > LOADED):
            t0, t1 = float(track.time[start]), float(track.time[end - 1])
            tip, heel = track.legs[start:end, leg, -2:].mean(axis=0)
            if t1 - t0 >= shortest and np.isfinite([tip, heel]).all():  # NaN: drives damp
                found.append(Placement(leg, t0, t1, heel, tip))
    return sorted(found, key=lambda placement: placement.t0)


def _runs(flags: npt.NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """Start and end (exclusive) of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    yield from zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
