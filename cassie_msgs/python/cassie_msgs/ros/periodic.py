"""Periodic calls of a node, besides its loop."""

from __future__ import annotations

import threading
from collections.abc import Callable

from rclpy.exceptions import InvalidHandle
from rclpy.node import Node


class Periodic:
    """Calls a function at intervals of wall time, in its own thread, while its node lives.

    To serve a timer, rclpy's executor needs the interpreter for half a millisecond, and a control
    tick must wait for that. Here the interpreter is held during the call only.

    Args:
        node: Node whose context ends the calls.
        period: Time between calls, and before the first call, in s.
        call: The function. An exception in it ends a process that `process.run` runs.
    """

    def __init__(self, node: Node, period: float, call: Callable[[], object]) -> None:
        self._period, self._call = period, call
        self._ended = threading.Event()
        node.context.on_shutdown(self.end)
        threading.Thread(target=self._run, name="periodic", daemon=True).start()

    def end(self) -> None:
        """End the calls."""
        self._ended.set()

    def _run(self) -> None:
        while not self._ended.wait(self._period):
            try:
                self._call()
            except InvalidHandle:  # the node is destroyed
                return
