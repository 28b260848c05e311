"""Rotations and small matrices of the filter, compiled."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from cassie_gaits.compiled import compiled

FloatArray = npt.NDArray[np.float64]
Vector = tuple[float, float, float]


@compiled
def cross(a: Any, b: Any) -> Vector:
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@compiled
def rotated(matrix: FloatArray, v: Any) -> Vector:
    """Matrix times vector."""
    return (
        matrix[0, 0] * v[0] + matrix[0, 1] * v[1] + matrix[0, 2] * v[2],
        matrix[1, 0] * v[0] + matrix[1, 1] * v[1] + matrix[1, 2] * v[2],
        matrix[2, 0] * v[0] + matrix[2, 1] * v[1] + matrix[2, 2] * v[2],
    )


@compiled
def exponential(x: float, y: float, z: float, rotation: FloatArray, jacobian: FloatArray) -> None:
    """Rotation by a vector, and the left Jacobian of SO(3) there. In rad."""
    square = x * x + y * y + z * z
    angle = math.sqrt(square)
    if angle < 1e-4:
        a, b, c = 1.0 - square / 6.0, 0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0
    else:
        a, b = math.sin(angle) / angle, (1.0 - math.cos(angle)) / square
        c = (1.0 - a) / square
    w = (x, y, z)
    for i in range(3):
        for j in range(3):
            outer = w[i] * w[j]
            same = 1.0 if i == j else 0.0
            rotation[i, j] = (1.0 - b * square) * same + b * outer
            jacobian[i, j] = (1.0 - c * square) * same + c * outer
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        rotation[k, j] += a * w[i]
        rotation[j, k] -= a * w[i]
        jacobian[k, j] += b * w[i]
        jacobian[j, k] -= b * w[i]


@compiled
def times(left: FloatArray, right: FloatArray, out: FloatArray) -> None:
    """Product of two 3 x 3 matrices; `out` is neither of them."""
    for i in range(3):
        for j in range(3):
            out[i, j] = (
                left[i, 0] * right[0, j] + left[i, 1] * right[1, j] + left[i, 2] * right[2, j]
            )
