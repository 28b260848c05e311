"""Bezier polynomials of 5th order, the shape of every desired output h_d(phase, alpha).

Coefficients are the rows of a matrix of shape (n, 6), one row per output. `phase` is the paper's
tau. Derivatives are with respect to phase: divide by the step time for rates per second.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

DEGREE = 5
COEFFICIENTS = DEGREE + 1


def basis(phase: float) -> FloatArray:
    """Bernstein polynomials and their first two derivatives at one phase.

    `coefficients @ basis(phase)` is of shape (n, 3): values, first and second derivatives of
    all rows at once, as a control loop needs them.

    Args:
        phase: Usually in [0, 1]; outside it the polynomials extrapolate, fast and steeply.

    Returns:
        Shape (6, 3).
    """
    s, r = phase, 1.0 - phase
    s2, r2 = s * s, r * r
    s3, r3 = s2 * s, r2 * r
    s4, r4 = s3 * s, r3 * r
    cubic = (r3, 3.0 * r2 * s, 3.0 * r * s2, s3)
    quartic = (r4, 4.0 * r3 * s, 6.0 * r2 * s2, 4.0 * r * s3, s4)
    b0, b1, b2, b3, b4 = quartic
    c0, c1, c2, c3 = cubic
    return np.array(
        (
            (r4 * r, -5.0 * b0, 20.0 * c0),
            (5.0 * r4 * s, 5.0 * (b0 - b1), 20.0 * (c1 - 2.0 * c0)),
            (10.0 * r3 * s2, 5.0 * (b1 - b2), 20.0 * (c2 - 2.0 * c1 + c0)),
            (10.0 * r2 * s3, 5.0 * (b2 - b3), 20.0 * (c3 - 2.0 * c2 + c1)),
            (5.0 * r * s4, 5.0 * (b3 - b4), 20.0 * (c2 - 2.0 * c3)),
            (s4 * s, 5.0 * b4, 20.0 * c3),
        )
    )


def evaluate(coefficients: FloatArray, phase: float) -> FloatArray:
    """Value of each row at `phase`. Shape (n,), in the unit of the coefficients."""
    value: FloatArray = coefficients @ basis(phase)[:, 0]
    return value


def derivative(coefficients: FloatArray, phase: float) -> FloatArray:
    """First derivative of each row with respect to phase. Shape (n,)."""
    value: FloatArray = coefficients @ basis(phase)[:, 1]
    return value


def fade(phase: float) -> float:
    """Polynomial with coefficients (0, 0, 1, 1, 1, 1): from 0 at phase 0 to 1 at phase 1.

    Phases outside [0, 1] are clamped, so that the result stays in [0, 1].
    """
    r = 1.0 - min(1.0, max(0.0, phase))
    return 1.0 - r * r * r * r * (5.0 - 4.0 * r)
