"""Every command: its help loads nothing that takes long, a wrong option is told in a line."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import cassie_bags.cli
from cassie_bags.cli import recover

SECONDS = {"matplotlib", "mujoco", "numba", "pinocchio", "rclpy", "scipy"}
"""Modules that load for a second or more."""

HEAVY = SECONDS | {"numpy", "yaml"}
NO_COMMANDS = {"__init__", "arguments", "frame", "verify"}
VERBS = sorted(
    path.stem
    for path in Path(cassie_bags.cli.__path__[0]).glob("*.py")
    if path.stem not in NO_COMMANDS
)
SEE = """
import sys
from cassie_bags.cli import {verb}
try:
    code = {verb}.main({words})
except SystemExit as stop:
    code = stop.code
loaded = {heavy} & sys.modules.keys()
print(sorted(loaded), file=sys.stderr) if loaded else None
sys.exit(100 if loaded else code)
"""


def play(verb: str, *words: str, heavy: set[str] = HEAVY) -> subprocess.CompletedProcess[str]:
    text = SEE.format(verb=verb, words=list(words), heavy=heavy)
    return subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, timeout=600)


@pytest.mark.parametrize("verb", VERBS)
def test_help_is_there_at_once_and_tells_the_exit_codes(verb: str):
    done = play(verb, "--help")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(f"usage: ros2 run cassie_bags {verb} [")
    assert "Exit codes: 0 " in " ".join(done.stdout.split())


@pytest.mark.parametrize("verb", VERBS)
def test_an_unknown_option_is_told_at_once(verb: str):
    done = play(verb, "--nonsense")
    assert done.returncode == 2
    assert "--nonsense" in done.stderr or "required" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    "words",
    [
        ("compare", "nosuch", "other"),
        ("experiment", "nosuch"),
        ("failsafes", "nosuch"),
        ("faults", "nosuch"),
        ("faults", "drive_position.3", "--kinds", "nosuch"),
        ("fingerprint", "nosuch"),
        ("info", "nosuch"),
        ("recover", "nosuch"),
        ("report", "nosuch"),
        ("sweep", "nosuch"),
        ("tune", "nosuch"),
        ("tune", "--objective", "nosuch"),
    ],
    ids=" ".join,
)
def test_what_is_not_there_is_told_before_the_robot_loads(words: tuple[str, ...]):
    done = play(*words, heavy=SECONDS)
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("nosuch") >= 1
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("verb", VERBS)
def test_usage_says_what_each_argument_is(verb: str):
    usage = " ".join(play(verb, "--help").stdout.split("\n\n")[0].split())
    named = re.findall(r"--([a-z-]+) ([A-Z_]+)(?![.|])", usage)
    assert [option for option, what in named if what == option.upper().replace("-", "_")] == []
    assert re.findall(r"[ \[]([a-z]\w*)(?= |$|\])", usage.partition("[-h]")[2]) == []


def test_replay_verify_has_a_usage_line_of_its_own():
    usage = " ".join(play("replay", "--verify", "--help").stdout.split("\n\n")[0].split())
    assert usage.startswith("usage: ros2 run cassie_bags replay --verify [-h]")
    assert usage.endswith(" BAG")


def test_a_command_leaves_the_signal_handlers_as_they_were(tmp_path: Path):
    before = signal.getsignal(signal.SIGTERM)
    assert recover.main([str(tmp_path / "nosuch.mcap")]) == 2
    assert signal.getsignal(signal.SIGTERM) is before
