"""A run of the cores in one process: deterministic, on the schedule, refused where it must be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from same import differences

from cassie_bags.bag.continuity import gaps
from cassie_bags.bag.recording import TYPES, Recording, read_recording
from cassie_bags.bag.summary import summarize
from cassie_bags.errors import ExperimentError
from cassie_bags.report.pictures import PosedModel
from cassie_bags.run.bag_observer import bag_observer
from cassie_bags.run.cores import check_parameters, make_loop, tick_count
from cassie_bags.run.experiment import parse_experiment
from cassie_bags.run.seed import resolve
from cassie_bags.run.simulate import RecentStore, Store, run
from cassie_bags.run.verify import verify
from cassie_bags.signals.track import make_track
from cassie_control.control.gait_controller import GaitController
from cassie_msgs.experiment.file import Experiment
from cassie_msgs.layout import (
    ControllerStatus,
    Gait,
    GaitRequest,
    GaitResult,
    Mode,
    MotorCommand,
    OperatorCommand,
    RobotMode,
    RobotState,
    Sensors,
)

TEXT = """
start: standing
seed: 4
duration: 1.5
operator:
  - {t: 0.0, power: true, mode: stand, height: 0.95}
pushes:
  - {t: 0.5, duration: 0.1, force: [20.0, 0.0, 0.0]}
"""


def read(text: str = TEXT) -> Experiment:
    return resolve(parse_experiment(text, "try"))


def record(experiment: Experiment) -> Recording:
    store = Store()
    return store.recording(run(make_loop(experiment, store), range(tick_count(experiment))))


@pytest.fixture(scope="module")
def recording() -> Recording:
    return record(read())


def test_the_same_seed_gives_the_same_bytes(recording: Recording):
    assert differences(recording, record(read()), TYPES) == []


def test_another_seed_gives_another_run(recording: Recording):
    other = record(read(TEXT.replace("seed: 4", "seed: 5")))
    assert "/cassie/ground_truth" in " ".join(differences(recording, other, TYPES))


def test_every_tick_is_there(recording: Recording):
    assert gaps(recording) == []
    assert len(recording.truth) == 750
    assert len(recording.lane["/cassie/mode"]) == 75


def test_scripted_power_takes_effect_ten_ticks_after_the_state_it_answers(recording: Recording):
    power = recording.rows(Sensors)["power"]
    assert power[10] == 0.0  # switched in the step of tick 10
    assert power[11] == 1.0


def test_modes_and_commands_hold_ten_ticks_later(recording: Recording):
    for kind in (Mode, OperatorCommand):
        rows = recording.rows(kind)
        np.testing.assert_array_equal(rows["effective_seq"], rows["seq"] + 10)
    assert RobotMode.STAND in recording.rows(Mode)["mode"]


def test_the_bag_of_a_run_holds_the_run_and_its_file(tmp_path: Path, recording: Recording):
    paths = [tmp_path / "one.mcap", tmp_path / "other.mcap"]
    for path in paths:
        with bag_observer(path, read()) as bag:
            run(make_loop(read(), bag), range(750))
    assert paths[0].read_bytes() == paths[1].read_bytes()
    copy = read_recording(paths[0])
    assert differences(copy, recording, TYPES) == []
    again = parse_experiment(copy.metadata["cassie_experiment"]["file"], "bag")
    assert again.scenario == read().scenario


WALK = """
start: standing
duration: 7.0
operator:
  - {t: 0.0, power: true}
  - {t: 1.0, mode: walk}
  - {t: 3.0, vx: 0.4}
controller: {gait_source: optimizer}
"""


def test_gaits_made_in_one_process_are_in_the_bag_which_replays_to_the_last_bit(tmp_path: Path):
    experiment, path = read(WALK), tmp_path / "made.mcap"
    with bag_observer(path, experiment) as bag:
        run(make_loop(experiment, bag), range(tick_count(experiment)))
    recording = read_recording(path)
    requests, gaits = recording.rows(GaitRequest), recording.rows(Gait)
    assert len(requests) == len(gaits) >= 5
    np.testing.assert_array_equal(gaits["seq"], requests["seq"])
    assert (gaits["result"] == GaitResult.FOUND).all()
    assert gaits["vx"][-1] == 0.4
    assert summarize(path).made_gaits == {"found": len(gaits)}
    found = verify(path)
    assert found.gaps == [] and found.differences == []
    library = record(read(WALK.replace("optimizer", "library")))
    commands = recording.rows(MotorCommand)["position"]
    assert (commands != library.rows(MotorCommand)["position"]).any()


def test_a_bag_of_a_ride_shows_where_the_segway_is(tmp_path: Path):
    experiment = read("scene: segway\nduration: 0.5\noperator: [{t: 0.0, power: true}]\n")
    store = Store()
    with bag_observer(tmp_path / "ride.mcap", experiment) as bag:
        run(make_loop(experiment, bag), range(250))
    kept = store.recording(run(make_loop(experiment, store), range(250)))
    copy = read_recording(tmp_path / "ride.mcap")
    assert differences(copy, kept, TYPES) == []
    assert len(copy.segway) == len(copy.segway_imu) == 50
    track = make_track(copy)
    assert track.vehicle.shape == (250, 7)
    assert track.wheels.shape == (250, 2)
    posed = PosedModel(experiment.scenario)
    shown = posed.model.joint("segway").qposadr[0]
    place = posed.pose(track, 249)[shown : shown + 3]
    np.testing.assert_array_equal(place, copy.segway["position"][-1])


def test_the_wall_clock_is_not_there_to_pace_a_run():
    with pytest.raises(ExperimentError, match="pacing = realtime needs a wall clock"):
        make_loop(read(TEXT + "simulator: {pacing: realtime}\n"), lambda *_: None)


@pytest.mark.parametrize(
    ("section", "reason"),
    [
        ("simulator: {control_rat: 500}", "simulator: unknown parameter control_rat"),
        ("simulator: {scenario: x.yaml}", "simulator.scenario follows from other keys"),
        ("estimator: {height_bandwidth: -1.0}", "estimator: height_bandwidth = -1"),
        ("controller: {walk: {law: papre}}", "controller: walk.law = 'papre'"),
        ("supervisor: {walk_height: high}", "supervisor: walk_height = 'high' is not a number"),
    ],
)
def test_a_wrong_parameter_is_refused_before_anything_runs(section: str, reason: str):
    with pytest.raises(ExperimentError, match=reason):
        check_parameters(read(TEXT + section + "\n"))


def test_a_missing_gait_library_is_refused():
    experiment = read(TEXT + "gait_library: none.json\n")
    with pytest.raises(ValueError, match=r"none\.json"):
        make_loop(experiment, lambda *_: None)


def test_a_rate_that_does_not_divide_is_refused():
    with pytest.raises(ValueError, match="control_rate = 300 Hz"):
        make_loop(read(TEXT + "simulator: {control_rate: 300}\n"), lambda *_: None)


def test_a_core_that_breaks_damps_and_is_told_of_as_over_dds(monkeypatch: pytest.MonkeyPatch):
    def broken(self: GaitController, state: RobotState, mode: Mode) -> MotorCommand:
        raise KeyError("gain")

    store, experiment = Store(), read()
    loop = make_loop(experiment, store)
    run(loop, range(100))
    assert loop.problems == {}
    monkeypatch.setattr(GaitController, "step", broken)
    wall_time = run(loop, range(100))
    problem, time = loop.problems["gait_controller"]
    assert "KeyError: 'gain' (test_in_process.py:" in problem
    assert time == pytest.approx(0.2)
    recording = store.recording(wall_time)
    assert not recording.rows(MotorCommand)["kp"][100:].any()
    assert recording.rows(ControllerStatus)["seq"].tolist() == list(range(0, 200, 5))


def test_a_store_of_the_last_messages_has_the_end_of_the_run_and_no_more_than_twice_its_span():
    whole, recent = Store(), RecentStore(0.2)

    def both(topic: str, raw: bytes, stamp: int) -> None:
        whole(topic, raw, stamp)
        recent(topic, raw, stamp)

    run(make_loop(read(), both), range(250))
    every, last = (store.recording(0.0).rows(Sensors) for store in (whole, recent))
    assert 100 <= len(last) <= 200
    assert last.tobytes() == every[-len(last) :].tobytes()
