"""Vectors of three numbers for compiled functions: numpy's call overhead would dominate."""

from __future__ import annotations

from cassie_gaits.compiled import compiled
from cassie_gaits.records import FloatArray

Vector = tuple[float, float, float]
VectorLike = FloatArray | Vector


@compiled
def plus(a: VectorLike, b: VectorLike) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@compiled
def minus(a: VectorLike, b: VectorLike) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@compiled
def times(factor: float, a: VectorLike) -> Vector:
    return factor * a[0], factor * a[1], factor * a[2]


@compiled
def cross(a: VectorLike, b: VectorLike) -> Vector:
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@compiled
def dot(a: VectorLike, b: VectorLike) -> float:
    total: float = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return total


@compiled
def turned(rotation: FloatArray, vector: VectorLike) -> Vector:
    """rotation (3, 3) times vector (3,)."""
    x, y, z = vector[0], vector[1], vector[2]
    return (
        rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z,
        rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z,
        rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z,
    )


@compiled
def is_within(values: FloatArray, most: float) -> bool:
    """Whether every number of an array (n,) is within +- `most`; false for NaN."""
    for value in values:  # noqa: SIM110 - compiled code has no generators
        if not abs(value) <= most:
            return False
    return True
