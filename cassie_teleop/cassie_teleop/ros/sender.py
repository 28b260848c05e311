"""Sends a person's requests: stamped with the wall clock, with seq and episode 0."""

from __future__ import annotations

import os
import time

from rclpy.node import Node

from cassie_msgs.layout import OperatorCommand
from cassie_msgs.operators import write_sender
from cassie_msgs.request import Request, write
from cassie_msgs.ros.fast_lane import LanePublisher

_FLUSH = 1.0  # s


class Sender:
    """Publisher of /cassie/operator_command for a person.

    Attributes:
        name: Name of the sender in the commands.
    """

    def __init__(self, node: Node) -> None:
        """Create the publisher."""
        self._publisher = LanePublisher(node, OperatorCommand)
        self._command = OperatorCommand()
        self.name = f"{node.get_name()}-{os.getpid()}"
        write_sender(self._command, self.name)

    def send(self, request: Request) -> None:
        """Send a request, stamped with the present time."""
        write(request, self._command)
        self._command.stamp_ns = time.time_ns()
        self._publisher.publish(self._command)

    def send_last(self, request: Request) -> None:
        """Send a request and wait until it has arrived, at most a second."""
        self.send(request)
        self._publisher.flush(_FLUSH)
