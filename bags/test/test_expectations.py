"""Expectations: what they hold and what they refuse to read."""

from __future__ import annotations

from dataclasses import replace

import pytest
from synthetic import glide

from cassie_bags.bag.recording import Recording
from cassie_bags.run.cuts import Cut, cuts_of
from cassie_bags.run.experiment import parse_experiment
from cassie_bags.run.judge import checks
from cassie_bags.run.seed import resolve
from cassie_bags.signals.metrics import measure
from cassie_bags.signals.track import make_track
from cassie_msgs.experiment.expectation import Expectation, Phase
from cassie_msgs.layout import Mode, OperatorCommand, RobotMode
from cassie_msgs.structured import structure
from cassie_msgs.tunables import ParameterError


def failures(section: object, recording: Recording) -> list[str]:
    expectation = structure(Expectation, section, "expect")
    track = make_track(recording)
    found = checks(expectation, measure(recording, track, expectation.phases))
    return [check.problem for check in found if check.problem]


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


def cut(text: str, mode: RobotMode = RobotMode.WALK, **commanded: float) -> list[Cut]:
    """Cuts of a run of an experiment with some supervisor, from its recorded commands."""
    experiment = resolve(parse_experiment(f"start: standing\nduration: 2.0\n{text}", "try"))
    recording = glide(2.0)
    lane = {topic: rows.copy() for topic, rows in recording.lane.items()}
    for topic in (OperatorCommand.TOPIC, Mode.TOPIC):
        lane[topic]["mode"] = mode
    for name, value in commanded.items():
        lane[OperatorCommand.TOPIC][name] = value
    return list(cuts_of(experiment, replace(recording, lane=lane), [Phase("w", 0.5, 1.5)]))


@pytest.mark.parametrize(
    ("text", "mode", "commanded", "expected"),
    [
        ("", RobotMode.WALK, {"vx": 1.2}, []),
        (
            "",
            RobotMode.WALK,
            {"vx": 2.2},
            ["vx = 2.2 m/s was cut to 1.2 m/s by supervisor.vx"],
        ),
        (
            "",
            RobotMode.WALK,
            {"vx": -1.0},
            ["vx = -1 m/s was cut to -0.7 m/s by supervisor.vx_b"],
        ),
        ("supervisor: {vx_forward: 2.3}", RobotMode.WALK, {"vx": 2.2}, []),
        ("", RobotMode.STAND, {"vx": 2.2, "height": 0.9}, []),
        (
            "",
            RobotMode.STAND,
            {"height": 1.2},
            ["height = 1.2 m was cut to 1.01 m by supervisor.h"],
        ),
        (
            "",
            RobotMode.SEGWAY,
            {"vx": 5.0},
            ["vx = 5 m/s was cut to 4.2 m/s by supervisor.ride"],
        ),
        (
            "",
            RobotMode.SEGWAY,
            {"vy": 0.1},
            ["vy = 0.1 m/s was cut to 0 m/s: a Segway does"],
        ),
        (
            "",
            RobotMode.WALK,
            {"vx": 1.2, "yaw_rate": -0.8},
            [
                "vx = 1.2 m/s was cut to 0.9524 m/s by supervisor.vx_forward, "
                "supervisor.yaw_rate_limit, as speeds are bounded together",
                "yaw_rate = -0.8 rad/s was cut to -0.635 rad/s by supervisor.vx_forward, ",
            ],
        ),
    ],
)
def test_a_command_that_the_supervisor_cuts_is_told_with_the_parameter(
    text: str, mode: RobotMode, commanded: dict[str, float], expected: list[str]
):
    found = [str(each) for each in cut(text, mode, **{"vx": 0.0, **commanded})]
    assert len(found) == len(expected)
    for line, words in zip(found, expected, strict=True):
        assert line.startswith(f"w: the command {words}")


@pytest.mark.parametrize(
    ("section", "reason"),
    [
        ({"fel": False}, "did you mean fell"),
        ({"fell": "no"}, "expect.fell = 'no' is not true or false"),
        ({"metrics": {"real_time_facto": {"min": 1}}}, "did you mean real_time_factor"),
        ({"metrics": {"drift": 3}}, "expect.metrics.drift = 3 is not {min, max} or {target, tol"),
        ({"metrics": {"drift": {"most": 3}}}, "expect.metrics.drift: unknown key most"),
        ({"metrics": {"drift": {}}}, "expect.metrics.drift: expected {min, max} or {target, tol"),
        ({"metrics": {"drift": {"max": float("nan")}}}, "metrics.drift.max = nan is outside"),
        ({"metrics": {"drift": {"min": 2, "max": 1}}}, "nothing lies in"),
        ({"metrics": {"drift": {"target": 2}}}, "both target and tolerance"),
        ({"phases": None}, None),
        ({"phases": {}}, "expect.phases = {} is not a list"),
        ({"phases": [{"t0": 1.0}]}, "expect.phases.0.t1 must be given"),
        ({"phases": [{"t0": 2.0, "t1": 1.0}]}, "expected 0 <= t0 < t1"),
        ({"phases": [{**PHASE, "speed": {"max": 1}}]}, "expect.phases.0: unknown key speed"),
        ({"phases": [{**PHASE, "vx": {"min": "fast"}}]}, "phases.0.vx.min = 'fast' is not a numb"),
        ([], "is not a mapping"),
    ],
)
def test_a_wrong_section_is_refused_with_the_reason(section: object, reason: str | None):
    if reason is None:
        assert structure(Expectation, section, "expect").phases == ()
        return
    with pytest.raises(ParameterError, match=reason):
        structure(Expectation, section, "expect")
