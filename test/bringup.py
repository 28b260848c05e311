"""Real nodes as processes, and eyes on their topics, for the bring-up tests.

Everything waits by condition; nothing outlives the `with` statement of a `Robot`.
"""

from __future__ import annotations

import math
import signal
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from types import TracebackType
from typing import Any

import rclpy
import yaml
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from std_srvs.srv import SetBool

from cassie_bags.ros.processes import (
    Processes,
    environment,
    executable,
    own_domain,
    write_parameters,
)
from cassie_msgs.layout import LayoutError, MotorCommand, Sensors
from cassie_msgs.msg import SupervisorStatus
from cassie_msgs.ros.fast_lane import NEWEST, LaneSubscription, RawSubscription
from cassie_msgs.ros.one_writer import OneWriter, WriterWatch
from cassie_msgs.ros.transport import use_loopback
from cassie_msgs.srv import Gantry, Push, Reset, Step

use_loopback()

PACKAGES = {
    "state_estimator": "cassie_control",
    "gait_controller": "cassie_control",
    "mode_supervisor": "cassie_control",
    "scripted_operator": "cassie_teleop",
    "simulator": "cassie_sim",
}
"""Package of each node of the loop, in the order in which they are started."""

BESIDE = {"gait_optimizer": "cassie_gaits"}
"""Package of nodes that a test may start beside the loop."""

SERVICES = {
    "reset": Reset,
    "pause": SetBool,
    "step": Step,
    "push": Push,
    "gantry": Gantry,
}

TIMEOUT = 90.0
"""Wall time in which anything must happen that happens at all. In s."""

STAND = ({"t": 0.0, "power": True, "mode": "stand", "height": 0.9},)
WALK = (*STAND, {"t": 1.0, "mode": "walk"})


class Stalls:
    """Times for which a busy machine kept programs waiting for a processor.

    A limit in wall time is one of the software on a machine that is its own, so these times do not
    count, except that a tenth of the wall time always does. Where Linux tells of its pressure, that
    is any time in which a thread waited; elsewhere only how much too late a sleeping thread of this
    process woke up.
    """

    def __init__(self) -> None:
        self._waited: list[tuple[float, float]] = []
        threading.Thread(target=self._run, daemon=True).start()

    def took(self, begin: float, end: float) -> float:
        """Wall time from `begin` to `end` without the stalls in between. In s."""
        waited = sum(span for when, span in self._waited[:] if begin < when <= end)
        return max(0.1 * (end - begin), end - begin - waited)

    def _run(self) -> None:
        before, pressure = time.monotonic(), _pressure()
        while True:
            time.sleep(0.005)
            now, more = time.monotonic(), _pressure()
            late, told = now - before - 0.005, more - pressure
            if waited := min(max(late if late > 0.005 else 0.0, told), now - before):
                self._waited.append((now, waited))
            before, pressure = now, more


def _pressure() -> float:
    """Time in which a thread of any program waited for a processor, since the start. In s."""
    try:
        return 1e-6 * int(Path("/proc/pressure/cpu").read_text().split()[4].partition("=")[2])
    except OSError:
        return 0.0


_STALLS = Stalls()
took = _STALLS.took


class Robot:
    """Nodes of one robot in a ROS domain of their own.

    Args:
        folder: For logs and parameter files.
        operator: Steps of the scripted operator.
        parameters: ROS parameters by node, beside what makes them work together.
    """

    def __init__(
        self,
        folder: Path,
        operator: Sequence[Mapping[str, Any]] = STAND,
        **parameters: Mapping[str, Any],
    ) -> None:
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        script = folder / "script.yaml"
        script.write_text(yaml.safe_dump({"operator": [dict(step) for step in operator]}))
        self._parameters: dict[str, dict[str, Any]] = {
            "state_estimator": {},
            "gait_controller": {},
            "mode_supervisor": {"scripted_operator": True},
            "scripted_operator": {"script": str(script)},
            "simulator": {"scripted_operator": True, "start": "standing", "max_rate": 0.0},
            "gait_optimizer": {},
        }
        for name, given in parameters.items():
            self._parameters[name] |= given
        self._exits = ExitStack()

    def __enter__(self) -> Robot:
        self.domain = self._exits.enter_context(own_domain())
        logs = self.folder / "log"
        self.processes = self._exits.enter_context(Processes(environment(self.domain), logs))
        self.eyes = self._exits.enter_context(Eyes(self.domain))
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._exits.close()
        if error is not None:
            for log in sorted((self.folder / "log").glob("*.log")):
                print(f"--- {log.stem}\n{log.read_text(errors='replace')[-1500:]}")

    def start(self, *names: str, **parameters: Any) -> None:
        """Start nodes; all of the loop if none is named."""
        for name in names or PACKAGES:
            own = self._parameters[name] | parameters
            words = write_parameters(self.folder / f"{name}.yaml", {"/**": own})
            package = PACKAGES.get(name) or BESIDE[name]
            self.processes.start(name, [executable(package, name), *words])

    def go(self) -> None:
        """Let a simulator that began paused run, once everybody answers its first sample."""
        eyes = self.eyes
        eyes.wait_for(
            lambda: (
                eyes.episode
                and eyes.statuses
                and eyes.statuses[-1][1].episode == eyes.episode
                and int(eyes.command.episode) == eyes.episode  # receivers bind to who writes first
            ),
            "everybody to take part",
        )
        assert self.call("pause", data=False).success

    def record(self) -> Path:
        """Start a recorder; returns the bag it writes."""
        bag = self.folder / "run.mcap"
        self.processes.start("record", [executable("cassie_bags", "record"), "-o", bag])
        return bag

    def kill(self, name: str) -> float:
        """SIGKILL a node; returns the wall time of it."""
        now = time.monotonic()
        self.processes.signal(name, signal.SIGKILL)
        self.eyes.wait_for(lambda: not self.processes.running(name), f"{name} to die")
        return now

    def call(self, service: str, **fields: Any) -> Any:
        """Call a service of the simulator and return its response."""
        return self.eyes.call(service, fields)

    def stands(self) -> bool:
        """Whether Cassie is up, by its true height."""
        return self.eyes.height() > 0.75


class Eyes:
    """What an onlooker sees of a robot.

    Attributes:
        statuses: Supervisor's status messages, each with the wall time of its arrival.
        reports: Diagnostic statuses, likewise.
        seen: Nothing is taken in but in `wait_for`, `look` and `call`.
    """

    def __init__(self, domain: int) -> None:
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        self.node = Node("eyes", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self.statuses: list[tuple[float, SupervisorStatus]] = []
        self.reports: list[tuple[float, Any]] = []
        self.node.create_subscription(
            SupervisorStatus, "/cassie/supervisor_status", self._on_status, 50
        )
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 100)
        self.sensors, self.command = Sensors(), MotorCommand()
        simulator, controller = OneWriter(Sensors), OneWriter(MotorCommand)
        self._sensors = LaneSubscription(self.node, Sensors, guard=simulator)
        self._commands = LaneSubscription(self.node, MotorCommand, guard=controller)
        WriterWatch(self.node, [simulator, controller], [], lambda topic, problem: None)
        self._truth = RawSubscription(self.node, Odometry, "/cassie/ground_truth", NEWEST)
        self._odometry = Odometry()

    def __enter__(self) -> Eyes:
        return self

    def __exit__(self, *_: object) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)

    def look(self, timeout: float = 0.01) -> None:
        """Take in what has come."""
        self._executor.spin_once(timeout_sec=timeout)
        with suppress(LayoutError):  # of a stranger
            self._sensors.take(self.sensors)
        with suppress(LayoutError):
            self._commands.take(self.command)
        if (raw := self._truth.take_raw()) is not None:
            self._odometry = deserialize_message(raw, Odometry)

    def wait_for(self, condition: Callable[[], Any], what: str, timeout: float = TIMEOUT) -> float:
        """Look until a condition holds; returns the wall time at which it did.

        Stalls of the machine do not count for `timeout`.

        Raises:
            AssertionError: if it does not come about in time.
        """
        started = time.monotonic()
        while not condition():
            if took(started, time.monotonic()) > timeout:
                raise AssertionError(f"waited {timeout:g} s in vain for {what}; {self.summary()}")
            self.look()
        return time.monotonic()

    def call(self, service: str, fields: Mapping[str, Any]) -> Any:
        """Call a service of the simulator and return its response."""
        client = self.node.create_client(SERVICES[service], f"/cassie/{service}")
        try:
            self.wait_for(client.service_is_ready, f"service {service}")
            future = client.call_async(SERVICES[service].Request(**fields))
            self.wait_for(future.done, f"the answer of {service}")
            return future.result()
        finally:
            self.node.destroy_client(client)

    @property
    def mode(self) -> str:
        """Mode by the newest status of the supervisor."""
        return self.statuses[-1][1].mode if self.statuses else ""

    @property
    def faults(self) -> list[str]:
        """Faults by the newest status of the supervisor."""
        return list(self.statuses[-1][1].faults) if self.statuses else []

    def held_up(self, within: float) -> bool:
        """Whether the supervisor has told of a lost node or operator within so much robot time.

        On a busy machine a node may be late: then the robot stops, stands, and goes on.
        """
        now = _stamp(self.statuses[-1][1])
        for _, status in reversed(self.statuses):
            if _stamp(status) < now - within:
                return False
            if any(" lost" in fault for fault in status.faults):
                return True
        return False

    @property
    def tick(self) -> int:
        """Newest tick of the simulator."""
        return int(self.sensors.seq)

    @property
    def episode(self) -> int:
        """Present episode of the simulator."""
        return int(self.sensors.episode)

    def height(self) -> float:
        """True height of the pelvis. In m."""
        return float(self._odometry.pose.pose.position.z)

    def position(self) -> tuple[float, float]:
        """True position of the pelvis on the ground. In m."""
        position = self._odometry.pose.pose.position
        return float(position.x), float(position.y)

    def yaw(self) -> float:
        """True heading of the pelvis. In rad."""
        q = self._odometry.pose.pose.orientation
        return math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y**2 + q.z**2))

    def fault_since(self, since: float, text: str) -> bool:
        """Whether the supervisor's status has named such a fault after a wall time."""
        return any(
            text in fault
            for when, status in self.statuses
            if when >= since
            for fault in status.faults
        )

    def report_since(self, since: float, name: str, text: str = "") -> bool:
        """Whether /diagnostics had an error of that name and text after a wall time."""
        return any(
            when >= since
            and report.name == name
            and report.level != b"\0"
            and text in report.message
            for when, report in self.reports
        )

    def is_well(self, name: str) -> bool:
        """Whether the newest report of that name is that all is well."""
        levels = [report.level for _, report in self.reports if report.name == name]
        return not levels or levels[-1] == b"\0"

    def summary(self) -> str:
        """Where things stand, for the message of a failure."""
        wrong = {report.name: report.message for _, report in self.reports if report.level != b"\0"}
        return (
            f"episode {self.episode} tick {self.tick} mode {self.mode!r} faults {self.faults} "
            f"height {self.height():.2f}, reported so far {wrong}"
        )

    def _on_status(self, message: SupervisorStatus) -> None:
        self.statuses.append((time.monotonic(), message))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        now = time.monotonic()
        self.reports.extend((now, status) for status in message.status)


def _stamp(status: SupervisorStatus) -> float:
    """Robot time at which the supervisor said so. In s."""
    return float(status.header.stamp.sec + 1e-9 * status.header.stamp.nanosec)
