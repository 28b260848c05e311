"""Gait library in memory: interpolation, clamping, mirror image, refusals."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cassie_gaits.errors import GaitLibraryError
from cassie_gaits.gait_library import OUTPUTS, Gait, GaitLibrary, Provenance, mirror
from cassie_gaits.model_hash import model_hash
from cassie_gaits.virtual_leg import roll

RNG = np.random.default_rng(3)


def gait(vx: float, step_time: float = 0.4, **changes) -> Gait:
    return Gait(
        vx, 0.0, 0.0, step_time, changes.pop("coefficients", RNG.normal(size=(2, 9, 6))), **changes
    )


def library(*gaits: Gait, kind: str = "optimized") -> GaitLibrary:
    return GaitLibrary(gaits, kind, model_hash(), Provenance("test", "1", "2025-01-31"))


GAITS = (gait(-0.5, 0.5), gait(0.0, 0.4), gait(1.0, 0.25))
LIBRARY = library(*GAITS)


@pytest.mark.parametrize("entry", GAITS)
def test_a_gait_comes_back_at_its_own_speed(entry):
    right, left, step_time = LIBRARY.interpolate(entry.vx)
    np.testing.assert_allclose([right, left], entry.coefficients, atol=1e-15)
    assert step_time == pytest.approx(entry.step_time)


def test_coefficients_and_step_frequency_are_linear_in_the_speed():
    right, left, step_time = LIBRARY.interpolate(0.25)
    expected = 0.75 * GAITS[1].coefficients + 0.25 * GAITS[2].coefficients
    np.testing.assert_allclose([right, left], expected, atol=1e-15)
    assert 1.0 / step_time == pytest.approx(0.75 * 2.5 + 0.25 * 4.0)


@pytest.mark.parametrize(("speed", "entry"), [(-3.0, GAITS[0]), (1.2, GAITS[2])])
def test_speed_outside_the_range_is_clamped(speed, entry):
    right, left, step_time = LIBRARY.interpolate(speed)
    np.testing.assert_array_equal([right, left], entry.coefficients)
    assert step_time == entry.step_time


def test_result_belongs_to_the_caller():
    right, _, _ = LIBRARY.interpolate(0.3)
    again, _, _ = LIBRARY.interpolate(0.3)
    again[:] = 0.0
    np.testing.assert_array_equal(LIBRARY.interpolate(0.3)[0], right)
    clamped, _, _ = LIBRARY.interpolate(5.0)
    clamped[:] = 0.0
    assert GAITS[2].coefficients[0].any()


def test_one_gait_serves_every_speed():
    assert library(gait(0.5, 0.3)).interpolate(0.0)[2] == 0.3


@pytest.mark.parametrize("speed", [math.nan, math.inf, -math.inf])
def test_speed_that_is_not_finite_is_refused(speed):
    with pytest.raises(GaitLibraryError, match="gait speed"):
        LIBRARY.interpolate(speed)


@pytest.mark.parametrize("speeds", [(0.0, 0.0), (0.5, 0.25)])
def test_speeds_that_do_not_rise_are_refused(speeds):
    with pytest.raises(GaitLibraryError, match="rising"):
        library(*(gait(speed) for speed in speeds))


def test_speeds_that_span_a_huge_grid_are_refused():
    gaits = [Gait(0.1 * i, 0.1 * i, 0.1 * i, 0.4, np.zeros((2, 9, 6))) for i in range(22)]
    with pytest.raises(GaitLibraryError, match="a grid of 10648 points, expected at most 10000"):
        library(*gaits)


def test_unknown_kind_and_empty_library_are_refused():
    with pytest.raises(GaitLibraryError, match="kind is 'guessed'"):
        library(gait(0.0), kind="guessed")
    with pytest.raises(GaitLibraryError, match="no gait"):
        library()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"coefficients": np.zeros((2, 9, 5))}, "coefficients have shape"),
        ({"coefficients": np.full((2, 9, 6), math.nan)}, "coefficients hold"),
        ({"torques": np.zeros((2, 9, 6))}, "torques have shape"),
        ({"step_time": 0.0}, "step_time"),
        ({"step_time": math.nan}, "step_time"),
    ],
)
def test_damaged_gait_is_refused(changes, message):
    with pytest.raises(GaitLibraryError, match=message):
        gait(0.0, **changes)


def test_gaits_cannot_be_changed():
    with pytest.raises(ValueError, match="read-only"):
        GAITS[0].coefficients[0, 0, 0] = 1.0
    with pytest.raises(AttributeError):
        LIBRARY.kind = "imported"  # type: ignore[misc]


def test_mirror_changes_the_sign_of_rolls_and_yaws_only():
    changed = [
        name for name, row in zip(OUTPUTS, mirror(np.ones((9, 6))), strict=True) if row[0] < 0
    ]
    assert changed == ["torso_roll", "stance_hip_yaw", "swing_leg_roll", "swing_hip_yaw"]


def test_mirror_twice_is_the_same_gait():
    alpha = RNG.normal(size=(9, 6))
    np.testing.assert_array_equal(mirror(mirror(alpha)), alpha)


def test_mirror_agrees_with_the_legs():
    # Seen in a mirror, a left hip rolled by 0.2 with the torso at 0.05 is a right one.
    left, right = roll(0.05, 0.2), roll(-0.05, -0.2)
    assert mirror(np.full((9, 1), left))[OUTPUTS.index("swing_leg_roll")] == pytest.approx(right)
