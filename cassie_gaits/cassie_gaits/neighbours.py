"""Distances between neighbouring gaits of a grid, to find gaits in another local optimum.

Gaits change smoothly with the speeds as long as the optimizer stays in one local optimum. At a
change to another optimum, the distance of two neighbours is several times the usual one along the
same axis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from cassie_gaits.gait_library import Gait

AXES = ("vx", "vy", "yaw_rate")
UNITS = ("m/s", "m/s", "rad/s")

FAR = 2.0
"""Ratio of a distance to the median beyond which two neighbours may be in different optima."""

Speeds = tuple[float, float, float]


@dataclass(frozen=True)
class Pair:
    """Two neighbouring gaits of the grid.

    Attributes:
        axis: Name of the speed in which the gaits differ.
        one, other: The gaits, `one` at the lower speed.
        distance: RMS difference of the outputs' coefficients, in rad and m.
    """

    axis: str
    one: Gait
    other: Gait
    distance: float


def pairs(gaits: Sequence[Gait]) -> list[Pair]:
    """All pairs of neighbours along each axis of the grid; there is no pair across a hole."""
    by_speeds = {speeds_of(gait): gait for gait in gaits}
    found = []
    for k, axis in enumerate(AXES):
        values = sorted({speeds[k] for speeds in by_speeds})
        following = dict(pairwise(values))
        for speeds, gait in by_speeds.items():
            if speeds[k] not in following:
                continue
            after = list(speeds)
            after[k] = following[speeds[k]]
            other = by_speeds.get((after[0], after[1], after[2]))
            if other is not None:
                found.append(Pair(axis, gait, other, _distance(gait, other)))
    return found


def far_apart(found: Sequence[Pair]) -> list[Pair]:
    """Pairs whose distance is more than `FAR` times the median along their axis, farthest first."""
    medians = {axis: _median(found, axis) for axis in AXES}
    far = [pair for pair in found if pair.distance > FAR * medians[pair.axis]]
    return sorted(far, key=lambda pair: -pair.distance)


def greatest(gaits: Sequence[Gait]) -> dict[Speeds, float]:
    """Greatest distance of each gait to a neighbour, as ratio to the median along that axis."""
    found = pairs(gaits)
    medians = {axis: _median(found, axis) for axis in AXES}
    result = {speeds_of(gait): 0.0 for gait in gaits}
    for pair in found:
        ratio = pair.distance / medians[pair.axis] if medians[pair.axis] > 0.0 else 0.0
        for gait in (pair.one, pair.other):
            result[speeds_of(gait)] = max(result[speeds_of(gait)], ratio)
    return result


def report(gaits: Sequence[Gait], most: int | None = 10) -> str:
    """Text with the distances along each axis, and the pairs with the greatest distances.

    Args:
        gaits: Gaits of a library.
        most: Number of pairs to name for each axis, or None to name all.
    """
    found = pairs(gaits)
    lines = [f"{'neighbours in':14s} {'pairs':>6s} {'median':>8s} {'99 %':>8s} {'greatest':>8s}"]
    for axis in AXES:
        distances = [pair.distance for pair in found if pair.axis == axis]
        if distances:
            middle, most_of, top = np.quantile(distances, [0.5, 0.99, 1.0])
            lines.append(f"{axis:14s} {len(distances):6d} {middle:8.4f} {most_of:8.4f} {top:8.4f}")
    for axis in AXES:
        median = _median(found, axis)
        far = [pair for pair in far_apart(found) if pair.axis == axis]
        if far:
            lines.append(_summary(axis, far, most))
        for pair in far[:most]:
            lines.append(
                f"{pair.distance / median:5.1f} times the median of {axis}: "
                f"{pair.one.speeds} (cost {pair.one.cost or np.nan:.0f}) and "
                f"{pair.other.speeds} (cost {pair.other.cost or np.nan:.0f})"
            )
    return "\n".join(lines)


def _summary(axis: str, far: Sequence[Pair], most: int | None) -> str:
    """How many pairs are far apart along an axis, at which speeds, and how many are named."""
    both = [gait for pair in far for gait in (pair.one, pair.other)]
    ranges = [
        f"{name} {min(values):g} .. {max(values):g} {unit}"
        for name, unit in zip(AXES, UNITS, strict=True)
        if len(values := {getattr(gait, name) for gait in both}) > 1
    ]
    shown = "all" if most is None or len(far) <= most else f"the {most} farthest"
    return (
        f"{axis}: {len(far)} pair{'' if len(far) == 1 else 's'} at more than {FAR:g} times the "
        f"median ({', '.join(ranges)}), {shown} shown:"
    )


def speeds_of(gait: Gait) -> Speeds:
    return gait.vx, gait.vy, gait.yaw_rate


def _distance(one: Gait, other: Gait) -> float:
    return float(np.sqrt(((one.coefficients - other.coefficients) ** 2).mean()))


def _median(found: Sequence[Pair], axis: str) -> float:
    distances = [pair.distance for pair in found if pair.axis == axis]
    return float(np.median(distances)) if distances else 0.0
