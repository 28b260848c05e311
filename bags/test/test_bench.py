"""The benchmark writes the figures that others rely on."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

from cassie_bags.errors import RunError
from cassie_bags.ros.processes import executable

KEYS = (
    "rtf_five_processes_500hz",
    "rtf_default_executor_500hz",
    "rtf_in_process_500hz",
    "round_trip_p50_us",
    "round_trip_p99_us",
    "tick_us",
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
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    figures = json.loads(out.read_text())
    for key in KEYS:
        assert figures[key] > 0.0
        assert key in run.stdout
    assert figures["rtf_in_process_500hz"] > figures["rtf_default_executor_500hz"]
    assert figures["round_trip_p99_us"] >= figures["round_trip_p50_us"]
