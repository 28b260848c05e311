"""What of the operator's commands reaches the controller, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from supervised import CONFIG, PERIOD, STAND, WALK


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        ("vx", -CONFIG.vx_backward, CONFIG.vx_forward),
        ("vy", -CONFIG.vy_limit, CONFIG.vy_limit),
        ("yaw_rate", -CONFIG.yaw_rate_limit, CONFIG.yaw_rate_limit),
        ("roll", -CONFIG.walk_roll, CONFIG.walk_roll),
        ("pitch", -CONFIG.walk_pitch, CONFIG.walk_pitch),
    ],
)
def test_set_points_stay_within_their_limits_walking(walking, name, low, high):
    for commanded, limit in ((-99.0, low), (99.0, high)):
        walking.ask(**{name: commanded})
        assert getattr(walking.run(8.0), name) == pytest.approx(limit)


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        ("height", CONFIG.height_low, CONFIG.height_high),
        ("com_x", -CONFIG.com_x_limit, CONFIG.com_x_limit),
        ("com_y", -CONFIG.com_y_limit, CONFIG.com_y_limit),
        ("roll", -CONFIG.tilt_limit, CONFIG.tilt_limit),
        ("pitch", -CONFIG.tilt_limit, CONFIG.tilt_limit),
        ("trims", -CONFIG.trim_limit, CONFIG.trim_limit),
        ("vx", 0.0, 0.0),
        ("yaw_rate", 0.0, 0.0),
    ],
)
def test_set_points_stay_within_their_limits_standing(standing, name, low, high):
    for commanded, limit in ((-99.0, low), (99.0, high)):
        standing.ask(**{name: commanded})
        assert getattr(standing.run(8.0), name) == pytest.approx(limit)


@pytest.mark.parametrize(
    ("name", "rate"),
    [
        ("vx", CONFIG.acceleration),
        ("vy", CONFIG.acceleration),
        ("yaw_rate", CONFIG.turn_acceleration),
        ("pitch", CONFIG.tilt_rate),
    ],
)
def test_set_points_change_no_faster_than_permitted(walking, name, rate):
    approaches(walking, name, rate)


def test_trims_change_no_faster_than_permitted(standing):
    approaches(standing, "trims", CONFIG.tilt_rate)


def approaches(scene, name, rate):
    """A set-point comes to its command at a rate."""
    scene.ask(**{name: 0.09})
    before = np.copy(getattr(scene.run(), name))
    while np.max(before) < 0.09 - rate * PERIOD:
        after = np.copy(getattr(scene.run(), name))
        assert after - before == pytest.approx(rate * PERIOD, abs=1e-9)
        before = after


FIELDS = ("vx", "vy", "yaw_rate", "height", "com_x", "com_y", "roll", "pitch", "trims")


@pytest.mark.parametrize("name", FIELDS)
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_command_that_is_no_number_is_refused(walking, name, value):
    good = {"vx": 0.3, "pitch": 0.05, "yaw_rate": 0.2}
    walking.ask(**good)
    walking.run(2.0)
    walking.ask(**{"yaw_rate": 0.5, name: value})
    mode = walking.run(3.0)
    assert np.isfinite(mode.floats).all()
    assert walking.mode is WALK  # the last good command, without its speeds
    assert (float(mode.vx), float(mode.yaw_rate)) == (0.0, 0.0)
    assert float(mode.pitch) == pytest.approx(0.05)
    place = f"{name}[0]" if name == "trims" else name
    fault = f"operator command refused: {place} is {value:g}, must be finite"
    assert walking.core.status.faults == (fault,)
    walking.ask(**{name: 0.1, **good})
    assert float(walking.run(2.0).vx) == pytest.approx(0.3)
    assert walking.core.status.faults == ()


def test_a_refused_first_command_lets_nothing_through(scene):
    scene.ask(vx=math.nan, mode=int(WALK))
    mode = scene.run(3.0)
    assert scene.mode is STAND
    assert float(mode.vx) == 0.0


def test_after_a_lost_operator_a_refused_command_does_not_bring_walking_back(walking):
    walking.ask(link=False)
    walking.run(4.0)
    assert walking.mode is STAND
    walking.ask(link=True, vx=math.nan)
    walking.run(4.0)
    assert walking.mode is STAND


def test_an_unknown_mode_is_refused(walking):
    walking.ask(mode=9, vx=0.4)
    mode = walking.run(2.0)
    assert walking.mode is WALK
    assert float(mode.vx) == 0.0
    assert walking.core.status.faults == ("operator command refused: mode is 9, must be 0 .. 4",)


def test_what_is_asked_for_at_once_is_scaled_down_as_a_whole(walking):
    walking.ask(vx=CONFIG.vx_forward, vy=CONFIG.vy_limit, yaw_rate=-CONFIG.yaw_rate_limit)
    mode = walking.run(12.0)
    share = 3.0 ** (-1.0 / 3.0)
    assert mode.vx == pytest.approx(share * CONFIG.vx_forward)
    assert mode.vy == pytest.approx(share * CONFIG.vy_limit)
    assert mode.yaw_rate == pytest.approx(-share * CONFIG.yaw_rate_limit)
