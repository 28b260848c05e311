"""What a node does now and then, beside its loop."""

from __future__ import annotations

import threading
from collections.abc import Callable

from rclpy.exceptions import InvalidHandle
from rclpy.node import Node


class Periodic:
    """Calls a function at intervals of wall time, in a thread of its own, while its node lives.

    To serve a timer, rclpy's executor needs the interpreter for half a millisecond, and a control
    tick has to wait for that. Here it is held for the call alone.

    Args:
        node: Node whose context ends the calls.
        period: Between calls, in s. The first comes after it.
        call: What is called. What it raises ends a process that `process.run` runs.
    """

    def __init__(self, node: Node, period: float, call: Callable[[], object]) -> None:
        self._period, self._call = period, call
        self._ended = threading.Event()
        node.context.on_shutdown(self.end)
        threading.Thread(target=self._run, name="periodic", daemon=True).start()

    def end(self) -> None:
        """Call it no more."""
        self._ended.set()

    def _run(self) -> None:
        while not self._ended.wait(self._period):
            try:
                self._call()
            except InvalidHandle:  # the node is destroyed
                return
