"""Node of a command that starts other nodes and ends after them; client of a paused simulator."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool

from cassie_bags.errors import RunError
from cassie_msgs.ros.fast_lane import RawSubscription
from cassie_msgs.ros.process import LEAVE_TIMEOUT
from cassie_msgs.ros.transport import use_loopback

_CHECK_PERIOD = 0.02  # s between two checks of the nodes
_QUIET = 0.1  # s without a change before it ends
_NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
_PAUSE_SERVICE = "/cassie/pause"


@contextmanager
def command_node(
    name: str, domain: int | None = None
) -> Iterator[tuple[Node, SingleThreadedExecutor]]:
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
        time.sleep(_CHECK_PERIOD)


@contextmanager
def simulator_client(domain: int) -> Iterator[SimulatorClient]:
    """A client of the simulator in a ROS domain; the nodes of the run end before it."""
    with command_node("experiment", domain) as (node, executor):
        yield SimulatorClient(node, executor)


class SimulatorClient:
    """Resumes a paused simulator, and reads its clock, by the node of a command."""

    def __init__(self, node: Node, executor: SingleThreadedExecutor) -> None:
        self._executor = executor
        self._clock = RawSubscription(node, Clock, "/clock", _NEWEST)
        self._pause = node.create_client(SetBool, _PAUSE_SERVICE)
        self._time = 0.0

    def resume(self, timeout: float) -> None:
        """Resume the simulator, which has to answer within the time-out (s of wall time).

        Raises:
            RunError: if the simulator does not answer, or refuses.
        """
        deadline = time.monotonic() + timeout
        if not self._pause.wait_for_service(timeout):
            raise RunError(f"the simulator offers no {_PAUSE_SERVICE} within {timeout:g} s")
        future = self._pause.call_async(SetBool.Request(data=False))
        self._executor.spin_until_future_complete(future, deadline - time.monotonic())
        if not future.done():
            raise RunError(f"{_PAUSE_SERVICE} does not answer within {timeout:g} s")
        answer = future.result()
        if answer is None or not answer.success:
            raise RunError(f"the simulator does not start: {answer and answer.message}")

    def robot_time(self) -> float:
        """Newest robot time on /clock. In s."""
        message = self._clock.take_message()
        if message is not None:
            self._time = message.clock.sec + message.clock.nanosec * 1e-9
        return self._time
