"""Interpolation of gaits on a grid of sagittal speed, lateral speed and turning rate."""

from __future__ import annotations

from itertools import product

import numpy as np

from cassie_gaits.compiled import compiled
from cassie_gaits.records import FloatArray, IntArray

Axis = list[float]

_AHEAD = 3.0
"""Weight of a step in sagittal speed in the distance to a hole's nearest row; others weigh 1."""


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
    """Interpolate a row.

    Args:
        axes, lengths, rows: Entries of `GaitGrid.table`.
        x, y, z: Sagittal speed and lateral speed, in m/s, and turning rate, in rad/s.
        out: Result, a row.
    """
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

    Speeds outside the grid are clamped to it. A hole, a point without a row, takes the row of the
    nearest point with one; of two equally near points, the one nearer to rest. The result is
    continuous, and always a convex combination of given rows.

    Args:
        points: Sagittal speed, lateral speed and turning rate of each row. Shape (n, 3).
        rows: Rows to interpolate. Shape (n, m).

    Attributes:
        axes: Values of each coordinate on the grid, ascending.
        holes: Number of grid points without a row.
        table: Arguments of `read_row`: the axes, one per row, padded with infinity; their numbers
            of points; and the rows.
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
        """Interpolate the row at a point, whose coordinates are finite.

        Args:
            x: Sagittal speed. In m/s.
            y: Lateral speed. In m/s.
            z: Turning rate. In rad/s.
            out: Result. Shape (m,).
        """
        read_row(*self.table, x, y, z, out)

    def _fill(self, owner: IntArray) -> None:
        given = np.argwhere(owner >= 0)
        rest = [int(np.argmin(np.abs(axis))) for axis in self.axes]
        from_rest = np.abs(given - rest).sum(axis=1)
        numbers = owner[tuple(given.T)]
        for hole in product(*(range(length) for length in self._lengths)):
            if owner[hole] < 0:
                away = np.abs(given - hole) @ np.array([_AHEAD, 1.0, 1.0])
                owner[hole] = numbers[np.lexsort((from_rest, away))[0]]
