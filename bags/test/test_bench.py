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
from cassie_bags.ros.bench_parts import PARTS
from cassie_bags.ros.processes import executable

FIGURES = {
    "five processes": 3,
    "tick": 2,
    "realtime": 2,
    "realtime with page, joystick and recorder": 4,
}
"""Number of figures of those parts that have several."""


@pytest.mark.parametrize("part", PARTS)
def test_each_part_leaves_its_figures(part: str):
    try:
        executable("cassie_control", "gait_controller")
    except RunError as error:
        pytest.skip(str(error))
    figures = bench.measure_apart(part, 2.0)
    shares = {name: value for name, value in figures.items() if "_share_realtime" in name}
    assert all(0.0 <= value <= 1.0 for value in shares.values())
    others = [value for name, value in figures.items() if name not in shares]
    assert all(value > 0.0 for value in others)
    assert len(figures) == FIGURES.get(part, 1)


def test_what_was_measured_is_kept_if_a_part_fails(tmp_path, monkeypatch, capsys):
    def measure(part: str, robot_s: float) -> dict[str, float]:
        if part == "tick":
            raise RunError("tick ended with exit code 3: the simulator ended with status 1")
        return {part: robot_s}

    monkeypatch.setattr(bench, "measure_apart", measure)
    out = tmp_path / "bench.json"
    words = ["--out", str(out), "--repetitions", "1", "--seconds", "12"]
    monkeypatch.setattr(sys, "argv", ["bench", *words])
    assert bench.main() == 3
    figures = json.loads(out.read_text())
    assert figures["one process"] == 12.0
    assert figures["failures"] == ["tick in run 1"]
    printed, told = capsys.readouterr()
    assert all(part in printed for part in PARTS if part != "tick")
    assert "tick ended with exit code 3: the simulator ended with status 1" in told
    assert told.splitlines()[-1] == "bench: error: not measured: tick in run 1"


@pytest.mark.parametrize(
    ("program", "reason"),
    [
        ("import time; time.sleep(600)", "tick takes more than 2 s"),
        ("import sys; sys.exit('no controller')", "tick ended with exit code 1: no controller"),
    ],
)
def test_a_part_that_hangs_or_fails_is_told(program: str, reason: str, tmp_path, monkeypatch):
    python = tmp_path / "python"
    python.write_text(f'#!/bin/sh\nexec "{sys.executable}" -c "{program}"\n')
    python.chmod(0o755)
    monkeypatch.setattr(bench.sys, "executable", str(python))
    monkeypatch.setattr(bench, "PART_TIMEOUT", -18.0)
    with pytest.raises(RunError, match=reason):
        bench.measure_apart("tick", 2.0)


def test_a_part_that_hangs_leaves_its_stacks(monkeypatch, capsys):
    monkeypatch.setattr(bench, "PART_TIMEOUT", -3590.0)
    with pytest.raises(RunError, match="one process takes more than 10 s"):
        bench.measure_apart("one process", 360.0)
    assert "in _one_process" in capsys.readouterr().err


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
    _, said = process.communicate(timeout=600)
    assert process.returncode == 130
    assert said.splitlines()[-1] == "bench: stopped"
    assert "Traceback" not in said
