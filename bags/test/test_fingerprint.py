"""Fingerprints of runs: one bit is found and named, another machine alone is no difference."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import yaml

from cassie_bags.bag.recording import Recording
from cassie_bags.cli import fingerprint as command
from cassie_bags.run import fingerprint
from cassie_bags.run.bag_observer import bag_observer
from cassie_bags.run.cores import make_loop, tick_count
from cassie_bags.run.experiment import load_experiment, packaged_experiments
from cassie_bags.run.fingerprint import (
    FAST,
    Run,
    default_path,
    differences,
    fields_to_hash,
    fingerprint_of,
    load,
    recording_of,
)
from cassie_bags.run.provenance import environment
from cassie_bags.run.seed import resolve
from cassie_bags.run.simulate import run
from cassie_bags.studies import fingerprints
from cassie_bags.studies.workers import ThisProcess
from cassie_msgs.layout import RobotState

TEXT = """
start: standing
duration: 2.2
operator:
  - {t: 0.0, power: true, mode: stand, height: 0.95}
controller: {stand: {kp_knee: 1000.0}}
"""
GAIN = "1000.0"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "try.yaml"
    path.write_text(TEXT)
    return path


@pytest.fixture
def prints(tmp_path: Path, file: Path, here: None) -> Path:
    """A file of fingerprints of the experiment."""
    path = tmp_path / "prints.yaml"
    assert command.main([str(file), "--renew", "--file", str(path)]) == 0
    return path


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    """One robot, in this process: starting others takes longer than the runs."""
    monkeypatch.setattr(fingerprints, "workers", lambda *_: ThisProcess())
    monkeypatch.setattr(fingerprints, "ROBOTS", (2,))


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    path = tmp_path_factory.mktemp("recorded") / "try.yaml"
    path.write_text(TEXT)
    return recording_of(Run(path, 2))


def change_environment(path: Path) -> None:
    content = yaml.safe_load(path.read_text())
    content["environment"]["numba"] = "0.1"
    path.write_text(yaml.safe_dump(content))


def test_a_part_of_the_experiments_is_as_recorded(capsys: pytest.CaptureFixture[str]):
    assert command.main(["--fast", "--jobs", "1"]) == 0, capsys.readouterr().out


def test_every_experiment_has_fingerprints_of_all_robots():
    runs = load(default_path()).runs
    assert {file.stem for file in packaged_experiments()} == set(runs)
    assert all(tuple(robots) == fingerprint.ROBOTS for robots in runs.values())
    assert set(FAST) <= set(runs)


def test_an_unchanged_run_is_as_recorded(
    file: Path, prints: Path, capsys: pytest.CaptureFixture[str]
):
    assert command.main([str(file), "--file", str(prints)]) == 0
    assert "1 runs as recorded" in capsys.readouterr().out


def test_a_gain_changed_by_a_millionth_is_found_and_named(
    file: Path, prints: Path, capsys: pytest.CaptureFixture[str]
):
    file.write_text(TEXT.replace(GAIN, "1000.000001"))
    assert command.main([str(file), "--file", str(prints)]) == 1
    lines = capsys.readouterr().out.splitlines()
    named = [line.split(maxsplit=3) for line in lines]
    assert ["try", "2", "/cassie/motor_command", "differs between 0 and 1 s"] in named
    assert lines[-1] == "1 of 1 runs differ"
    assert not any("operator_command" in line for line in lines)


def test_with_another_version_the_first_seconds_count_and_the_version_is_named(
    file: Path, prints: Path, capsys: pytest.CaptureFixture[str]
):
    change_environment(prints)
    file.write_text(TEXT.replace(GAIN, "1000.0000000000001"))
    assert command.main([str(file), "--file", str(prints)]) == 0
    told = capsys.readouterr().out
    assert f"numba {environment()['numba']}, recorded 0.1" in told
    file.write_text(TEXT.replace("0.95", "0.85"))
    assert command.main([str(file), "--file", str(prints)]) == 1
    assert "/cassie/state              q differs by " in capsys.readouterr().out


def test_a_field_that_a_later_version_adds_changes_nothing(
    recording: Recording, monkeypatch: pytest.MonkeyPatch
):
    rows = recording.rows(RobotState)
    wider = np.zeros(len(rows), [*rows.dtype.descr, ("mood", float)])
    for name in rows.dtype.names or ():
        wider[name] = rows[name]
    later = dataclasses.replace(recording, lane={**recording.lane, RobotState.TOPIC: wider})
    what, found = Run(Path("try.yaml"), 2), []
    for each in (recording, later):
        monkeypatch.setattr(fingerprint, "recording_of", lambda _, each=each: each)
        found.append(fingerprint_of(what, fields_to_hash()))
    assert differences(what, *found, exactly=True) == []


def test_one_bit_is_found_in_its_second_and_not_before(
    recording: Recording, monkeypatch: pytest.MonkeyPatch
):
    rows = recording.rows(RobotState).copy()
    rows["q"][600, 3] = np.nextafter(rows["q"][600, 3], 1.0)  # at 1.2 s
    later = dataclasses.replace(recording, lane={**recording.lane, RobotState.TOPIC: rows})
    what, found = Run(Path("try.yaml"), 2), []
    for each in (recording, later):
        monkeypatch.setattr(fingerprint, "recording_of", lambda _, each=each: each)
        found.append(fingerprint_of(what, fields_to_hash()))
    (told,) = differences(what, *found, exactly=True)
    assert (told.topic, told.reason) == ("/cassie/state", "differs between 1 and 2 s")
    assert differences(dataclasses.replace(what, seconds=1.0), *found, exactly=True) == []
    assert differences(what, *found, exactly=False) == []


def test_a_shorter_run_and_a_missing_topic_are_differences(
    recording: Recording, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(fingerprint, "recording_of", lambda _: recording)
    what = Run(Path("try.yaml"), 2)
    whole = fingerprint_of(what, fields_to_hash())
    less = {**recording.lane, RobotState.TOPIC: recording.rows(RobotState)[:700]}
    less["/cassie/mode"] = less["/cassie/mode"][:0]
    recording = dataclasses.replace(recording, lane=less)
    told = differences(what, whole, fingerprint_of(what, fields_to_hash()), exactly=True)
    assert {each.topic: each.reason for each in told} == {
        "/cassie/mode": "there is none",
        "/cassie/state": "differs between 1 and 2 s",
    }


def test_the_bag_of_a_run_has_the_fingerprint_of_the_run(file: Path, tmp_path: Path):
    experiment = resolve(load_experiment(file, seed=1))
    bag = tmp_path / "bag.mcap"
    with bag_observer(bag, experiment) as observer:
        run(make_loop(experiment, observer), range(tick_count(experiment)))
    fields = fields_to_hash()
    assert fingerprint_of(Run(file, 1), fields) == fingerprint_of(Run(file, 1, bag=bag), fields)
    with pytest.raises(ValueError, match=r"bag\.mcap is of robot 1, expected 2"):
        fingerprint_of(Run(file, 2, bag=bag), fields)


def test_renewing_one_experiment_leaves_the_others_as_they_are(
    tmp_path: Path, prints: Path, capsys: pytest.CaptureFixture[str]
):
    other = tmp_path / "other.yaml"
    other.write_text(TEXT)
    before = load(prints).runs["try"]
    assert command.main([str(other), "--file", str(prints)]) == 1
    assert "has no fingerprint" in capsys.readouterr().out
    assert command.main([str(other), "--renew", "--file", str(prints)]) == 0
    assert load(prints).runs == {"other": before, "try": before}
    change_environment(prints)
    assert command.main([str(other), "--renew", "--file", str(prints)]) == 2
    assert "all fingerprints have to be renewed: numba" in capsys.readouterr().err


@pytest.mark.parametrize("text", ["", "runs: 3", "runs: {a: {0: {topics: {x: {}}}}}", "[", "\0"])
def test_what_is_no_file_of_fingerprints_is_refused_in_a_line(
    text: str, tmp_path: Path, here: None, capsys: pytest.CaptureFixture[str]
):
    path = tmp_path / "prints.yaml"
    path.write_text(text)
    assert command.main(["--fast", "--file", str(path)]) == 2
    assert capsys.readouterr().err == f"fingerprint: error: {path} is no file of fingerprints\n"


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--bags", "nowhere"], "--bags: there is no folder nowhere"),
        (["--fast", "--bags", "."], "--fast takes parts of runs: leave out --bags"),
    ],
)
def test_bags_that_would_not_be_read_are_refused_before_anything_runs(
    capsys: pytest.CaptureFixture[str], words: list[str], reason: str
):
    assert command.main(words) == 2
    assert reason in capsys.readouterr().err
