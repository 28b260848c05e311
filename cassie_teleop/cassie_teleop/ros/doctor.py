"""`doctor`: observes a running robot for some seconds, and prints problems and remedies."""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import os
import shutil
import struct
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import rclpy
from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

from cassie_msgs.layout import MotorCommand, OperatorCommand, RobotState, Sensors
from cassie_msgs.msg import SupervisorStatus
from cassie_msgs.ros.claim import held_domains, held_roles
from cassie_msgs.ros.fast_lane import NEWEST, message_type
from cassie_msgs.ros.parameters import default_of
from cassie_msgs.ros.process import own_arguments
from cassie_msgs.ros.transport import PROFILE, use_loopback, wait_for_discovery
from cassie_teleop.doctor import LANE, End, Facts, as_json, exit_code, findings, report

RCLError = rclpy_implementation.RCLError

_TOPICS = ("/clock", "/joy", "/cmd_vel", "/cassie/operator_command", "/cassie/supervisor_status")
_TICKS = {"/cassie/sensors": Sensors, "/cassie/state": RobotState}
_TICKS |= {"/cassie/motor_command": MotorCommand}
_HEAD = struct.Struct("<4xiII4xQ")  # CDR: stamp, episode, seq
_ANSWER = 3.0  # s, time-out for a node to return its parameters
_EXTRA_TIME = 6.0  # s of additional time for a writer that was not heard
_NODES = ("simulator", *list(LANE.values())[1:])
_RELIABLE, _LATCHED = ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL


class Doctor(Node):
    """Subscribes only; it publishes nothing and changes nothing."""

    def __init__(self) -> None:
        super().__init__("doctor", enable_rosout=False, start_parameter_services=False)
        self._heads: dict[str, list[tuple[float, float, int, int]]] = {}
        self._status: Any = None
        self._reports: dict[str, tuple[int, str, dict[str, str]]] = {}
        self._operators: dict[str, float] = {}
        every = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
        for topic, sample in _TICKS.items():
            self.create_subscription(
                message_type(sample), topic, self._taker(topic), NEWEST, raw=True
            )
        self.create_subscription(
            message_type(OperatorCommand), "/cassie/operator_command", self._on_command, every
        )
        self.create_subscription(SupervisorStatus, "/cassie/supervisor_status", self._hear, every)
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, every)

    def listen(self, seconds: float) -> None:
        """Sample the messages at intervals: messages between two intervals cost nothing here.

        A topic of every tick gets up to `_EXTRA_TIME` until two samples have come, if its node or
        writer exists. So does the sensors' topic if any node exists. On a busy machine a reader may
        be discovered late, and a lost discovery message is repeated after 3 s.
        """
        begin = time.monotonic()
        while (gone := time.monotonic() - begin - seconds) < 0.0 or (
            gone < _EXTRA_TIME and self._waits()
        ):
            time.sleep(0.05)
            look = time.monotonic()
            while time.monotonic() - look < 0.02:
                rclpy.spin_once(self, timeout_sec=0.0)

    def _waits(self) -> bool:
        """Whether a topic of every tick should have a writer but gave less than two samples."""
        nodes = {name.rpartition("/")[2] for name in self._names()}
        return any(
            len(heads) < 2
            and (
                LANE[topic] in nodes
                or self.count_publishers(topic) > 0
                or (topic == "/cassie/sensors" and nodes)
            )
            for topic, heads in self._heads.items()
        )

    def facts(self) -> Facts:
        """The observed facts; requests parameters from the nodes of the loop."""
        parameters = {name: dict(self._parameters_of(name)) for name in _NODES}
        status = self._status
        loop = self._reports.get("simulator: loop", (0, "", {}))
        return Facts(
            domain=self.context.get_domain_id(),
            other_domains=tuple(sorted(held_domains() - {self.context.get_domain_id()})),
            held=tuple(sorted(held_roles(self.context.get_domain_id()))),
            discovery=_DISCOVERY,
            nodes=tuple(self._names()),
            ends=tuple(self._ends()),
            rates={topic: rate for topic in _TICKS if (rate := self._rate(topic)[0]) > 0.0},
            real_time_factor=self._rate("/cassie/sensors")[1],
            paused=loop[1] == "paused",
            clock_differences=dict(self._operators),
            diagnostics=tuple((v[0], k, v[1]) for k, v in sorted(self._reports.items())),
            faults=tuple(status.faults) if status else (),
            mode=status.mode if status else "",
            readiness=status.readiness if status else "",
            missed_share=status.missed_share if status else 0.0,
            changed=tuple(
                (node, name, value, default)
                for node, values in parameters.items()
                for name, (value, default) in values.items()
                if default is not None and not _same(value, default)
            ),
            files=tuple(_files(parameters["gait_controller"])),
            joysticks=tuple(joysticks()),
            disk={str(f): shutil.disk_usage(f).free for f in _folders()},
        )

    def settle(self) -> None:
        """Wait until discovery finds nothing new."""
        wait_for_discovery(lambda: [*self._names(), *sorted(map(str, self._ends()))])

    def _taker(self, topic: str) -> Any:
        taken = self._heads.setdefault(topic, [])

        def take(data: bytes, info: dict[str, int]) -> None:
            if len(data) < _HEAD.size:
                return
            seconds, nanoseconds, episode, seq = _HEAD.unpack_from(data)
            # When it was written: it may have waited here, for longest on a busy machine.
            written = 1e-9 * info["source_timestamp"]
            taken.append((written, seconds + 1e-9 * nanoseconds, episode, seq))

        return take

    def _on_command(self, message: Any) -> None:
        if not message.scripted:  # a script's stamps are robot time
            stamp = message.stamp.sec + 1e-9 * message.stamp.nanosec
            self._operators[bytes(message.sender).rstrip(b"\0").decode()] = stamp - time.time()

    def _hear(self, message: SupervisorStatus) -> None:
        self._status = message

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for each in message.status:
            values = {pair.key: pair.value for pair in each.values}
            self._reports[each.name] = (int.from_bytes(each.level, "little"), each.message, values)

    def _rate(self, topic: str) -> tuple[float, float | None]:
        """Ticks per wall time, and ratio of robot time to wall time, of the newest episode."""
        heads = [h for h in self._heads[topic] if h[2] == self._heads[topic][-1][2]]
        if len(heads) < 2 or heads[-1][0] <= heads[0][0]:
            return 0.0, None
        wall = heads[-1][0] - heads[0][0]
        return (heads[-1][3] - heads[0][3]) / wall, (heads[-1][1] - heads[0][1]) / wall

    def _names(self) -> list[str]:
        found = self.get_node_names_and_namespaces()
        names = sorted(f"{space.rstrip('/')}/{name}" for name, space in found)
        names.remove(self.get_fully_qualified_name())
        return names

    def _ends(self) -> Iterator[End]:
        for topic in (*LANE, *_TOPICS):
            for writes, infos in (
                (True, self.get_publishers_info_by_topic(topic)),
                (False, self.get_subscriptions_info_by_topic(topic)),
            ):
                for info in infos:
                    if info.node_name == self.get_name():
                        continue
                    yield End(
                        topic=topic,
                        node=f"{info.node_namespace.rstrip('/')}/{info.node_name}",
                        type=info.topic_type,
                        writes=writes,
                        reliable=info.qos_profile.reliability == _RELIABLE,
                        latched=info.qos_profile.durability == _LATCHED,
                    )

    def _parameters_of(self, name: str) -> Iterator[tuple[str, tuple[Any, Any]]]:
        """Name, value and default of a node's parameters; none if it does not answer."""
        if f"/{name}" not in self._names():
            return
        listed = self._ask(name, "list_parameters", ListParameters)
        if listed is None:
            return
        names = listed.result.names
        values = self._ask(name, "get_parameters", GetParameters, names=names)
        described = self._ask(name, "describe_parameters", DescribeParameters, names=names)
        if values is None or described is None:
            return
        for key, value, descriptor in zip(
            names, values.values, described.descriptors, strict=False
        ):
            plain = parameter_value_to_python(value)
            plain = list(plain) if hasattr(plain, "typecode") else plain
            yield key, (plain, default_of(descriptor))

    def _ask(self, node: str, service: str, kind: Any, **fields: Any) -> Any:
        client = self.create_client(kind, f"/{node}/{service}")
        if not client.wait_for_service(_ANSWER):
            return None
        future = client.call_async(kind.Request(**fields))
        rclpy.spin_until_future_complete(self, future, timeout_sec=_ANSWER)
        return future.result() if future.done() else None


# The range before this process, or the one that started it, selected the loopback interface.
_DISCOVERY = (
    "LOCALHOST"
    if os.environ.get("FASTRTPS_DEFAULT_PROFILES_FILE") == str(PROFILE)
    else os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "")
)


def _same(value: Any, default: Any) -> bool:
    """Whether two values are equal; an integer may stand for a float."""
    if isinstance(value, float) and isinstance(default, (int, float)):
        return math.isclose(value, default)
    return bool(value == default)


def _files(parameters: dict[str, tuple[Any, Any]]) -> Iterator[tuple[str, str, bool]]:
    """The controller's gait library if it is given by path, and missing packages."""
    path = str(parameters.get("gait_library", ("", ""))[0])
    if "/" in path:
        yield "gait library", path, Path(path).is_file()
    for package in ("cassie_gaits", "cassie_control", "cassie_sim"):
        try:
            get_package_share_directory(package)
        except PackageNotFoundError:
            yield "package", package, False


def joysticks(
    known: Path = Path("/sys/class/input"), devices: Path = Path("/dev/input")
) -> Iterator[tuple[str, bool]]:
    """Device file of each joystick that `joystick` opens, and whether this user may read it.

    Args:
        known: Folder in which the kernel lists input devices.
        devices: Folder of the device files.
    """
    for event in sorted(known.glob("js*/device/event*")):
        path = devices / event.name
        if path.exists():
            yield str(path), os.access(path, os.R_OK)


def _folders() -> set[Path]:
    """Folders in which bags and logs are written."""
    logs = Path(os.environ.get("ROS_LOG_DIR", Path.home() / ".ros"))
    return {Path.cwd(), logs if logs.is_dir() else Path.home()}


def main() -> None:
    """Examine the robot, report, and end with an exit status, which `--help` explains."""
    parser = argparse.ArgumentParser(
        "ros2 run cassie_teleop doctor",
        description="Examines the running robot and prints problems and remedies, the most severe "
        "first. Exit status: 0 no problem, 1 a problem, 2 no examination possible, 130 Ctrl-C.",
        epilog="Reads the ROS graph, /diagnostics, /cassie/supervisor_status, "
        f"/cassie/operator_command and {', '.join(LANE)}; requests parameters of the nodes.",
    )
    parser.add_argument("--json", action="store_true", help="facts and findings as JSON")
    parser.add_argument(
        "--seconds", type=_seconds, default=3.0, help="time to observe (default: 3)"
    )
    options = parser.parse_args(own_arguments("doctor"))
    status = 2
    try:
        use_loopback()
        rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
        doctor = Doctor()
        doctor.settle()
        doctor.listen(options.seconds)
        facts = doctor.facts()
        doctor.destroy_node()
        found = findings(facts)
        print(json.dumps(as_json(facts, found)) if options.json else report(facts, found))
        status = exit_code(found)
    except KeyboardInterrupt:
        status = 130
    except (OSError, ValueError, RCLError) as error:
        print(f"doctor: error: {' '.join(str(error).split())}", file=sys.stderr)
    finally:
        with contextlib.suppress(RCLError):
            rclpy.try_shutdown()
    sys.stdout.flush()
    sys.exit(status)


def _seconds(text: str) -> float:
    value = float(text)
    if not 0.5 <= value <= 600.0:
        raise argparse.ArgumentTypeError(f"{text} is outside 0.5 .. 600")
    return value
