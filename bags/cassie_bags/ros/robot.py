"""Command `robot`: runs the simulated robot and its nodes, ready to be driven, until Ctrl-C."""

from __future__ import annotations

import argparse
import os
import re
import signal
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from cassie_bags.errors import RunError
from cassie_bags.ros.command_node import command_node
from cassie_bags.ros.processes import Processes, executable
from cassie_msgs.msg import SupervisorStatus
from cassie_msgs.processes import end_within
from cassie_msgs.ros.claim import held_roles, second
from cassie_msgs.ros.process import LEAVE_TIMEOUT, Stop, follow_signals

ENDED, NODE_LOST, WRONG_INPUT = 0, 1, 2
"""Exit codes."""

TIMEOUT = 60.0
"""Time-out until the robot is ready. In s of wall time."""

SILENT_AFTER = 5.0
"""Time without a node in ROS's graph after which this is reported. In s."""

NODES = {
    "simulator": "cassie_sim",
    "state_estimator": "cassie_control",
    "gait_controller": "cassie_control",
    "mode_supervisor": "cassie_control",
}
"""Package of each node."""

STACK = ("state_estimator", "gait_controller")
"""Nodes that `--stack` runs as one process."""

_CHECK_PERIOD = 0.1  # s between two checks of the processes


def run_robot(arguments: argparse.Namespace) -> int:
    """Run the nodes until a stop; returns the exit code."""
    stop = Stop()
    # A shell makes background commands ignore Ctrl-C; if it is sent nevertheless, it is meant.
    follow_signals(stop, signal.SIGHUP)
    logs = arguments.logs or _log_folder()
    try:
        commands = node_commands(arguments)
        _refuse_second(arguments)
        with command_node("robot") as (node, executor):
            code = _watch(arguments, commands, logs, node, executor, stop)
            end_within(2 * LEAVE_TIMEOUT, code)
            return code
    except (RunError, ValueError, OSError) as error:
        print(f"robot: error: {error}", file=sys.stderr)
        return NODE_LOST if isinstance(error, RunError) else WRONG_INPUT


def _watch(
    arguments: argparse.Namespace,
    commands: Mapping[str, Sequence[str | Path]],
    logs: Path,
    node: Node,
    executor: SingleThreadedExecutor,
    stop: Stop,
) -> int:
    """Start the nodes; end them when a stop is requested or one of them ends.

    Args:
        arguments: Arguments of the command.
        commands: Command of each process, by name.
        logs: Folder for the output of the processes.
        node, executor: Node that receives the supervisor's status, and its executor.
        stop: Stop of all nodes.

    Returns:
        The exit code. Errors are printed before any node leaves DDS, which may hang.
    """
    try:
        with Processes({**os.environ, "PYTHONUNBUFFERED": "1"}, logs) as processes:
            for name, command in commands.items():
                processes.start(name, command)
            _say(f"starting {', '.join(commands)}; logs in {logs}")
            if _await_robot(node, executor, processes, stop):
                address = console_address(processes, stop) if arguments.console else ""
                if not stop.requested:
                    _say(_ready(arguments, address))
            names = [n for name in commands for n in (STACK if name == "stack" else (name,))]
            silent = SilentNodes(names)
            while not stop.wait(_CHECK_PERIOD):
                processes.check()
                for word in silent.report(node.get_node_names(), time.monotonic()):
                    _say(word)
    except RunError as error:
        print(f"robot: error: {error}; logs in {logs}", file=sys.stderr)
        return NODE_LOST
    _say("ended")
    return ENDED


class SilentNodes:
    """Nodes that run but have left ROS's graph: they hang, or were stopped.

    Args:
        names: Names of the expected nodes.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self._names = names
        self._seen: dict[str, float] = {}
        self._reported: set[str] = set()

    def report(self, present: Sequence[str], now: float) -> list[str]:
        """Report each node once that has been absent for `SILENT_AFTER`.

        Args:
            present: Names of the nodes in the graph.
            now: Present time. In s.
        """
        words = []
        for name in self._names:
            if name in present:
                self._seen[name] = now
                self._reported.discard(name)
            elif (
                name not in self._reported and now - self._seen.setdefault(name, now) > SILENT_AFTER
            ):
                words.append(
                    f"{name} runs, but nothing has been heard of it for {SILENT_AFTER:g} s: "
                    "it hangs, or was stopped; Ctrl-C ends all"
                )
                self._reported.add(name)
        return words


def node_commands(arguments: argparse.Namespace) -> dict[str, list[str | Path]]:
    """Command of each process, in the order in which they are started.

    Raises:
        ValueError: if a parameter names a node that is not started.
        RunError: if a program is not installed.
    """
    own: dict[str, list[str]] = {"simulator": [f"scene:={arguments.scene}"]}
    if arguments.view:
        own["simulator"].append("headless:=false")
    if arguments.realtime:
        own["simulator"].append("pacing:=realtime")
    programs = dict(NODES)
    if arguments.stack:
        programs = {n: package for n, package in NODES.items() if n not in STACK}
        programs["stack"] = "cassie_control"
    if arguments.console:
        programs["web_console"] = "cassie_teleop"
    if arguments.pad:
        programs |= dict.fromkeys(("joystick", "rc_teleop"), "cassie_teleop")
        own["rc_teleop"] = [f"device:={arguments.pad}"]
    for word in arguments.parameter:
        name, _, assignment = word.partition(":")
        owner = "stack" if arguments.stack and name in STACK else name
        if owner not in programs or not re.fullmatch(r"[\w.]+:=.*", assignment):
            raise ValueError(
                f"-p {word}: must be NODE:NAME:=VALUE with NODE one of {', '.join(programs)}"
            )
        own.setdefault(owner, []).append(word if owner == "stack" else assignment)
    return {name: _command(package, name, own.get(name, [])) for name, package in programs.items()}


def _refuse_second(arguments: argparse.Namespace) -> None:
    """Check that no second robot runs: its supervisor would report this robot as ready.

    Raises:
        SecondNodeError: if a node that is to be started runs in the domain.
    """
    domain = int(os.environ.get("ROS_DOMAIN_ID") or 0)
    running = sorted(
        role
        for role in held_roles(domain) & set(NODES)
        if f"{role}:allow_second:=true" not in arguments.parameter
    )
    if running:
        permission = " -p ".join(f"{role}:allow_second:=true" for role in running)
        raise second(", ".join(running), domain, permission)


def _command(package: str, name: str, parameters: list[str]) -> list[str | Path]:
    words = [word for parameter in parameters for word in ("-p", parameter)]
    return [executable(package, name), *(["--ros-args", *words] if words else [])]


def _await_robot(
    node: Node, executor: SingleThreadedExecutor, processes: Processes, stop: Stop
) -> bool:
    """Wait until the supervisor reports a state; False if stopped before.

    Raises:
        RunError: if a node ends, or at the time-out.
    """
    heard = threading.Event()

    def listen(status: SupervisorStatus) -> None:
        if status.episode:
            heard.set()

    topic = "/cassie/supervisor_status"
    subscription = node.create_subscription(SupervisorStatus, topic, listen, 10)
    deadline = time.monotonic() + TIMEOUT
    try:
        while not (heard.is_set() or stop.requested):
            processes.check()
            if time.monotonic() > deadline:
                raise RunError(f"the robot is not ready after {TIMEOUT:g} s")
            executor.spin_once(timeout_sec=_CHECK_PERIOD)
    finally:
        node.destroy_subscription(subscription)
    return heard.is_set()


def console_address(processes: Processes, stop: Stop) -> str:
    """Address that web_console prints once it listens, which may be after the robot is ready.

    Empty if stopped before.

    Raises:
        RunError: if a node ends, or at the time-out.
    """
    deadline = time.monotonic() + TIMEOUT
    while not stop.requested:
        processes.check()
        printed = processes.log("web_console").read_text(encoding="utf-8", errors="replace")
        if address := re.search(r"open (https?://\S+)\n", printed):
            return address[1]
        if time.monotonic() > deadline:
            raise RunError(f"web_console does not listen after {TIMEOUT:g} s")
        stop.wait(_CHECK_PERIOD)
    return ""


def _ready(arguments: argparse.Namespace, address: str) -> str:
    where = f" in scene {arguments.scene}" if arguments.scene != "flat" else ""
    stands = "simulator:start:=standing" in arguments.parameter
    starts = "hangs in the gantry"
    if stands:
        starts = "begins on its feet, without power, and sinks down unless that comes at once"
    lines = [f"ready: Cassie {starts}{where}; Ctrl-C ends all"]
    lines.append(f"see and drive it: {address or 'ros2 run cassie_teleop web_console'}")
    lines.append("or in a terminal: ros2 run cassie_teleop keyboard_teleop")
    return "\n       ".join(lines)


def _log_folder() -> Path:
    """Folder for the logs of this run, in ROS's folder for logs."""
    home = Path(os.environ.get("ROS_HOME", "~/.ros")).expanduser()
    folder = Path(os.environ.get("ROS_LOG_DIR", home / "log"))
    return folder / time.strftime("cassie_%Y-%m-%d_%H-%M-%S")


def _say(text: str) -> None:
    print(f"robot: {text}", flush=True)
