"""The console's subscriptions, taken as raw bytes between its other work."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import Any

from ament_index_python.packages import get_package_share_directory
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from cassie_msgs.layout import ControllerStatus, Mode, OperatorCommand, RobotState
from cassie_msgs.msg import SupervisorStatus
from cassie_msgs.operators import sender_of
from cassie_msgs.ros.fast_lane import NEWEST, LaneSubscription, RawSubscription, take_from_each
from cassie_msgs.sample import LayoutError
from cassie_msgs.standard_messages import read_transforms
from cassie_teleop.page_frame import Picture, finite
from cassie_teleop.robot_description import (
    DescriptionError,
    RobotDescription,
    read_description,
)

_ONLOOKER = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
_LATCHED = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
_STATUS_AGE = 2.5  # s; the supervisor sends a status at least once per second of wall time
_REPORT_AGE = 3.0  # s after which a report on /diagnostics is forgotten
_WARN = 1
_MAX_REPORTS = 8


class ConsoleTopics:
    """Subscriptions of the console while a page is open.

    Attributes:
        picture: Values from the control lane and /tf.
        description: The robot; None before /robot_description was received.
        problem: Why the robot cannot be drawn; empty if it can.
        holder: Name of the lease's holder, by the supervisor.
        new_episode: Whether an episode has begun since the last `take`.
    """

    def __init__(self, node: Node) -> None:
        self.picture = Picture()
        self.description: RobotDescription | None = None
        self.problem = ""
        self.holder = ""
        self.new_episode = False
        self._node = node
        self._status: SupervisorStatus | None = None
        self._status_at = -math.inf
        self._reports: dict[str, tuple[float, int, str]] = {}
        self._text = ""
        self._command = OperatorCommand()
        self._state = LaneSubscription(node, RobotState)
        self._mode = LaneSubscription(node, Mode)
        self._controller = LaneSubscription(node, ControllerStatus)
        self._commands = LaneSubscription(node, OperatorCommand, qos=_ONLOOKER)
        self._transforms = RawSubscription(node, TFMessage, "/tf", _ONLOOKER)
        self._statuses = RawSubscription(
            node, SupervisorStatus, "/cassie/supervisor_status", _ONLOOKER
        )
        self._diagnostics = RawSubscription(node, DiagnosticArray, "/diagnostics", _ONLOOKER)
        self._descriptions = RawSubscription(node, String, "/robot_description", _LATCHED)
        self._vehicle = RawSubscription(node, Odometry, "/segway/ground_truth", NEWEST)

    def close(self) -> None:
        """End the subscriptions."""
        for each in (
            *(self._state, self._mode, self._controller, self._commands, self._transforms),
            *(self._statuses, self._diagnostics, self._descriptions, self._vehicle),
        ):
            self._node.destroy_subscription(each.subscription)

    def take(self, now: float) -> None:
        """Take received messages; of most topics only the newest one."""
        picture = self.picture
        self.new_episode = False
        if (raw := self._state.take_raw()) is not None:
            self.new_episode = picture.follow_state(raw, now)
        if (raw := self._mode.take_raw()) is not None:
            picture.mode.load(raw, now)
        if (raw := self._controller.take_raw()) is not None:
            picture.controller.load(raw, now)
        for _, raw in take_from_each(self._commands, most=1):
            self._follow_command(raw, now)
        for _, raw in take_from_each(self._transforms, most=1):
            with suppress(LayoutError):
                picture.poses.update(read_transforms(raw))
        for _, raw in take_from_each(self._statuses, most=1):
            if (status := self._statuses.read(raw)) is not None:
                self._status, self._status_at, self.holder = status, now, status.holder
        if (odometry := self._vehicle.take_message()) is not None:
            picture.segway = (odometry.twist.twist.linear.x, now)
        while (reports := self._diagnostics.take_message()) is not None:
            for report in reports.status:
                self._reports[report.name] = (now, report.level[0], report.message)
        while (description := self._descriptions.take_message()) is not None:
            self._describe(description.data)

    def robot(self, now: float) -> dict[str, Any] | None:
        """The supervisor's status, for JSON; None while the supervisor is silent."""
        status = self._status
        if status is None or now - self._status_at > _STATUS_AGE:
            return None
        names = ("mode", "requested", "readiness", "fallen", "link", "armed", "holder")
        return {
            **{name: getattr(status, name) for name in names},
            "stand": status.stand_readiness,
            "walk": status.walk_readiness,
            "segway": status.segway_readiness,
            "faults": list(status.faults),
            "operators": list(status.operators),
            "missed": int(status.missed_ticks),
            "late": int(status.late_ticks),
            "delay": finite(status.longest_delay, 4),
            "share": finite(status.missed_share, 5),
        }

    def reports(self, now: float) -> list[str]:
        """Warnings and errors of nodes on /diagnostics."""
        self._reports = {
            name: report for name, report in self._reports.items() if now - report[0] < _REPORT_AGE
        }
        warnings = sorted(
            f"{name}: {text}" for name, (_, level, text) in self._reports.items() if level >= _WARN
        )
        return warnings[:_MAX_REPORTS]

    def _follow_command(self, raw: bytes, now: float) -> None:
        """Take in the command of the driving operator, or of any operator while none is known."""
        with suppress(ValueError):
            self._command.load(raw)
            if self.holder in ("", sender_of(self._command)):
                self.picture.operator.load(raw, now)

    def _describe(self, text: str) -> None:
        if text == self._text:
            return
        self._text, self.problem = text, ""
        try:
            self.description = read_description(text, get_package_share_directory)
        except DescriptionError as error:
            self.problem = str(error)
            self._node.get_logger().warning(self.problem)
