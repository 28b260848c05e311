"""Bezier polynomials: known answers, finite differences, continuity of steps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cassie_gaits import bezier
from cassie_gaits.errors import GaitLibraryError

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
    np.testing.assert_allclose(
        bezier.derivative(ALPHA, phase), (after - before) / (2 * step), atol=1e-7
    )
    np.testing.assert_allclose(
        bezier.second_derivative(ALPHA, phase), (after - 2 * at + before) / step**2, atol=1e-4
    )


def test_next_step_continues_value_and_rate_and_keeps_the_rest():
    last, step_time = np.random.default_rng(2).normal(size=(9, 6)), 0.35
    value, rate = bezier.evaluate(last, 1.0), bezier.derivative(last, 1.0) / 0.4
    alpha = bezier.continue_from(ALPHA, value, rate, step_time)
    np.testing.assert_allclose(bezier.evaluate(alpha, 0.0), value, atol=1e-14)
    np.testing.assert_allclose(bezier.derivative(alpha, 0.0) / step_time, rate, atol=1e-12)
    np.testing.assert_array_equal(alpha[:, 2:], ALPHA[:, 2:])


@pytest.mark.parametrize("step_time", [0.0, -0.4, math.nan])
def test_step_time_that_is_not_positive_is_refused(step_time):
    with pytest.raises(GaitLibraryError, match="step time is"):
        bezier.continue_from(ALPHA, np.zeros(9), np.zeros(9), step_time)


@pytest.mark.parametrize("phase", [0.0, 0.1, 0.5, 0.9, 1.0])
def test_fade_is_the_polynomial_of_its_coefficients(phase):
    alpha = np.array([[0.0, 0.0, 1.0, 1.0, 1.0, 1.0]])
    assert bezier.fade(phase) == pytest.approx(bezier.evaluate(alpha, phase)[0])
    assert bezier.fade_derivative(phase) == pytest.approx(bezier.derivative(alpha, phase)[0])


def test_fade_holds_its_ends():
    assert (bezier.fade(-1.0), bezier.fade(1.3)) == (0.0, 1.0)
    assert (bezier.fade_derivative(-1.0), bezier.fade_derivative(1.3)) == (0.0, 0.0)
