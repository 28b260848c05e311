"""Measures of standing against known answers."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from synthetic import glide

from cassie_bags.signals.track import make_track
from cassie_bags.signals.window import STANDING_MEASURES, measure_standing
from cassie_msgs.layout import ControllerStatus, RobotMode

SPEED = 0.01  # m/s
SECONDS = 4.0


def figures(yaw_rate=0.0, ahead=0.0, walks=(), window=(0.0, SECONDS)):
    """A robot that creeps along a line, its CoM at the end `ahead` of where it began, m."""
    recording = glide(SECONDS, vx=SPEED, yaw_rate=yaw_rate, mode=RobotMode.STAND)
    track = make_track(recording)
    state, status = track.state.copy(), recording.rows(ControllerStatus).copy()
    state["com_position"][:, 0] = np.linspace(0.0, ahead, len(state))
    status["stance_leg"] = -1.0
    for time in walks:
        status["stance_leg"][round(time * 50.0)] = 1.0
    inside = (track.time >= window[0]) & (track.time < window[1])
    return measure_standing(dataclasses.replace(track, state=state), status, inside)


def test_feet_that_creep_along_with_the_robot():
    found = figures()
    # From the middle of the first second to that of the last.
    assert found["creep"] == pytest.approx(SPEED * (SECONDS - 1.0), rel=0.01)
    assert found["com_rms"] == pytest.approx(SPEED * SECONDS / math.sqrt(12.0), rel=0.01)
    assert found["shaking"] == pytest.approx(SPEED, rel=1e-6)
    assert found["height_off"] == pytest.approx(0.0, abs=1e-6)


def test_a_com_that_goes_back_as_the_feet_creep_ahead_stays():
    found = figures(ahead=-SPEED * SECONDS)
    assert found["com_rms"] == pytest.approx(0.0, abs=1e-4)
    assert found["creep"] > 0.02


@pytest.mark.parametrize(("walks", "stepped"), [((), 0.0), ((2.5,), 1.0), ((0.5,), 0.0)])
def test_a_step_within_the_window_is_told(walks, stepped):
    assert figures(walks=walks, window=(1.0, SECONDS))["stepped"] == stepped


def test_a_window_of_less_than_two_seconds_gives_nothing():
    found = figures(window=(0.0, 1.5))
    assert set(found) == set(STANDING_MEASURES)
    assert all(math.isnan(value) for value in found.values())
