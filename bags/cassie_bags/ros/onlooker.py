"""A node of a command that starts other nodes and outlives them."""

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

_LOOK, _QUIET = 0.02, 0.1  # s between two looks at who is left, and for which that has to stay


@contextmanager
def onlooker(name: str, domain: int | None = None) -> Iterator[tuple[Node, SingleThreadedExecutor]]:
    """A node in a context of its own, and the executor that serves it when it is spun.

    It should leave after the nodes that it looks at, since DDS may hang if two leave at the same
    time (see `LEAVE_TIMEOUT`); it waits until nobody leaves any more.

    Args:
        name: Of the node.
        domain: ROS domain; None is the environment's.
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
