"""Node of a command that starts other nodes and ends after them."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from cassie_msgs.ros.process import LEAVE_TIMEOUT
from cassie_msgs.ros.transport import use_loopback

_LOOK, _QUIET = 0.02, 0.1  # s between two checks of the nodes; s without a change before it ends


@contextmanager
def onlooker(name: str, domain: int | None = None) -> Iterator[tuple[Node, SingleThreadedExecutor]]:
    """A node in a context of its own, and the executor that serves it when spun.

    The node has to leave after the nodes that it observes: DDS may hang if two leave at the same
    time (see `LEAVE_TIMEOUT`). So it waits until no other node is leaving.

    Args:
        name: Name of the node.
        domain: ROS domain; None for that of the environment.
    """
    context = Context()
    use_loopback()
    rclpy.init(args=[], context=context, domain_id=domain)
    node = rclpy.create_node(name, context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    try:
        yield node, executor
    finally:
        _await_quiet(node)
        executor.shutdown()
        node.destroy_node()
        rclpy.shutdown(context=context)


def _await_quiet(node: Node) -> None:
    known, since = node.get_node_names(), time.monotonic()
    deadline = since + LEAVE_TIMEOUT
    while (now := time.monotonic()) < min(deadline, since + _QUIET):
        if (names := node.get_node_names()) != known:
            known, since = names, now
        time.sleep(_LOOK)
