"""Parameters and services from the command line, with the `ros2` that comes along."""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
from bringup import Robot

from cassie_bags.ros.processes import environment

ROS2 = Path(__file__).resolve().parents[1] / ".workspace" / "bin" / "ros2"
GANTRY = ("service", "call", "/cassie/gantry", "cassie_msgs/srv/Gantry")


def ros2(domain: int, *words: str) -> tuple[int, str]:
    """Exit code, and what it says."""
    done = subprocess.run(
        [sys.executable, ROS2, *words],
        capture_output=True,
        text=True,
        env=environment(domain),
        check=False,
        timeout=60,
    )
    assert "Traceback" not in done.stderr
    return done.returncode, done.stdout + done.stderr


def test_parameters_are_set_and_services_called(tmp_path: Path) -> None:
    with Robot(tmp_path) as robot:
        robot.start("simulator")
        robot.eyes.wait_for(lambda: robot.eyes.node.count_publishers("/clock") > 0, "the simulator")

        def ask(*words: str) -> tuple[int, str]:
            return ros2(robot.domain, *words)

        assert "command_timeout" in ask("param", "list", "simulator")[1].split()
        assert ask("param", "set", "simulator", "command_timeout", "7.5") == (
            0,
            "command_timeout set\n",
        )
        assert ask("param", "get", "simulator", "command_timeout") == (0, "7.5\n")
        code, said = ask("param", "set", "simulator", "command_timeout", "-1.0")
        assert code == 1
        assert "out of range" in said
        code, said = ask("param", "get", "simulator", "command_timout")
        assert (code, said) == (
            1,
            "ros2 param: simulator has no parameter command_timout, "
            "did you mean command_timeout?\n",
        )
        code, said = ask(*GANTRY, "{action: hold, height: 1}")
        assert code == 0
        assert "the gantry holds the pelvis at 1 m" in said
        code, said = ask(*GANTRY, "{action: hold, height: 9}")
        assert code == 1
        assert "height = 9 m is outside 0.2 .. 2 m" in said


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (("cassie_msgs/srv/Pus", "{}"), "no service type cassie_msgs/srv/Pus"),
        (("cassie_msgs/srv/Push", "{force: [1, 2]}"), "force (double[3]): [1, 2] does not have 3"),
        (("cassie_msgs/srv/Push", "{force: up}"), "'up' is no list of numbers"),
        (("cassie_msgs/srv/Push", "{body: 3}"), "body (string): 3 is no str"),
        (("cassie_msgs/srv/Push", "{forc: 3}"), "unknown field forc: known: body, force"),
        (("cassie_msgs/srv/Push", "{"), "the request is no YAML"),
        (("cassie_msgs/srv/Push", "3"), "3 is no mapping"),
        (("cassie_msgs/srv/Step", "{ticks: -1}"), "ticks (uint32): -1 is outside 0 .. 4294967295"),
        (("/srv/Push", "{}"), "no service type /srv/Push"),
    ],
)
def test_a_request_that_makes_no_sense_is_not_sent(words: tuple[str, str], reason: str) -> None:
    code, said = ros2(0, "service", "call", "/cassie/push", *words)
    assert code == 1
    assert reason in said


def test_a_name_that_nothing_can_have_is_refused_in_one_line() -> None:
    code, said = ros2(0, "param", "get", "no node", "x")
    assert code == 1
    assert len(said.splitlines()) == 1
    assert "must not contain characters other than" in said


def test_a_service_that_is_not_there_is_not_suggested_in_its_own_place(monkeypatch) -> None:
    monkeypatch.syspath_prepend(ROS2.parents[1])
    calls = import_module("ros2_calls")
    monkeypatch.setattr(calls, "PATIENCE", 0.1)
    with pytest.raises(calls.CallError, match=r"nobody serves /cassie/nothing within 0.1 s$"):
        calls.call_service("/cassie/nothing", "cassie_msgs/srv/Push", "{force: [0, 0, 1]}")
