"""Parameters and services from the command line, with the `ros2` that comes along."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from importlib import import_module
from pathlib import Path

import pytest
import rclpy
import yaml
from bringup import Robot
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Twist
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import Joy
from std_msgs.msg import ByteMultiArray

from cassie_bags.ros.processes import environment

ROS2 = Path(__file__).resolve().parents[1] / ".workspace" / "bin" / "ros2"
STATUS = DiagnosticStatus(name="x", level=b"\x01")
GANTRY = ("service", "call", "/cassie/gantry", "cassie_msgs/srv/Gantry")


def ros2(domain: int, *words: str) -> tuple[int, str]:
    """Exit code, and what it says."""
    done = subprocess.run(
        [sys.executable, ROS2, *words],
        capture_output=True,
        text=True,
        env=environment(domain),
        check=False,
        timeout=90,
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
            "Set parameter successful\n",
        )
        assert ask("param", "get", "simulator", "command_timeout") == (0, "Double value is: 7.5\n")
        code, said = ask("param", "set", "simulator", "command_timeout", "-1.0")
        assert code == 1
        assert "out of range" in said
        for words in (["get"], ["set", "5.0"]):
            code, said = ask("param", words[0], "simulator", "command_timout", *words[1:])
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
        (
            ("cassie_msgs/srv/Push", "{force: [1e9, nan, up]}"),
            "force[2] (double): 'up' is no float",
        ),
        (("cassie_msgs/srv/Pus", "{}"), "no service type cassie_msgs/srv/Pus"),
        (("cassie_msgs/srv/Push", "{force: [1, 2]}"), "force (double[3]): [1, 2] does not have 3"),
        (("cassie_msgs/srv/Push", "{force: [1, x, 2]}"), "force[1] (double): 'x' is no float"),
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


def test_topics_nodes_and_parameters_are_shown_as_the_real_tool_does(tmp_path: Path) -> None:
    with Robot(tmp_path) as robot:
        robot.start("simulator")
        robot.eyes.wait_for(lambda: robot.eyes.node.count_publishers("/clock") > 0, "the simulator")

        def ask(*words: str) -> str:
            code, said = ros2(robot.domain, *words)
            assert code == 0, said
            return said

        assert "/cassie/sensors" in ask("topic", "list").splitlines()
        assert "/cassie/sensors [cassie_msgs/msg/Sensors]" in ask("topic", "list", "-t")
        info = ask("topic", "info", "-v", "/cassie/sensors")
        assert info.startswith("Type: cassie_msgs/msg/Sensors\n\nPublisher count: 1\n\nNode name: ")
        assert "Reliability: RELIABLE" in info
        message = yaml.safe_load(ask("topic", "echo", "--once", "/cassie/sensors").rstrip("-\n"))
        assert len(message["drive_position"]) == 10
        assert ask("topic", "echo", "--once", "--field", "seq", "/cassie/sensors").endswith("---\n")
        assert "/simulator" in ask("node", "list").splitlines()
        assert "    /cassie/sensors: cassie_msgs/msg/Sensors" in ask("node", "info", "/simulator")
        assert "/cassie/gantry [cassie_msgs/srv/Gantry]" in ask("service", "list", "-t")
        described = ask("param", "describe", "simulator", "command_timeout")
        assert described.startswith("Parameter name: command_timeout\n  Type: double\n")
        assert "    Min value: " in described
        file = tmp_path / "parameters.yaml"
        file.write_text(ask("param", "dump", "simulator"))
        parameters = yaml.safe_load(file.read_text())["/simulator"]["ros__parameters"]
        loaded = ask("param", "load", "simulator", str(file))  # also of what is fixed
        assert "Set parameter command_timeout successful" in loaded and "failed" not in loaded
        parameters["command_timeout"] = -1.0
        file.write_text(yaml.safe_dump({"simulator": {"ros__parameters": parameters}}))
        code, said = ros2(robot.domain, "param", "load", "simulator", str(file))
        assert code == 1
        assert "Set parameter command_timeout failed: " in said
        code, said = ros2(robot.domain, "topic", "echo", "/cassie/sensor")
        assert (code, said.strip()) == (
            1,
            "ros2 topic: no topic /cassie/sensor, did you mean /cassie/sensors?",
        )


def test_a_topic_is_published_and_its_rate_measured(node) -> None:
    seen: list[float] = []
    node.create_subscription(Twist, "/told", lambda m: seen.append(m.linear.x), 10)
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    domain = node.context.get_domain_id()
    words = ("topic", "pub", "-r", "50", "/told", "geometry_msgs/msg/Twist", "{linear: {x: 0.5}}")
    talker = subprocess.Popen(
        [sys.executable, ROS2, *words], env=environment(domain), stdout=subprocess.DEVNULL
    )
    meter = subprocess.Popen(
        [sys.executable, ROS2, "topic", "hz", "/told"],
        env=environment(domain),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert meter.stdout is not None
        first = meter.stdout.readline()
        assert first.startswith("average rate: ")
        assert 10.0 < float(first.split()[-1]) < 60.0
        assert "\tmin: 0.0" in meter.stdout.readline()
        meter.send_signal(signal.SIGINT)
        _, said = meter.communicate(timeout=90)
        assert (meter.returncode, said) == (130, "")
        deadline = time.monotonic() + 20.0
        while 0.5 not in seen:
            assert time.monotonic() < deadline
            executor.spin_once(timeout_sec=0.1)
        talker.send_signal(signal.SIGINT)
        assert talker.wait(timeout=90) == 130
    finally:
        talker.kill()
        meter.kill()
        executor.shutdown()


@pytest.mark.parametrize(
    ("kind", "values", "field", "expected"),
    [
        (Joy, "{axes: [0.0, 0.5, 1], buttons: [1, 0]}", "axes", [0.0, 0.5, 1.0]),
        (DiagnosticArray, "{status: [{name: x, level: 1}]}", "status", [STATUS]),
        (ByteMultiArray, "{data: [1, 255]}", "data", [b"\x01", b"\xff"]),
    ],
)
def test_arrays_and_lists_of_messages_are_published(node, kind, values, field, expected) -> None:
    seen: list[object] = []
    node.create_subscription(kind, "/told", seen.append, 10)
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    package, name = kind.__module__.split(".")[0], kind.__name__
    domain = node.context.get_domain_id()
    code, said = ros2(domain, "topic", "pub", "--once", "/told", f"{package}/msg/{name}", values)
    assert code == 0, said
    executor.spin_once(timeout_sec=5.0)
    executor.shutdown()
    assert list(getattr(seen[0], field)) == expected


def test_an_interface_is_shown_with_what_it_is_made_of() -> None:
    code, said = ros2(0, "interface", "show", "geometry_msgs/msg/TwistStamped")
    assert code == 0
    lines = said.splitlines()
    assert "std_msgs/Header header" in lines
    assert "\tbuiltin_interfaces/Time stamp" in lines
    assert "\t\tint32 sec" in lines
    assert "\tVector3  linear" in lines
    assert ros2(0, "interface", "show", "no_msgs/msg/Thing")[0] == 1


@pytest.mark.parametrize(
    "words", [(), ("topic",), ("topic", "list"), ("param",), ("param", "load"), ("interface",)]
)
def test_each_verb_has_usage(words: tuple[str, ...]) -> None:
    code, said = ros2(0, *words, "--help")
    assert code == 0
    assert said.startswith(" ".join(("usage: ros2", *words)))
    assert ros2(0, *words, "--nonsense")[0] == 2


COMMANDS = {
    "run": [""],
    "pkg": ["list", "executables"],
    "topic": ["list", "info", "echo", "hz", "pub"],
    "node": ["list", "info"],
    "param": ["list", "get", "set", "describe", "dump", "load"],
    "service": ["list", "call"],
    "interface": ["show"],
}


@pytest.mark.parametrize("verb", COMMANDS)
def test_each_argument_is_explained(verb: str) -> None:
    for command in COMMANDS[verb]:
        code, said = ros2(0, verb, *filter(None, [command]), "--help")
        assert code == 0
        # an argument without a help text is alone on the last line that it has
        lines = said.splitlines()
        bare = [
            line
            for line, after in zip(lines, [*lines[1:], ""], strict=True)
            if re.fullmatch(r"  (-\S.*|\w+)", line)
            and "  " not in line.strip()
            and not after.startswith(" " * 8)
        ]
        assert not bare, said


def test_another_verb_goes_to_a_real_ros2_where_one_is_installed(tmp_path: Path) -> None:
    code, said = ros2(0, "bags", "list")
    assert code == 2
    assert "not in this small ros2" in said
    code, said = ros2(0, "topic", "bw", "/tf")
    assert (code, said[:47]) == (2, "ros2 topic bw: not in this small ros2, which ha")
    (tmp_path / "bin").mkdir()
    real = tmp_path / "bin" / "ros2"
    real.write_text('#!/bin/sh\necho "real $MADE_READY $LD_LIBRARY_PATH:" "$@"\n')
    real.chmod(0o755)
    (tmp_path / "setup.bash").write_text("export MADE_READY=yes\n")
    path = f"{ROS2.parent}:{tmp_path / 'bin'}:{os.environ['PATH']}"
    for words in (("bag", "info", "a b"), ("topic", "bw", "/tf")):
        done = subprocess.run(
            [sys.executable, ROS2, *words],
            capture_output=True,
            text=True,
            env=environment(0) | {"PATH": path},
            check=False,
        )
        assert done.stdout == f"real yes : {' '.join(words)}\n"


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("ros2 to", "topic"),
        ("ros2 topic e", "echo"),
        ("ros2 run cassie_tel", "cassie_teleop"),
        ("ros2 run cassie_teleop key", "keyboard_teleop"),
    ],
)
def test_bash_completes(line: str, found: str) -> None:
    variables = {"_ARGCOMPLETE": "1", "_ARGCOMPLETE_SUPPRESS_SPACE": "1", "_ARGCOMPLETE_IFS": "\n"}
    variables |= {"COMP_LINE": line, "COMP_POINT": str(len(line)), "COMP_TYPE": "9"}
    script = '"$0" "$1" 8>&1 9>/dev/null >/dev/null 2>/dev/null'
    done = subprocess.run(
        ["bash", "-c", script, sys.executable, str(ROS2)],
        capture_output=True,
        text=True,
        env=environment(0) | variables,
        check=False,
    )
    assert found in [word.strip() for word in done.stdout.split()]


def test_a_name_that_nothing_can_have_is_refused_in_one_line() -> None:
    code, said = ros2(0, "param", "get", "no node", "x")
    assert code == 1
    assert len(said.splitlines()) == 1
    assert "must not contain characters other than" in said


def test_a_service_that_is_not_there_is_not_suggested_in_its_own_place(monkeypatch) -> None:
    monkeypatch.syspath_prepend(ROS2.parents[1])
    calls = import_module("ros2_calls")
    monkeypatch.setattr(calls, "TIMEOUT", 0.1)
    with pytest.raises(calls.CallError, match=r"nobody serves /cassie/nothing within 0.1 s$"):
        calls.call_service("/cassie/nothing", "cassie_msgs/srv/Push", "{force: [0, 0, 1]}")


def test_ctrl_c_ends_it_quietly_when_rclpy_has_shut_down_first(monkeypatch) -> None:
    monkeypatch.syspath_prepend(ROS2.parents[1])
    calls = import_module("ros2_calls")
    shut_down = rclpy.try_shutdown

    def too_late() -> None:  # as in a race with rclpy's thread for signals
        shut_down()
        raise calls.RCLError("rcl_shutdown already called on the given context")

    monkeypatch.setattr(rclpy, "try_shutdown", too_late)
    with pytest.raises(KeyboardInterrupt), calls._node():
        raise KeyboardInterrupt
