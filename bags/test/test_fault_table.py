"""Sensors that fail while Cassie stands and walks under its own control."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from cassie_bags.run.cores import connect, make_cores
from cassie_bags.studies.faults import (
    FAULT_KINDS,
    MODES,
    Cell,
    FaultOutcome,
    describe,
    error_of,
    run_table,
    table,
)
from cassie_bags.studies.faults import experiment_of as fault_experiment
from cassie_bags.studies.run_trial import experiment_of
from cassie_bags.studies.sweep.course import Budget, walk
from cassie_bags.studies.sweep.table import chosen_rows
from cassie_msgs.experiment.file import Experiment
from cassie_msgs.experiment.scenario import SensorFault
from cassie_msgs.layout import MotorCommand, RobotMode, Sensors

CHANNELS = ("orientation", "linear_acceleration.2", "drive_position.3", "joint_velocity.1")


@pytest.mark.parametrize("mode", MODES)
def test_no_fault_makes_it_fall_and_each_is_reported(mode):
    kinds = [kind for kind in FAULT_KINDS if kind != "delay"]
    cells = list(run_table(CHANNELS, kinds, [mode], seed=2))
    assert [(cell.channel, cell.kind) for cell in cells] == [
        (c, k) for c in CHANNELS for k in kinds
    ]
    assert {cell.outcome for cell in cells} == {"stands"}
    assert all(cell.safe for cell in cells), [describe(cell) for cell in cells]
    assert all(cell.others == () for cell in cells)


@pytest.mark.parametrize("channel", ["drive_torque.3", "drive_torque.9"])
def test_a_torque_that_is_no_number_stops_it_and_no_more(channel):
    (cell,) = run_table([channel], ["nan"], ["walking"], seed=2)
    assert (cell.outcome, cell.latency) == ("stands", 0.0)
    assert cell.others == ()


@pytest.mark.parametrize("learned", ["use", "none"])
def test_a_late_knee_that_moves_from_rest_is_not_taken_for_its_velocity(monkeypatch, learned):
    def without_or_with(mode: str, seed: int) -> Experiment:
        experiment = fault_experiment(mode, seed)
        return replace(experiment, controller={"learned_torques": learned})

    monkeypatch.setattr("cassie_bags.studies.faults.experiment_of", without_or_with)
    (cell,) = run_table(["drive_position.8"], ["delay"], ["walking"], seed=1)
    assert cell.safe, describe(cell)
    assert cell.others == ()


@pytest.mark.parametrize(
    ("row", "level", "seed", "duration"),
    [
        pytest.param("delay.torque", 3.0, 103, 15.0, id="late-torques-are-no-late-accelerometer"),
        pytest.param("stand_late.both", 0.0, 102, 1.0, id="a-slackening-cable-is-no-spike"),
    ],
)
def test_healthy_sensors_are_accepted(row: str, level: float, seed: int, duration: float):
    trial = next(
        one
        for one in chosen_rows([row])[0].trials(Budget(seeds=10, first=101), level)
        if one.seed == seed
    )
    cores = make_cores(experiment_of(trial))
    loop = connect(cores, lambda *_: None)
    for _ in range(round(duration / 0.002)):
        loop.tick()
        assert cores.estimator.faults == ()


def test_the_hard_touchdowns_of_a_fast_walk_are_no_faults():
    cores = make_cores(experiment_of(walk(2, (8.0, 13.0), vx=1.3)))
    loop = connect(cores, lambda *_: None)
    for _ in range(6500):
        loop.tick()
        assert cores.estimator.faults == ()
    assert cores.supervisor.status.mode == RobotMode.WALK


def test_a_knee_that_tells_nothing_at_all_damps_the_drives():
    faults = [
        SensorFault(t=2.5, channel=channel, kind="nan")
        for channel in ("drive_position.3", "drive_velocity.3")
    ]
    command = MotorCommand()

    def observe(topic: str, raw: bytes, _: int) -> None:
        if topic == MotorCommand.TOPIC:
            command.load(raw)

    loop = connect(make_cores(replace(fault_experiment("standing", 2), faults=faults)), observe)
    stiff = []
    for _ in range(1500):
        loop.tick()
        stiff.append(command.kp.any())
    assert stiff[1249]
    assert not any(stiff[1500 - 100 :])


def test_the_same_fault_ends_the_same():
    again = [next(iter(run_table(["joint_position.1"], ["stuck"], ["walking"], 3))) for _ in (1, 2)]
    assert again[0] == again[1]


def test_damping_after_a_fall_is_a_fall_and_sinking_in_damping_is_none():
    def outcome(*ticks, standing=False):
        watched = FaultOutcome()
        for height, tilt, damped in ticks:
            watched.note(height, tilt, damped=damped)
        return watched.outcome(standing=standing)

    up, tipping, down = (0.95, 0.0), (0.9, 0.8), (0.3, 1.2)
    assert outcome((*up, False), (*tipping, False), (*down, True)) == "falls"
    assert outcome((*up, False), (*up, True), (*down, True), (*down, False)) == "damps"
    assert outcome((*up, False)) == "goes on"
    assert outcome((*up, False), standing=True) == "stands"


def test_errors_by_channel():
    truth, sample = Sensors(), Sensors()
    truth.orientation[3] = 1.0
    sample.orientation[:] = (0.0, 0.0, math.sin(0.05), math.cos(0.05))
    sample.drive_velocity[2] = -0.7
    sample.joint_position[1] = np.nan
    assert error_of("orientation", truth, sample) == pytest.approx(0.1)
    assert error_of("drive_velocity.2", truth, sample) == pytest.approx(0.7)
    assert error_of("joint_position.1", truth, sample) == math.inf


def test_what_is_late_or_unreported_is_not_safe():
    late = Cell("drive_position.3", "stuck", "walking", 0.1, 0.3, (), "stands")
    silent = Cell("drive_position.3", "off", "walking", 0.1, None, (), "stands")
    harmless = Cell("drive_position.3", "delay", "walking", None, None, (), "goes on")
    down = Cell("drive_position.3", "nan", "walking", 0.0, 0.0, (), "falls")
    assert [cell.safe for cell in (late, silent, harmless, down)] == [False, False, True, False]
    assert table([late, silent, harmless, down])[-1] == (
        "| `drive_position.3` | walking | stands, NOT reported | stands, 200 ms | falls, 0 ms | "
        "| goes on, no error |"
    )
