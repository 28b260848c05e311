"""Vectors of three numbers for compiled functions: numpy's call overhead would dominate."""

from __future__ import annotations

from typing import Any

from cassie_gaits.compiled import compiled
from cassie_gaits.records import FloatArray

Vector = tuple[float, float, float]


@compiled
def plus(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@compiled
def minus(a: Any, b: Any) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@compiled
def times(factor: float, a: Any) -> Vector:
    return factor * a[0], factor * a[1], factor * a[2]


@compiled
def cross(a: Any, b: Any) -> Vector:
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@compiled
def dot(a: Any, b: Any) -> float:
    total: float = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return total


@compiled
def is_within(values: FloatArray, most: float) -> bool:
    """Whether every number of an array (n,) is within +- `most`; NaN is not."""
    for value in values:  # noqa: SIM110 - compiled code has no generators
        if not abs(value) <= most:
            return False
    return True
