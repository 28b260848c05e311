"""All commands under one name."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from cassie_bags.__main__ import COMMANDS, main

EXECUTABLES = Path(__file__).resolve().parents[1] / "cassie_bags" / "executables.py"


def test_it_lists_every_executable_of_the_package():
    text = EXECUTABLES.read_text()
    scripts = dict(re.findall(r'(\w+) = entry_point\("cassie_bags\.([\w.]+)"\)', text))
    del scripts["cassie_bags"]
    assert scripts == {name: f"cli.{name}" for group in COMMANDS.values() for name in group}


def test_help_loads_nothing_that_computes():
    code = "import sys; from cassie_bags.__main__ import main\n"
    code += "try: main(['--help'])\nexcept SystemExit: pass\n"
    code += "assert not {'numpy', 'mujoco', 'rclpy', 'matplotlib'} & sys.modules.keys()"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "report" in done.stdout


def test_a_wrong_command_is_refused_with_the_near_one(capsys):
    assert main(["exprot"]) == 2
    assert "did you mean export?" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("command", "words"), [("info", "Say what is in a bag"), ("record", "Record topics")]
)
def test_it_hands_over(capsys, monkeypatch, command, words):
    monkeypatch.setattr(sys, "argv", sys.argv)
    with pytest.raises(SystemExit) as ended:
        main([command, "--help"])
    assert ended.value.code == 0
    assert words in capsys.readouterr().out
