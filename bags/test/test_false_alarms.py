"""Healthy sensors are believed where a robot is hit, shaken or let down."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from cassie_bags.run.cores import connect, make_cores
from cassie_bags.run.experiment import load_experiment
from cassie_bags.run.seed import resolve
from cassie_bags.studies.run_trial import experiment_of
from cassie_bags.studies.sweep.course import Budget
from cassie_bags.studies.sweep.table import chosen_rows
from cassie_bags.studies.trial import Trial
from cassie_control.estimator import channels
from cassie_msgs.experiment.file import Experiment
from cassie_msgs.layout import RobotState

EXPERIMENTS = Path(__file__).parents[1] / "experiments"


def first_alarm(experiment: Experiment, seconds: float) -> tuple[float, tuple[str, ...]]:
    """When a channel is first not believed, and which; the end and nothing if none is."""
    alarm: list[tuple[float, tuple[str, ...]]] = []
    state = RobotState()

    def look(topic: str, raw: bytes, _stamp: int) -> None:
        if topic == RobotState.TOPIC and not alarm:
            state.load(raw)
            if mask := int(state.sensor_faults):
                alarm.append((state.stamp_ns * 1e-9, channels.names(mask)))

    loop = connect(make_cores(experiment), look)
    for _ in range(round(seconds / 0.002)):
        loop.tick()
        if alarm:
            return alarm[0]
    return seconds, ()


def trial(row: str, seed: int) -> Trial:
    (found,) = (each for each in chosen_rows([row]) if each.name == row)
    trials = found.trials(Budget(seeds=10, phases=10, seconds=40.0), found.target)
    return next(each for each in trials if each.seed == seed)


def test_the_chatter_of_a_pillar_at_the_hip_is_no_spike_of_the_accelerometer():
    experiment = resolve(load_experiment(EXPERIMENTS / "waxed_floor.yaml", (), 10))
    assert first_alarm(experiment, 16.4) == (16.4, ())


def test_the_hard_landings_of_random_sticks_are_no_late_accelerometer():
    sticks = dataclasses.replace(trial("radio.jumps", 3), changes=("gait_library=dense",))
    assert first_alarm(experiment_of(sticks), 42.0) == (42.0, ())


def test_a_robot_that_is_let_down_has_no_spikes():
    assert first_alarm(experiment_of(trial("stand_recovery.fore", 2)), 2.0) == (2.0, ())


@pytest.mark.parametrize("seed", [3, 7])
def test_a_load_on_the_pelvis_is_no_late_accelerometer(seed):
    """8 kg: it turns with the pelvis, and what was expected explained nothing of what came."""
    assert first_alarm(experiment_of(trial("payload.in_place", seed)), 12.0) == (12.0, ())
