"""Bezier polynomials of 5th order, the shape of every desired output h_d(phase, alpha).

Coefficients are the rows of a matrix of shape (n, 6), one row per output. `phase` is the paper's
tau. Derivatives are with respect to phase: divide by the step time for rates per second.
"""

from __future__ import annotations

import numpy as np

from cassie_gaits.compiled import compiled
from cassie_gaits.records import FloatArray

DEGREE = 5
COEFFICIENTS = DEGREE + 1


@compiled
def fill_basis(phase: float, out: FloatArray) -> None:
    """Bernstein polynomials and their first two derivatives at one phase, without allocation.

    `coefficients @ out` is of shape (n, 3): values, first and second derivatives of all rows.

    Args:
        phase: Usually in [0, 1]; outside it the polynomials extrapolate, fast and steeply.
        out: Result. Shape (6, 3).
    """
    s, r = phase, 1.0 - phase
    b0, b1, b2, b3, b4 = (
        r * r * r * r,
        4.0 * r * r * r * s,
        6.0 * r * r * s * s,
        4.0 * r * s * s * s,
        s * s * s * s,
    )
    c0, c1, c2, c3 = r * r * r, 3.0 * r * r * s, 3.0 * r * s * s, s * s * s
    out[0, 0], out[0, 1], out[0, 2] = b0 * r, -5.0 * b0, 20.0 * c0
    out[1, 0], out[1, 1], out[1, 2] = 5.0 * b0 * s, 5.0 * (b0 - b1), 20.0 * (c1 - 2.0 * c0)
    out[2, 0], out[2, 1] = 10.0 * c0 * s * s, 5.0 * (b1 - b2)
    out[2, 2] = 20.0 * (c2 - 2.0 * c1 + c0)
    out[3, 0], out[3, 1] = 10.0 * r * r * c3, 5.0 * (b2 - b3)
    out[3, 2] = 20.0 * (c3 - 2.0 * c2 + c1)
    out[4, 0], out[4, 1], out[4, 2] = 5.0 * r * b4, 5.0 * (b3 - b4), 20.0 * (c2 - 2.0 * c3)
    out[5, 0], out[5, 1], out[5, 2] = b4 * s, 5.0 * b4, 20.0 * c3


def basis(phase: float) -> FloatArray:
    """As `fill_basis`, as a new array of shape (6, 3)."""
    out = np.empty((COEFFICIENTS, 3))
    fill_basis(phase, out)
    return out


def evaluate(coefficients: FloatArray, phase: float) -> FloatArray:
    """Value of each row at `phase`. Shape (n,), in the unit of the coefficients."""
    value: FloatArray = coefficients @ basis(phase)[:, 0]
    return value


@compiled
def fade(phase: float) -> float:
    """Polynomial with coefficients (0, 0, 1, 1, 1, 1): from 0 at phase 0 to 1 at phase 1."""
    r = 1.0 - phase
    value: float = 1.0 - r * r * r * r * (5.0 - 4.0 * r)
    return value


@compiled
def fade_derivatives(phase: float) -> tuple[float, float]:
    """First and second derivative of `fade` by the phase."""
    r = 1.0 - phase
    return 20.0 * r * r * r * phase, 20.0 * r * r * (r - 3.0 * phase)
