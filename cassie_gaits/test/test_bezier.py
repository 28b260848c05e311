"""Bezier polynomials: known answers, finite differences, continuity of steps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cassie_gaits import bezier

ALPHA = np.random.default_rng(1).normal(size=(9, 6))


@pytest.mark.parametrize("phase", [-0.1, 0.0, 0.3, 0.5, 1.0, 1.1])
def test_values_are_the_bernstein_sum(phase):
    weights = [math.comb(5, k) * phase**k * (1 - phase) ** (5 - k) for k in range(6)]
    np.testing.assert_allclose(bezier.evaluate(ALPHA, phase), ALPHA @ weights, atol=1e-14)


def test_equal_coefficients_give_a_constant():
    alpha = np.full((2, 6), 0.85)
    for phase in (0.0, 0.37, 1.0):
        np.testing.assert_allclose(alpha @ bezier.basis(phase), [[0.85, 0.0, 0.0]] * 2, atol=1e-14)


def test_evenly_spaced_coefficients_give_a_straight_line():
    alpha = np.linspace(-1.0, 4.0, 6)[np.newaxis]
    np.testing.assert_allclose(alpha @ bezier.basis(0.3), [[0.5, 5.0, 0.0]], atol=1e-13)


@pytest.mark.parametrize("phase", [0.0, 0.2, 0.71, 1.0])
def test_derivatives_match_finite_differences(phase):
    step = 1e-5
    before, at, after = (bezier.evaluate(ALPHA, phase + k * step) for k in (-1, 0, 1))
    _, first, second = (ALPHA @ bezier.basis(phase)).T
    np.testing.assert_allclose(first, (after - before) / (2 * step), atol=1e-7)
    np.testing.assert_allclose(second, (after - 2 * at + before) / step**2, atol=1e-4)


@pytest.mark.parametrize("phase", [0.0, 0.1, 0.5, 0.9, 1.0])
def test_fade_is_the_polynomial_of_its_coefficients(phase):
    alpha = np.array([[0.0, 0.0, 1.0, 1.0, 1.0, 1.0]])
    value, *derivatives = (alpha @ bezier.basis(phase))[0]
    assert bezier.fade(phase) == pytest.approx(value)
    assert bezier.fade_derivatives(phase) == pytest.approx(derivatives, abs=1e-12)
