"""A linear map of two steps, fitted to deviations from steady walking, and their decay."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cassie_bags.bag.rows import FloatArray

ABOVE_NOISE = 3.0
"""Ratio to the noise from which deviations are used in the fit."""

_MIN_PAIRS = 12  # least number of pairs of deviations for a map: twice the length of a state
_GAIT = 4  # entries of a state that belong to the gait; the others are the robot's position

DECAYED = 0.1
"""Ratio to the first deviation below which a push counts as decayed."""


@dataclass(frozen=True)
class Deviations:
    """Deviations after one push, at each touchdown.

    Attributes:
        impulse: Impulse of the push, forward and to the left. In N s.
        delay: Time from the left foot's touchdown to the push. In s.
        values: Differences of the states from those without a push. Shape (n, 6), see
            `return_map.Touchdowns`.
    """

    impulse: tuple[float, float]
    delay: float
    values: FloatArray

    @property
    def size(self) -> FloatArray:
        """Norm of the deviation at each touchdown. Shape (n,), in m/s."""
        return size_of(self.values)


@dataclass(frozen=True)
class ReturnMap:
    """The map d[k + 2] = A d[k], fitted by least squares.

    Attributes:
        matrix: A. Shape (6, 6).
        eigenvalues: Magnitudes of the eigenvalues, largest first. Shape (6,).
        spread: Smallest and largest of the largest magnitudes, with one run left out at a time.
        residual: Norm of the residual over the norm of the predicted deviations, for the gait's
            part of the state.
        pairs: Number of pairs of deviations in the fit.
    """

    matrix: FloatArray
    eigenvalues: FloatArray
    spread: tuple[float, float]
    residual: float
    pairs: int


def size_of(values: FloatArray) -> FloatArray:
    """Norm of the gait's part of each deviation. Shape (n, 6) to (n,), in m/s."""
    size: FloatArray = np.linalg.norm(values[:, :_GAIT], axis=1)
    return size


def fit(runs: Sequence[Deviations], noise: float) -> ReturnMap | None:
    """Fit the map of two steps to pairs that begin above the noise; None if they are too few.

    Noise in d[k] makes the eigenvalues too small; `ABOVE_NOISE` limits this to about a tenth.

    Args:
        runs: Deviations of runs of the same gait.
        noise: Size of deviations by noise. In m/s.
    """
    threshold = ABOVE_NOISE * noise
    pairs = [_pairs(run, threshold) for run in runs]
    solution = _solve(pairs)
    if solution is None:
        return None
    matrix, residual = solution
    others = (_solve(pairs[:i] + pairs[i + 1 :]) for i in range(len(pairs)))
    largest = [_magnitudes(other[0])[0] for other in others if other is not None]
    magnitudes = _magnitudes(matrix)
    spread = (min(largest), max(largest)) if largest else (magnitudes[0], magnitudes[0])
    count = sum(len(before) for before, _ in pairs)
    return ReturnMap(matrix, magnitudes, (float(spread[0]), float(spread[1])), residual, count)


def decay(runs: Sequence[Deviations]) -> FloatArray:
    """Median over the runs of each deviation's ratio to the first one. Shape (n,)."""
    steps = min(len(run.size) for run in runs)
    ratios: FloatArray = np.median([run.size[:steps] / run.size[0] for run in runs], axis=0)
    return ratios


def steps_to_decay(runs: Sequence[Deviations]) -> int | None:
    """Steps until the median deviation stays below `DECAYED`; None if it does not."""
    above = np.flatnonzero(decay(runs) >= DECAYED)
    steps = int(above[-1]) + 1
    return steps if steps < len(decay(runs)) else None


def _pairs(run: Deviations, threshold: float) -> tuple[FloatArray, FloatArray]:
    """Deviations and those two steps later, from the first one until the noise is reached."""
    small = np.flatnonzero(run.size[:-2] < threshold)
    count = int(small[0]) if len(small) else len(run.size) - 2
    return run.values[:count], run.values[2 : count + 2]


def _solve(pairs: Sequence[tuple[FloatArray, FloatArray]]) -> tuple[FloatArray, float] | None:
    if sum(len(before) for before, _ in pairs) < _MIN_PAIRS:
        return None
    before = np.concatenate([pair[0] for pair in pairs])
    after = np.concatenate([pair[1] for pair in pairs])
    transposed, _, rank, _ = np.linalg.lstsq(before, after, rcond=None)
    if rank < before.shape[1]:
        return None
    left = np.linalg.norm(size_of(after - before @ transposed)) / np.linalg.norm(size_of(after))
    return transposed.T, float(left)


def _magnitudes(matrix: FloatArray) -> FloatArray:
    magnitudes: FloatArray = np.sort(np.abs(np.linalg.eigvals(matrix)))[::-1]
    return magnitudes
