"""A node that starts a paused simulator and looks at the clock now and then."""

from __future__ import annotations

import time
from types import TracebackType

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool

from cassie_bags.errors import RunError
from cassie_msgs.ros.fast_lane import _NotForExecutors as NotForExecutors

_NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
_PAUSE_SERVICE = "/cassie/pause"


class Spectator:
    """Looks on from the command line's process. Use it in a `with` statement.

    Args:
        domain: ROS domain of the nodes.
    """

    def __init__(self, domain: int) -> None:
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        self._node = rclpy.create_node("experiment", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._clock = self._node.create_subscription(
            Clock, "/clock", _ignore, _NEWEST, callback_group=NotForExecutors()
        )
        self._pause = self._node.create_client(SetBool, _PAUSE_SERVICE)
        self._time = 0.0

    def resume(self, patience: float) -> None:
        """Have the simulator run.

        Args:
            patience: Wall time in which it must answer. In s.

        Raises:
            RunError: if it does not, or refuses.
        """
        deadline = time.monotonic() + patience
        if not self._pause.wait_for_service(patience):
            raise RunError(f"the simulator offers no {_PAUSE_SERVICE} within {patience:g} s")
        future = self._pause.call_async(SetBool.Request(data=False))
        self._executor.spin_until_future_complete(future, deadline - time.monotonic())
        if not future.done():
            raise RunError(f"{_PAUSE_SERVICE} does not answer within {patience:g} s")
        answer = future.result()
        if answer is None or not answer.success:
            raise RunError(f"the simulator does not start: {answer and answer.message}")

    def robot_time(self) -> float:
        """Newest robot time on /clock. In s."""
        taken = self._clock.handle.take_message(Clock, False)
        if taken is not None:
            stamp = taken[0].clock
            self._time = stamp.sec + stamp.nanosec * 1e-9
        return self._time

    def __enter__(self) -> Spectator:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._executor.shutdown()
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)


def _ignore(_: object) -> None:
    """Callback of a subscription that no executor serves."""
