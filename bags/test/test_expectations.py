"""Expectations: what they hold and what they refuse to read."""

from __future__ import annotations

import pytest
from synthetic import glide

from cassie_bags.bag.recording import Recording
from cassie_bags.errors import ExperimentError
from cassie_bags.run.expectations import read_expectation
from cassie_bags.signals.metrics import measure
from cassie_bags.signals.track import make_track


def failures(section: object, recording: Recording) -> list[str]:
    expectation = read_expectation(section)
    track = make_track(recording)
    return expectation.failures(measure(recording, track, expectation.phases))


PHASE = {"name": "walk", "t0": 0.5, "t1": 1.5}


def test_a_run_within_its_bounds_passes():
    section = {
        "metrics": {"real_time_factor": {"min": 1.5}, "drift": {"min": 0.9, "max": 1.1}},
        "phases": [{**PHASE, "vx": {"target": 0.5, "tolerance": 0.01}, "vy": {"max": 0.01}}],
    }
    assert failures(section, glide(2.0)) == []


def test_each_broken_bound_is_one_line_with_value_and_range():
    section = {
        "metrics": {"steps": {"min": 3}},
        "phases": [{**PHASE, "vx": {"target": 0.8, "tolerance": 0.1}, "drift": {"max": 0.1}}],
    }
    assert failures(section, glide(2.0)) == [
        "steps = 0, expected >= 3",
        "walk: vx = 0.5, expected 0.7 .. 0.9",
        "walk: drift = 0.499, expected <= 0.1",
    ]


def test_a_fall_fails_a_run_unless_it_is_expected():
    fallen = glide(2.0, tilt_from=1.0)
    assert failures({}, fallen) == ["the robot fell at 1.00 s"]
    assert failures({"fell": True}, fallen) == []
    assert failures({"fell": None}, fallen) == []
    assert failures({"fell": True}, glide(1.0)) == ["the robot did not fall"]


def test_a_phase_that_was_not_reached_fails():
    section = {"phases": [{**PHASE, "t1": 5.0, "vx": {"min": 0.0}}]}
    assert failures(section, glide(2.0)) == ["walk: the run ended before 5 s"]


@pytest.mark.parametrize(
    ("section", "reason"),
    [
        ({"fel": False}, "did you mean fell"),
        ({"fell": "no"}, "expect.fell = 'no' is not true, false or null"),
        ({"metrics": {"real_time_facto": {"min": 1}}}, "did you mean real_time_factor"),
        ({"metrics": {"drift": 3}}, "is not {min, max}"),
        ({"metrics": {"drift": {"most": 3}}}, "unknown key most"),
        ({"metrics": {"drift": {"max": float("nan")}}}, "is not a number"),
        ({"metrics": {"drift": {"min": 2, "max": 1}}}, "nothing lies in"),
        ({"metrics": {"drift": {"target": 2}}}, "both target and tolerance"),
        ({"phases": {}}, None),
        ({"phases": [{"t0": 1.0}]}, "t1 = None is not a number"),
        ({"phases": [{"t0": 2.0, "t1": 1.0}]}, "expected 0 <= t0 < t1"),
        ({"phases": [{**PHASE, "speed": {"max": 1}}]}, "unknown key speed"),
        ([], "is not a mapping"),
    ],
)
def test_a_wrong_section_is_refused_with_the_reason(section: object, reason: str | None):
    if reason is None:
        assert read_expectation(section).phases == ()
        return
    with pytest.raises(ExperimentError, match=reason):
        read_expectation(section)
