"""Every executable answers `--help` and refuses what it does not know, beside a running robot."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

import pytest

PREFIXES = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
EXECUTABLES = sorted(
    path
    for prefix in PREFIXES
    for path in Path(prefix).glob("lib/cassie_*/*")
    if path.is_file() and os.access(path, os.X_OK)
)
NODES = [path for path in EXECUTABLES if path.parent.name in ("cassie_sim", "cassie_control")]


def run(path: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [path, *words], capture_output=True, text=True, timeout=90, stdin=subprocess.DEVNULL
    )


def test_there_are_executables() -> None:
    assert {"simulator", "stack", "keyboard_teleop", "experiment"} <= {p.name for p in EXECUTABLES}


@pytest.mark.parametrize("path", EXECUTABLES, ids=lambda path: path.name)
def test_help_says_what_it_is_and_ends(path: Path) -> None:
    answer = run(path, "--help")
    assert answer.returncode == 0, answer.stderr
    assert answer.stdout.startswith("usage: ") and path.name in answer.stdout
    assert len(answer.stdout.splitlines()) > 4


@pytest.mark.parametrize("path", EXECUTABLES, ids=lambda path: path.name)
def test_an_unknown_argument_is_refused(path: Path) -> None:
    answer = run(path, "--no-such-option")
    assert answer.returncode == 2
    # argparse names what is missing first
    assert "--no-such-option" in answer.stderr or "are required: " in answer.stderr
    assert "Traceback" not in answer.stderr


@pytest.mark.parametrize("path", NODES, ids=lambda path: path.name)
def test_help_lists_topics_and_parameters(path: Path) -> None:
    text = run(path, "--help").stdout
    assert "reads:" in text and "writes:" in text and "allow_second" in text
    for line in re.findall(r"^(?:reads|writes): +(.*(?:\n {10}.*)*)", text, re.MULTILINE):
        topics = line.replace(",", " ").split()
        assert len(topics) == len(set(topics)), line


def test_the_stack_lists_the_topics_of_both_its_nodes() -> None:
    (path,) = (path for path in NODES if path.name == "stack")
    text = run(path, "--help").stdout
    assert "/diagnostics" in text
    (reads,) = re.findall(r"^reads: +(.*)", text, re.MULTILINE)
    assert reads.split(", ") == ["/cassie/sensors", "/cassie/mode", "/cassie/gait"]


@pytest.mark.parametrize("words", [("-p", "max_rate=1"), ("-p",), ("-r", "foo"), ("rate:=2",)])
@pytest.mark.parametrize("name", ["simulator", "cmd_vel", "record", "replay", "doctor"])
def test_wrong_arguments_of_ros_end_with_one_line(name: str, words: tuple[str, ...]) -> None:
    """They ended in a traceback of rclpy."""
    (path,) = (path for path in EXECUTABLES if path.name == name)
    answer = run(path, *(["bag.mcap"] if name == "replay" else []), "--ros-args", *words)
    assert answer.returncode == 2
    (line,) = answer.stderr.splitlines()
    assert line.startswith(f"{name}: error: ") and "--ros-args -p NAME:=VALUE" in line


def test_braces_without_quotes_are_refused_with_the_quotes_that_they_need() -> None:
    (path,) = (path for path in EXECUTABLES if path.name == "simulator")
    answer = run(path, "--ros-args", "-p", "scene_parameters:={rise_deg: 8.0}")
    (line,) = answer.stderr.splitlines()
    assert answer.returncode == 2 and """NAME:="'{...}'\"""" in line
