"""A node that resumes a paused simulator and reads the clock."""

from __future__ import annotations

import struct
import time
from contextlib import ExitStack

from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool

from cassie_bags.errors import RunError
from cassie_bags.ros.onlooker import onlooker
from cassie_msgs.ros.fast_lane import RawSubscription

_NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
_PAUSE_SERVICE = "/cassie/pause"
_STAMP = struct.Struct("<4xiI")


class Spectator:
    """Observes a run from the command line's process.

    Use it in a `with` statement around that of the nodes.

    Args:
        domain: ROS domain of the nodes.
    """

    def __init__(self, domain: int) -> None:
        self._leave = ExitStack()
        node, self._executor = self._leave.enter_context(onlooker("experiment", domain))
        self._clock = RawSubscription(node, Clock, "/clock", _NEWEST)
        self._pause = node.create_client(SetBool, _PAUSE_SERVICE)
        self._time = 0.0

    def resume(self, timeout: float) -> None:
        """Resume the simulator.

        Args:
            timeout: Time-out of the simulator's answer. In s of wall time.

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
        raw = self._clock.take_raw()
        if raw is not None:
            seconds, nanoseconds = _STAMP.unpack_from(raw)
            self._time = seconds + nanoseconds * 1e-9
        return self._time

    def __enter__(self) -> Spectator:
        return self

    def __exit__(self, *_: object) -> None:
        self._leave.close()
