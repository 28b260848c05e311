"""Vectors of three numbers for compiled functions: numpy's call overhead would dominate."""

from __future__ import annotations

from typing import Any

from cassie_gaits.compiled import compiled

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
