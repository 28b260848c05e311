"""The benchmark writes the figures that others rely on."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

from cassie_bags.errors import RunError
from cassie_bags.ros import bench
from cassie_bags.ros.bench import EXPERIMENT
from cassie_bags.ros.bench_executor import once
from cassie_bags.ros.processes import executable
from cassie_bags.run.cores import make_cores
from cassie_bags.run.experiment import parse_experiment
from cassie_bags.run.seed import resolve

KEYS = (
    "rtf_five_processes_500hz",
    "rtf_default_executor_500hz",
    "rtf_in_process_500hz",
    "round_trip_p50_us",
    "round_trip_p99_us",
    "tick_us",
    "page_processor_share",
    "stick_to_command_page_p99_ms",
    "stick_to_command_joy_p99_ms",
)


def test_a_short_run_leaves_every_figure(tmp_path: Path):
    try:
        executable("cassie_control", "gait_controller")
    except RunError as error:
        pytest.skip(str(error))
    out = tmp_path / "bench.json"
    command = [sys.executable, "-m", "cassie_bags.ros.bench", "--out", str(out)]
    run = subprocess.run(
        [*command, "--repetitions", "1", "--seconds", "2"],
        stdout=subprocess.PIPE,  # what it says of each run is shown if this fails
        text=True,
        check=False,
    )
    assert run.returncode == 0
    figures = json.loads(out.read_text())
    for key in KEYS:
        assert figures[key] > 0.0
        assert key in run.stdout
    assert figures["rtf_in_process_500hz"] > figures["rtf_default_executor_500hz"]
    assert figures["round_trip_p99_us"] >= figures["round_trip_p50_us"]


def test_what_was_measured_is_kept_if_a_part_fails(tmp_path, monkeypatch, capsys):
    def fails(*_: object, **__: object) -> dict[str, float]:
        raise RunError("the simulator ended with status 1")

    for name in ("_five_processes", "_factor_at", "_stack", "_default_executor", "_one_process"):
        monkeypatch.setattr(bench, name, lambda *_, **__: {"rtf_in_process_500hz": 10.0})
    for name in ("_machine_late", "_missed"):
        monkeypatch.setattr(bench, name, lambda *_, **__: {"tick_us": 80.0})
    monkeypatch.setattr(bench, "operated", lambda _: {"page_processor_share": 0.1})
    monkeypatch.setattr(bench, "_tick", fails)
    monkeypatch.setattr(bench.signal, "signal", lambda *_: None)
    out = tmp_path / "bench.json"
    monkeypatch.setattr(sys, "argv", ["bench", "--out", str(out), "--repetitions", "1"])
    assert bench.main() == 3
    figures = json.loads(out.read_text())
    assert figures["page_processor_share"] == 0.1
    assert figures["failures"] == ["tick in run 1"]
    told = capsys.readouterr().err
    assert "tick: the simulator ended with status 1" in told
    assert told.splitlines()[-1] == "bench: error: not measured: tick in run 1"


def test_a_sample_that_is_sent_again_is_answered_again_but_not_estimated_twice():
    experiment = resolve(parse_experiment(EXPERIMENT, "bench"))
    estimator = make_cores(experiment).estimator
    plant = make_cores(experiment).plant
    answer = once(estimator.step)
    sample = plant.sense()
    first = answer(sample).q.copy()
    for _ in range(50):  # a monitor that took them for new samples would find everything stuck
        assert (answer(sample).q == first).all()
    assert not estimator.faults


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--repetitions", "0"], "0 is not a whole number of 1 or more"),
        (["--seconds", "0.5"], "0.5 is not 2 .. 600 s"),
        (["--out", "file/folder/bench.json"], "Not a directory"),
    ],
)
def test_wrong_words_are_told_before_anything_runs(words: list[str], reason: str, tmp_path: Path):
    (tmp_path / "file").write_text("")
    run = subprocess.run(
        [sys.executable, "-m", "cassie_bags.ros.bench", *words],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
        timeout=600,
    )
    assert run.returncode == 2
    assert reason in run.stderr.splitlines()[-1]


def test_ctrl_c_ends_it_without_a_traceback(tmp_path: Path):
    command = [sys.executable, "-m", "cassie_bags.ros.bench", "--out", str(tmp_path / "b.json")]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    assert "run 1: five processes" in process.stderr.readline()
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=30)
    assert process.returncode == 130
    assert said.splitlines()[-1] == "bench: stopped"
    assert "Traceback" not in said
