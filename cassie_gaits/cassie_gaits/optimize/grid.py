"""Collocation points of a step, and matrices from the unknowns to the coordinates there.

The unknowns of a step are 6 Bezier coefficients for each of 9 outputs and NODES + 2 Bernstein
coefficients for each of the 2 passive coordinates: with NODES Gauss points that is collocation
of their second-order dynamics.
"""

from __future__ import annotations

from functools import cache
from math import comb

import numpy as np

from cassie_gaits import bezier
from cassie_gaits.optimize.posture import SIZE
from cassie_gaits.records import FloatArray

NODES = 15
"""Gauss points of a step; between them the error of the dynamics is about 0.02 Nm."""

PASSIVE = 2
OUTPUT_COUNT = SIZE - PASSIVE
PASSIVE_DEGREE = NODES + 1
STEP_UNKNOWNS = OUTPUT_COUNT * bezier.COEFFICIENTS + PASSIVE * (PASSIVE_DEGREE + 1)


@cache
def gauss() -> tuple[FloatArray, FloatArray]:
    """Phases and weights of the Gauss points. Shape (NODES,) each."""
    points, weights = np.polynomial.legendre.leggauss(NODES)
    return 0.5 * (points + 1.0), 0.5 * weights


def bernstein(degree: int, phase: float, derivative: int = 0) -> FloatArray:
    """Bernstein polynomials at one phase, or a derivative of them by the phase.

    Args:
        degree: Degree of the polynomials.
        phase: In [0, 1].
        derivative: Order of the derivative; 0 for the polynomials.

    Returns:
        Shape (degree + 1,).
    """
    if derivative:
        lower = bernstein(degree - 1, phase, derivative - 1)
        padded = np.concatenate([[0.0], lower, [0.0]])
        difference: FloatArray = degree * (padded[:-1] - padded[1:])
        return difference
    i = np.arange(degree + 1)
    binomial = np.array([comb(degree, int(k)) for k in i], dtype=np.float64)
    result: FloatArray = binomial * phase**i * (1.0 - phase) ** (degree - i)
    return result


@cache
def coordinates_at(phase: float, derivatives: int) -> FloatArray:
    """Matrix from the unknowns of a step to its coordinates and derivatives by phase.

    Args:
        phase: In [0, 1].
        derivatives: Number of derivatives after the coordinates, 0 to 2.

    Returns:
        Matrix of shape ((derivatives + 1) SIZE, STEP_UNKNOWNS), read-only.
    """
    rows = []
    for order in range(derivatives + 1):
        output = bernstein(bezier.DEGREE, phase, order)
        passive = bernstein(PASSIVE_DEGREE, phase, order)
        block = np.zeros((SIZE, STEP_UNKNOWNS))
        split = OUTPUT_COUNT * bezier.COEFFICIENTS
        block[:OUTPUT_COUNT, :split] = np.kron(np.eye(OUTPUT_COUNT), output)
        block[OUTPUT_COUNT:, split:] = np.kron(np.eye(PASSIVE), passive)
        rows.append(block)
    result = np.vstack(rows)
    result.flags.writeable = False
    return result


def split(unknowns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Coefficients of the outputs and of the passive coordinates of a step. (9, 6), (2, n)."""
    at = OUTPUT_COUNT * bezier.COEFFICIENTS
    return unknowns[:at].reshape(OUTPUT_COUNT, -1), unknowns[at:].reshape(PASSIVE, -1)
