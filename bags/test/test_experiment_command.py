"""The experiment command: one line of JSON, exit codes, files, and nothing left behind."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from cassie_bags.bag.reader import BagIndex, read_messages
from cassie_bags.ros.experiments import stopped_between

TEXT = """
start: standing
duration: 1.0
operator:
  - {t: 0.0, power: true, mode: stand, height: 0.95}
expect:
  phases:
    - {name: stand, t0: 0.6, t1: 1.0, vx: {target: 0.0, tolerance: 0.5}}
"""

COMMAND = [sys.executable, "-m", "cassie_bags.cli.experiment"]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "try.yaml"
    path.write_text(TEXT)
    return path


def environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}


def experiment(*words: str | Path) -> subprocess.CompletedProcess[str]:
    command = [*COMMAND, *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, env=environment(), check=False)


def result(process: subprocess.CompletedProcess[str]) -> dict[str, Any]:
    lines = process.stdout.splitlines()
    assert len(lines) == 1, process.stderr
    return json.loads(lines[0])


def test_a_run_as_expected_is_one_line_of_json_and_a_table(file: Path):
    process = experiment(file, "--in-process", "--seed", "7")
    assert process.returncode == 0, process.stderr
    content = result(process)
    assert content["passed"] is True
    assert content["fell"] is False
    assert content["seed"] == 7
    assert content["how"] == "in-process"
    assert content["draw"]["mass"] != 1.0
    assert set(content["tracked"]) == {"vx", "vy", "yaw_rate", "height"}
    assert content["peak_torque"]["left_knee"] > 0.0
    assert content["real_time_factor"] > 0.0
    assert content["phases"][0]["name"] == "stand"
    assert "stand " in process.stderr
    assert process.stderr.rstrip().endswith("passed")


def test_the_table_fits_80_columns_and_has_target_and_pass(file: Path):
    phases = (
        "expect.phases=[{name: from ahead and the right, t0: 0.6, t1: 1.0, vx: {max: 0.5}},"
        " {name: later, t0: 2.0, t1: 103.0}]"
    )
    lines = experiment(file, "--in-process", "--seed", "7", "--set", phases).stderr.splitlines()
    assert max(map(len, lines)) <= 80
    assert any(line.split()[-3:] == ["value", "target", "pass"] for line in lines)
    assert any("vx" in line and line.endswith("<= 0.5   yes") for line in lines)


def test_the_table_has_units_and_no_negative_zero(file: Path):
    lines = experiment(file, "--in-process").stderr.splitlines()
    heading = next(number for number, line in enumerate(lines) if line.startswith("phase"))
    assert lines[heading + 1].split() == ["m/s", "m/s", "rad/s", "m", "m", "deg"]
    judged = next(line.split() for line in lines if "vx" in line and line.endswith("yes"))
    assert "m/s" in judged
    assert not any(
        word.strip("-0.") == "" and word.startswith("-0") for word in " ".join(lines).split()
    )


def test_a_run_not_as_expected_exits_with_1_and_says_why(file: Path):
    change = "expect.phases.0.vx={min: 2.0}"
    process = experiment(file, "--in-process", "--set", change)
    assert process.returncode == 1
    assert "stand: vx" in result(process)["failures"][0]
    assert "expected >= 2" in process.stderr


def test_a_run_leaves_bag_pictures_table_and_json(file: Path, tmp_path: Path):
    out = tmp_path / "out"
    process = experiment(file, "--in-process", "--out", out)
    assert process.returncode == 0, process.stderr
    names = {path.name for path in out.iterdir()}
    pictures = {"knee_phase_portrait.png", "speed_tracking.png", "footsteps.png", "strip.png"}
    assert names >= pictures | {"bag.mcap", "experiment.yaml", "table.txt", "result.json"}
    for path in result(process)["files"].values():
        assert Path(path).stat().st_size > 100


def test_the_file_a_run_leaves_gives_the_same_run(file: Path, tmp_path: Path):
    first = experiment(file, "--in-process", "--seed", "3", "--out", tmp_path, "--no-pictures")
    again = experiment(tmp_path / "experiment.yaml", "--in-process")
    one, other = result(first), result(again)
    for key in ("metrics", "phases", "peak_torque", "draw", "seed"):
        for content in (one, other):
            content["metrics"].pop("real_time_factor", None)
        assert one[key] == other[key]


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--set", "durtion=3"], "unknown key durtion: did you mean duration"),
        (["--set", "scene=flatt"], "did you mean flat"),
        (["--set", "controller.walk.laww=paper"], "controller: unknown parameter walk.laww"),
        (["--set", "gait_library=none.json"], "none.json"),
        (["--set", "seed=3", "--set", "seed=4"], "seed is given twice: seed=3 and seed=4"),
        (["--set", "simulator.start=gantry"], "simulator.start follows from other keys"),
    ],
)
def test_a_wrong_file_exits_with_2_and_one_line(file: Path, words: list[str], reason: str):
    process = experiment(file, "--in-process", *words)
    assert process.returncode == 2
    assert process.stdout == ""
    assert len(process.stderr.splitlines()) == 1
    assert reason in process.stderr


def test_a_file_with_nothing_but_its_duration_is_an_experiment(tmp_path: Path):
    (tmp_path / "hang.yaml").write_text("duration: 0.5\n")
    process = experiment(tmp_path / "hang.yaml", "--in-process")
    assert process.returncode == 0, process.stderr
    assert [phase["name"] for phase in result(process)["phases"]] == ["without an operator"]


def test_a_missing_file_exits_with_2(tmp_path: Path):
    process = experiment(tmp_path / "none.yaml")
    assert process.returncode == 2
    assert "No such file" in process.stderr


def test_ctrl_c_ends_a_run_between_two_ticks():
    """Within a tick it tore what was being written to the bag, the rest of which was lost."""
    whole_ones = []
    with pytest.raises(KeyboardInterrupt), stopped_between(range(5)) as ticks:
        for tick in ticks:
            if tick == 2:
                signal.raise_signal(signal.SIGINT)
            whole_ones.append(tick)
    assert whole_ones == [0, 1, 2]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_ctrl_c_ends_a_run_without_a_traceback_and_closes_its_bag(file: Path, tmp_path: Path):
    bag = tmp_path / "bag.mcap"
    words = [str(file), "--in-process", "--set", "duration=600", "--out", str(tmp_path)]
    with subprocess.Popen(
        [*COMMAND, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
    ) as process:
        while process.poll() is None and not (bag.is_file() and bag.stat().st_size > 100_000):
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=90)
    assert process.returncode == 130
    assert output == ""
    assert errors.splitlines()[-1] == "experiment: stopped"
    assert "Traceback" not in errors
    index = BagIndex()
    assert sum(1 for _ in read_messages(bag, ["/cassie/state"], index)) > 100
    assert index.complete
