"""Diagnostics of a node, on /diagnostics and in its log."""

from __future__ import annotations

import threading
from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

from cassie_msgs.ros.periodic import Periodic

OK, WARN, ERROR, STALE = 0, 1, 2, 3


@dataclass(frozen=True)
class _Report:
    level: int
    message: str
    values: tuple[tuple[str, str], ...]


class Diagnostics:
    """Reports of one node: published at each change and every second, logged once per change."""

    def __init__(self, node: Node) -> None:
        """Create the publisher."""
        self._node = node
        self._lock = threading.Lock()
        self._reports: dict[str, _Report] = {}
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        Periodic(node, 1.0, self.publish)

    def set(self, subject: str, level: int, message: str, **values: object) -> None:
        """Set the state of `subject`; cheap while neither level nor message changes.

        Args:
            subject: Subject of the report, such as "loop"; it is prefixed with the node's name.
            level: OK, WARN, ERROR or STALE.
            message: One line for people.
            **values: Further values of the report.
        """
        old = self._reports.get(subject)
        pairs = tuple((key, str(value)) for key, value in values.items())
        with self._lock:
            self._reports[subject] = _Report(level, message, pairs)
        if old is not None and (old.level, old.message) == (level, message):
            return
        self.publish()
        if level != OK or (old is not None and old.level != OK):
            self._log(level, f"{subject}: {message}")

    def publish(self) -> None:
        """Send the current state of all reports."""
        with self._lock:
            reports = list(self._reports.items())
        if not reports:
            return
        name = self._node.get_name()
        array = DiagnosticArray()
        array.header.stamp = self._node.get_clock().now().to_msg()
        array.status = [
            DiagnosticStatus(
                level=bytes([report.level]),
                name=f"{name}: {subject}",
                message=report.message,
                hardware_id="cassie",
                values=[KeyValue(key=key, value=value) for key, value in report.values],
            )
            for subject, report in reports
        ]
        self._publisher.publish(array)

    def _log(self, level: int, text: str) -> None:
        # rclpy identifies callers by line, and refuses a caller that changes its severity.
        logger = self._node.get_logger()
        if level == OK:
            logger.info(text)
        elif level == WARN:
            logger.warning(text)
        else:
            logger.error(text)
