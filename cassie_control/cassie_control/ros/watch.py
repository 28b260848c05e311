"""Watches which of the other nodes has fallen silent."""

from __future__ import annotations

import time

from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

from cassie_control.ros.common import SILENT_AFTER, START_PATIENCE, Conditions
from cassie_control.silence import Silence
from cassie_msgs.layout import ControllerStatus
from cassie_msgs.ros.fast_lane import NEWEST, LaneSubscription, RawSubscription

ANSWER_AFTER = 0.7
"""Wall time without states or status after which their sender counts as lost, while what they
answer goes on. In s."""

_CLOCK = QoSProfile(
    reliability=ReliabilityPolicy.BEST_EFFORT, history=HistoryPolicy.KEEP_LAST, depth=1
)


class Watch:
    """Simulator by /clock, state_estimator by /cassie/state, gait_controller by its status.

    Attributes:
        faults: Who is lost, in words.
    """

    def __init__(self, node: Node, conditions: Conditions) -> None:
        self._conditions = conditions
        self._clock = RawSubscription(node, Clock, "/clock", _CLOCK)
        self._status = LaneSubscription(node, ControllerStatus, qos=NEWEST)
        now = time.monotonic()
        self._simulator = Silence(SILENT_AFTER, START_PATIENCE, now)
        self._estimator = Silence(ANSWER_AFTER, START_PATIENCE, now)
        self._controller = Silence(ANSWER_AFTER, START_PATIENCE, now)
        self.faults: tuple[str, ...] = ()

    def heard_state(self, now: float) -> None:
        """A state has arrived."""
        self._estimator.heard(now)

    def controller_lost(self, now: float) -> bool:
        """Whether the controller has fallen silent although it gets states."""
        if self._status.take_raw() is not None:
            self._controller.heard(now)
        return self._controller.lost(now)

    def look(self, now: float) -> bool:
        """See who is silent; says whether that has changed."""
        if self._clock.take_raw() is not None:
            self._simulator.heard(now)
        faults = []
        simulator_lost = self._simulator.lost(now)
        if simulator_lost:
            # The others have nothing to answer.
            self._estimator.excuse(now)
            self._controller.excuse(now)
            faults.append("simulator lost: waiting for it")
        estimator_lost = self._estimator.lost(now)
        if estimator_lost:
            self._controller.excuse(now)
            faults.append("state_estimator lost: drives damp")
        controller_lost = self.controller_lost(now)
        self._conditions.set("simulator", "lost: no /clock" if simulator_lost else "")
        self._conditions.set("state_estimator", "lost: no states" if estimator_lost else "")
        self._conditions.set("gait_controller", "lost: no status" if controller_lost else "")
        if controller_lost:
            faults.append("gait_controller lost: drives damp")
        changed = tuple(faults) != self.faults
        self.faults = tuple(faults)
        return changed
