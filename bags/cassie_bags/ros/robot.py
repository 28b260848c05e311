"""Command `robot`: runs the simulated robot and its nodes, ready to be driven, until Ctrl-C."""

from __future__ import annotations

import argparse
import math
import os
import re
import signal
import sys
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TypeVar

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

Found = TypeVar("Found")

_CHECK_PERIOD = 0.1  # s between two checks of the processes


def run_robot(arguments: argparse.Namespace) -> int:
    """Run the nodes until a stop; returns the exit code."""
    stop = Stop()
    # A shell makes background commands ignore Ctrl-C; if it is sent nevertheless, it is meant.
    follow_signals(stop, signal.SIGHUP)
    logs, code = arguments.logs or _log_folder(), ENDED
    try:
        commands = node_commands(arguments)
        _refuse_second(arguments)
        with command_node("robot") as (node, executor):
            try:
                with Processes({**os.environ, "PYTHONUNBUFFERED": "1"}, logs) as processes:
                    for name, command in commands.items():
                        processes.start(name, command)
                    _say(f"starting {', '.join(commands)}; logs in {logs}")
                    if _await_robot(node, executor, processes, _claimed(arguments), stop):
                        address = console_address(processes, stop) if arguments.console else ""
                        if not stop.requested:
                            _say(_ready(arguments, address))
                    _watch(commands, processes, node, stop)
                _say("ended")
            except RunError as error:  # printed before any node leaves DDS, which may hang
                print(f"robot: error: {error}; logs in {logs}", file=sys.stderr)
                code = NODE_LOST
            end_within(2 * LEAVE_TIMEOUT, code)
    except (RunError, ValueError, OSError) as error:
        print(f"robot: error: {error}", file=sys.stderr)
        return NODE_LOST if isinstance(error, RunError) else WRONG_INPUT
    return code


def _watch(commands: Iterable[str], processes: Processes, node: Node, stop: Stop) -> None:
    """Wait for a stop; report nodes that run but have left ROS's graph.

    Raises:
        RunError: if a process ends.
    """
    names = [n for name in commands for n in (STACK if name == "stack" else (name,))]
    seen: dict[str, float] = {}
    while not stop.wait(_CHECK_PERIOD):
        processes.check()
        present, now = node.get_node_names(), time.monotonic()
        seen |= {name: now for name in names if name in present}
        for name in names:
            if now - seen.setdefault(name, now) > SILENT_AFTER:
                _say(
                    f"{name} runs, but nothing has been heard of it for {SILENT_AFTER:g} s: "
                    "it hangs, or was stopped; Ctrl-C ends all"
                )
                seen[name] = math.inf  # said once


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
    running = sorted(held_roles(domain) & _claimed(arguments))
    if running:
        permission = " -p ".join(f"{role}:allow_second:=true" for role in running)
        raise second(", ".join(running), domain, permission)


def _claimed(arguments: argparse.Namespace) -> set[str]:
    """Kinds of the nodes of this robot that permit no second one."""
    return {role for role in NODES if f"{role}:allow_second:=true" not in arguments.parameter}


def _command(package: str, name: str, parameters: list[str]) -> list[str | Path]:
    words = [word for parameter in parameters for word in ("-p", parameter)]
    return [executable(package, name), *(["--ros-args", *words] if words else [])]


def _await_robot(
    node: Node,
    executor: SingleThreadedExecutor,
    processes: Processes,
    claimed: set[str],
    stop: Stop,
) -> bool:
    """Wait until all nodes run and the supervisor reports a state; False if stopped before.

    Raises:
        RunError: as `_await`.
    """
    episodes: list[int] = []
    domain = node.context.get_domain_id()

    def reported() -> bool:
        executor.spin_once(timeout_sec=_CHECK_PERIOD)
        return any(episodes) and claimed <= held_roles(domain)

    subscription = node.create_subscription(
        SupervisorStatus,
        "/cassie/supervisor_status",
        lambda status: episodes.append(status.episode),
        10,
    )
    try:
        return bool(_await(reported, "the robot is not ready", processes, stop))
    finally:
        node.destroy_subscription(subscription)


def console_address(processes: Processes, stop: Stop) -> str:
    """Address that web_console prints once it listens, which may be after the robot is ready.

    Empty if stopped before.

    Raises:
        RunError: as `_await`.
    """

    def printed() -> re.Match[str] | None:
        stop.wait(_CHECK_PERIOD)
        text = processes.log("web_console").read_text(encoding="utf-8", errors="replace")
        return re.search(r"open (https?://\S+)\n", text)

    address = _await(printed, "web_console does not listen", processes, stop)
    return address[1] if address else ""


def _await(
    look: Callable[[], Found | None], problem: str, processes: Processes, stop: Stop
) -> Found | None:
    """What `look` finds, which waits a little itself; None if stopped before.

    Raises:
        RunError: if a process ends, or at the time-out, with the problem.
    """
    deadline = time.monotonic() + TIMEOUT
    while not stop.requested:
        processes.check()
        if found := look():
            return found
        if time.monotonic() > deadline:
            raise RunError(f"{problem} after {TIMEOUT:g} s")
    return None


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
