"""How far a leg's springs give way under the weight, by the length of the leg."""

from __future__ import annotations

import functools

import numpy as np

from cassie_control.control.robot import MAX_COMMANDED_LENGTH
from cassie_gaits.leg import leg_shortening
from cassie_gaits.robot import WEIGHT

MIN_LENGTH = 0.25
"""Shortest leg that standing commands. In m."""

_DEGREE = 4  # of the polynomial, which is within 1 % of the springs' equilibrium


@functools.cache
def _coefficients() -> tuple[float, ...]:
    """Polynomial of the compliance by leg length, highest degree first. In m/N and m."""
    lengths = np.linspace(MIN_LENGTH, MAX_COMMANDED_LENGTH, 13)
    force = 0.5 * WEIGHT
    shortening = [leg_shortening(float(length), force) / force for length in lengths]
    return tuple(np.polyfit(lengths, shortening, _DEGREE).tolist())


def compliance(length: float) -> float:
    """Shortening of a leg per force along it, at half the robot's weight.

    Args:
        length: Length with bent springs, hip to toe joint, at least `MIN_LENGTH`. In m.

    Returns:
        In m/N: 0.1 mm/N with a nearly straight leg, 0.4 mm/N in a deep crouch.
    """
    length = min(MAX_COMMANDED_LENGTH, max(MIN_LENGTH, length))
    value = 0.0
    for coefficient in _coefficients():
        value = value * length + coefficient
    return value
