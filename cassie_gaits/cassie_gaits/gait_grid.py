"""Gaits on a grid of sagittal speed, lateral speed and turning rate, read between its points."""

from __future__ import annotations

from itertools import product

import numpy as np
import numpy.typing as npt

from cassie_gaits.compiled import compiled

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
Axis = list[float]

_AHEAD = 3.0
"""How much farther a gait of the next sagittal speed counts than one of the next other speed."""


@compiled
def read_row(
    axes: FloatArray,
    lengths: IntArray,
    rows: FloatArray,
    x: float,
    y: float,
    z: float,
    out: FloatArray,
) -> None:
    """Interpolate; the first three are `GaitGrid.table`, the others as `GaitGrid.read` has them."""
    at = (x, y, z)
    shares = np.zeros(3)
    first = 0
    for k in range(3):
        i = 0
        while i + 1 < lengths[k] and axes[k, i + 1] <= at[k]:
            i += 1
        if i + 1 < lengths[k] and at[k] > axes[k, i]:
            shares[k] = (at[k] - axes[k, i]) / (axes[k, i + 1] - axes[k, i])
        first = first * lengths[k] + i
    out[:] = 0.0
    for corner in range(8):
        weight, row, stride = 1.0, first, 1
        for k in range(2, -1, -1):
            if corner >> k & 1:
                weight *= shares[k]
                row += stride
            else:
                weight *= 1.0 - shares[k]
            stride *= lengths[k]
        if weight > 0.0:
            for j in range(out.size):
                out[j] += weight * rows[row, j]


class GaitGrid:
    """Multilinear interpolation of rows of numbers over three axes.

    Outside the grid the nearest point of it counts. A point without a row, a hole, takes that of
    the nearest point which has one, on the side of rest where two are as near: what comes out is
    continuous, and always a convex combination of given rows.

    Args:
        points: Sagittal speed, lateral speed and turning rate of each row. Shape (n, 3).
        rows: Shape (n, m).

    Attributes:
        axes: Values of each coordinate on the grid, rising.
        holes: Number of grid points without a row.
        table: What `read_row` takes: the axes, one a row, filled up with infinity; how many points
            each has; and the rows.
    """

    def __init__(self, points: FloatArray, rows: FloatArray) -> None:
        self.axes: tuple[Axis, ...] = tuple(np.unique(points[:, i]).tolist() for i in range(3))
        self._lengths = np.array([len(axis) for axis in self.axes])
        axes = np.full((3, int(self._lengths.max())), np.inf)
        for i, axis in enumerate(self.axes):
            axes[i, : len(axis)] = axis
        owner = np.full(self._lengths, -1)
        for i, point in enumerate(points.tolist()):
            owner[tuple(axis.index(x) for axis, x in zip(self.axes, point, strict=True))] = i
        self.holes = int((owner < 0).sum())
        self._fill(owner)
        self.table = axes, self._lengths, np.ascontiguousarray(rows[owner.ravel()])

    def read(self, x: float, y: float, z: float, out: FloatArray) -> None:
        """Write the row at a point, all finite, to `out` of shape (m,)."""
        read_row(*self.table, x, y, z, out)

    def _fill(self, owner: npt.NDArray[np.int64]) -> None:
        given = np.argwhere(owner >= 0)
        rest = [int(np.argmin(np.abs(axis))) for axis in self.axes]
        from_rest = np.abs(given - rest).sum(axis=1)
        numbers = owner[tuple(given.T)]
        for hole in product(*(range(length) for length in self._lengths)):
            if owner[hole] < 0:
                away = np.abs(given - hole) @ np.array([_AHEAD, 1.0, 1.0])
                owner[hole] = numbers[np.lexsort((from_rest, away))[0]]
