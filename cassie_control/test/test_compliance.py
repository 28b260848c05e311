"""The springs' deflection that standing's leg lengths include."""

from __future__ import annotations

import numpy as np
import pytest

from cassie_control.control.compliance import MIN_LENGTH, compliance
from cassie_control.control.robot import MAX_COMMANDED_LENGTH
from cassie_gaits.leg import leg_shortening
from cassie_gaits.robot import WEIGHT


@pytest.mark.parametrize("length", np.linspace(MIN_LENGTH, MAX_COMMANDED_LENGTH, 8))
def test_the_polynomial_is_the_springs_equilibrium(length):
    shortening = leg_shortening(length, 0.5 * WEIGHT)
    assert 0.5 * WEIGHT * compliance(length) == pytest.approx(shortening, rel=0.02)


def test_lengths_out_of_reach_get_the_nearest():
    assert compliance(0.1) == compliance(MIN_LENGTH)
    assert compliance(1.2) == compliance(MAX_COMMANDED_LENGTH)
