"""Virtual leg: round trips, rates by finite differences, known answers, refusals."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cassie_gaits import virtual_leg
from cassie_gaits.errors import LegLengthError

length_of, length_rate_of = np.vectorize(virtual_leg.length), np.vectorize(virtual_leg.length_rate)
pitch_of, pitch_rate_of = np.vectorize(virtual_leg.pitch), np.vectorize(virtual_leg.pitch_rate)
foot_pitch_of, toe_of = np.vectorize(virtual_leg.foot_pitch), np.vectorize(virtual_leg.toe_angle)
knee_of, knee_rate_of = np.vectorize(virtual_leg.knee_angle), np.vectorize(virtual_leg.knee_rate)
hip_of = np.vectorize(virtual_leg.hip_pitch_angle)
hip_rate_of = np.vectorize(virtual_leg.hip_pitch_rate)
KNEES = np.radians([[-160.0, -37.0], [-120.0, -60.0], [-75.0, -100.0]])


@pytest.mark.parametrize("knee", KNEES)
def test_knee_angle_inverts_leg_length(knee):
    np.testing.assert_allclose(knee_of(length_of(knee)), knee, atol=1e-13)


@pytest.mark.parametrize("knee", KNEES)
def test_hip_pitch_angle_inverts_leg_pitch(knee):
    hip_pitch = np.array([0.3, -0.2])
    leg_pitch = pitch_of(0.15, hip_pitch, knee)
    back = hip_of(leg_pitch, 0.15, length_of(knee))
    np.testing.assert_allclose(back, hip_pitch, atol=1e-13)


def test_toe_angle_inverts_foot_pitch_with_and_without_spring_deflection():
    hip_pitch, toe = np.array([0.5, 0.6]), np.array([-1.6, -1.3])
    for total in ([0.2, 0.25], [math.radians(13)] * 2):
        foot = foot_pitch_of(-0.1, hip_pitch, toe, total)
        np.testing.assert_allclose(toe_of(foot, -0.1, hip_pitch, total), toe, atol=1e-14)


@pytest.mark.parametrize("knee", KNEES)
def test_agrees_with_the_corrected_print(knee):
    c = np.cos(knee + 0.035)
    length = np.sqrt(0.5292 * c + 0.5301)
    np.testing.assert_allclose(length_of(knee), length, atol=1.2e-4)
    hip_pitch = np.array([0.4, 0.5])
    printed = -0.1 + hip_pitch - np.arccos((0.5 * c + 0.5292) / length) + 0.1
    np.testing.assert_allclose(pitch_of(0.1, hip_pitch, knee), printed, atol=3e-4)
    inverse = printed + 0.1 + np.arccos((0.9448 * length**2 + 0.0284) / length) - 0.1
    np.testing.assert_allclose(hip_of(printed, 0.1, length), inverse, atol=5e-4)
    np.testing.assert_allclose(
        knee_of(length), -np.arccos(1.8896 * length**2 - 1.0017) - 0.035, atol=7e-4
    )


def test_foot_pitch_of_the_relaxed_leg_uses_63_degrees():
    np.testing.assert_allclose(
        foot_pitch_of(0.2, [0.5, 0.4], [-1.5, -1.4]),
        [-0.2 + 0.5 - 1.5 + 1.0995574, -0.2 + 0.4 - 1.4 + 1.0995574],
        atol=1e-7,
    )


def test_leg_roll_adds_torso_and_hip():
    np.testing.assert_allclose([virtual_leg.roll(0.02, hip) for hip in (0.1, -0.1)], [0.12, -0.08])


@pytest.mark.parametrize("knee", KNEES)
def test_forward_rates_match_finite_differences(knee):
    rate, hip_rate, pitch_rate, step = np.array([0.7, -1.1]), np.array([0.4, 0.9]), -0.3, 1e-6
    hip = np.array([0.5, 0.6])
    moved = [
        (
            length_of(knee + s * rate),
            pitch_of(s * pitch_rate, hip + s * hip_rate, knee + s * rate),
        )
        for s in (step, -step)
    ]
    length_rate, leg_pitch_rate = ((a - b) / (2 * step) for a, b in zip(*moved, strict=True))
    np.testing.assert_allclose(length_rate_of(knee, rate), length_rate, atol=1e-8)
    np.testing.assert_allclose(
        pitch_rate_of(knee, pitch_rate, hip_rate, rate), leg_pitch_rate, atol=1e-8
    )


@pytest.mark.parametrize("length", [[0.3, 0.97], [0.6, 0.8]])
def test_inverse_rates_match_finite_differences(length):
    length = np.array(length)
    length_rate, leg_pitch, leg_pitch_rate = (
        np.array([0.4, -0.5]),
        np.array([0.1, -0.2]),
        np.array([1.0, -2.0]),
    )
    step = 1e-6
    moved = [
        (
            knee_of(length + s * length_rate),
            hip_of(leg_pitch + s * leg_pitch_rate, 0.1 + s * 0.3, length + s * length_rate),
        )
        for s in (step, -step)
    ]
    knee_rate, hip_rate = ((a - b) / (2 * step) for a, b in zip(*moved, strict=True))
    np.testing.assert_allclose(
        knee_rate_of(knee_of(length), length, length_rate), knee_rate, atol=1e-7
    )
    np.testing.assert_allclose(
        hip_rate_of(knee_of(length), leg_pitch_rate, 0.3, knee_rate), hip_rate, atol=1e-7
    )


@pytest.mark.parametrize("length", [1.03, 0.02, math.nan])
def test_unreachable_length_is_refused_with_value_and_range(length):
    with pytest.raises(LegLengthError, match=f"leg length {length:.4f} m is outside 0.0292"):
        virtual_leg.knee_angle(length)


def test_clamped_length_is_within_the_stops():
    low, high = virtual_leg.LENGTH_LIMITS
    assert (round(low, 3), round(high, 3)) == (0.225, 0.982)
    clamped = [virtual_leg.clamp_length(length) for length in (0.0, 2.0, 0.5, 0.9)]
    assert clamped == [low, high, 0.5, 0.9]
