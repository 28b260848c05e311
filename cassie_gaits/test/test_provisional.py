"""Provisional library: what its steps must do, and that the packaged file is its output."""

from __future__ import annotations

import numpy as np
import pytest

from cassie_gaits import bezier
from cassie_gaits.errors import GaitLibraryError
from cassie_gaits.gait_library import OUTPUTS, mirror
from cassie_gaits.gait_library_file import load_library
from cassie_gaits.provisional import SPEEDS, main, provisional_library

LIBRARY = provisional_library(date="2025-01-31")
PITCH, LENGTH = OUTPUTS.index("swing_leg_pitch"), OUTPUTS.index("swing_leg_length")


def foot(gait, phase):
    """Position of the swing foot from the hip and its rate, forward and up. In m and m/s."""
    state = gait.coefficients[0] @ bezier.basis(phase)
    (pitch, pitch_rate), (length, length_rate) = state[PITCH, :2], state[LENGTH, :2]
    outward = np.array([np.sin(pitch), -np.cos(pitch)])
    across = np.array([np.cos(pitch), np.sin(pitch)])
    rate = (length_rate * outward + length * pitch_rate * across) / gait.step_time
    return length * outward, rate


@pytest.mark.parametrize("gait", LIBRARY.gaits)
def test_foot_goes_from_half_a_step_behind_to_half_a_step_ahead(gait):
    half = 0.5 * gait.vx * gait.step_time
    start, end = foot(gait, 0.0)[0], foot(gait, 1.0)[0]
    np.testing.assert_allclose([start[0], end[0]], [-half, half], atol=1e-9)
    assert start[1] == pytest.approx(end[1], abs=1e-9)


@pytest.mark.parametrize("gait", LIBRARY.gaits)
def test_foot_is_at_rest_on_the_ground_fore_and_aft_and_comes_down_gently(gait):
    start, end = foot(gait, 0.0)[1], foot(gait, 1.0)[1]
    np.testing.assert_allclose([start[0], end[0]], -gait.vx, atol=1e-3)
    assert start[1] == pytest.approx(0.0, abs=2e-3)
    assert end[1] == pytest.approx(-0.2, abs=2e-3)


@pytest.mark.parametrize("gait", LIBRARY.gaits)
def test_foot_clears_the_ground(gait):
    heights = [foot(gait, phase)[0][1] - foot(gait, 0.0)[0][1] for phase in np.linspace(0, 1, 21)]
    assert heights[10] == pytest.approx(0.15, abs=5e-4)
    assert min(heights) > -1e-6


@pytest.mark.parametrize("gait", LIBRARY.gaits)
def test_legs_are_mirror_images_and_the_torso_stays_upright(gait):
    np.testing.assert_array_equal(gait.coefficients[1], mirror(gait.coefficients[0]))
    for name in ("torso_roll", "torso_pitch", "stance_hip_yaw", "swing_foot_pitch"):
        assert not gait.coefficients[:, OUTPUTS.index(name)].any()


def test_swing_starts_where_the_other_step_left_the_leg():
    for gait in LIBRARY.gaits:
        stance = gait.coefficients[1, OUTPUTS.index("stance_leg_length")]
        assert gait.coefficients[0, LENGTH, 0] == pytest.approx(stance[-1])


def test_library_says_that_it_is_provisional_and_has_the_seven_speeds():
    assert LIBRARY.kind == "provisional"
    assert tuple(gait.vx for gait in LIBRARY.gaits) == SPEEDS


@pytest.mark.parametrize(
    "wrong", [{"leg_length": 1.2}, {"clearance": 0.7}, {"clearance": -0.1}, {"speeds": (4.0,)}]
)
def test_unreachable_step_is_refused(wrong):
    with pytest.raises(GaitLibraryError):
        provisional_library(**wrong)


def test_command_writes_the_file_and_says_why_when_it_cannot(tmp_path, capsys):
    assert main([str(tmp_path / "library.json"), "--date", "2025-01-31"]) == 0
    assert load_library(tmp_path / "library.json").provenance.date == "2025-01-31"
    assert main([str(tmp_path / "missing" / "library.json")]) == 2
    assert "No such file" in capsys.readouterr().err
