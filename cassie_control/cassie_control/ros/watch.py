"""Monitor of other nodes: detects nodes that have fallen silent."""

from __future__ import annotations

import time

from rclpy.node import Node
from rosgraph_msgs.msg import Clock

from cassie_control.ros.common import Conditions
from cassie_control.silence import Silence
from cassie_msgs.layout import ControllerStatus
from cassie_msgs.ros.fast_lane import NEWEST_OF_ONE, LaneSubscription, RawSubscription
from cassie_msgs.ros.one_writer import OneWriter
from cassie_msgs.schedule import ANSWER_AFTER, REPEAT_PERIOD, SILENT_AFTER, START_TIMEOUT

_REPEATED = REPEAT_PERIOD / 2  # s after its last answer, from which a node was asked again


class Watch:
    """Monitors the simulator by /clock, the estimator by its states, the controller by status.

    Attributes:
        simulator: Guard that accepts the clock of one simulator.
        controller: Guard that accepts the status of one controller.
        faults: Text for each lost node.
    """

    def __init__(self, node: Node, conditions: Conditions) -> None:
        self._conditions = conditions
        self.simulator = OneWriter("/clock")
        self._clock = RawSubscription(node, Clock, "/clock", NEWEST_OF_ONE, guard=self.simulator)
        self.controller = OneWriter(ControllerStatus)
        self._status = LaneSubscription(
            node, ControllerStatus, qos=NEWEST_OF_ONE, guard=self.controller
        )
        now = time.monotonic()
        self._simulator = Silence(SILENT_AFTER, START_TIMEOUT, now)
        self._estimator = Silence(ANSWER_AFTER, START_TIMEOUT, now)
        self._controller = Silence(ANSWER_AFTER, START_TIMEOUT, now)
        self.faults: tuple[str, ...] = ()
        self._looked = self._moved = now
        self._robot_time = b""

    def heard_state(self, now: float) -> None:
        """Take in that a state has come. During a gap the controller had nothing to answer."""
        if self._estimator.lost(now):
            self._controller.excuse(now)
        self._estimator.heard(now)

    def controller_lost(self, now: float) -> bool:
        """Whether the controller has fallen silent although it gets states."""
        while self._status.take_raw() is not None:
            self._controller.heard(now)
        asked = self._estimator.since - self._controller.since > _REPEATED
        return asked and self._controller.lost(now)

    def look(self, now: float) -> bool:
        """Whether the list of silent nodes has changed; updates it."""
        if now - self._looked > SILENT_AFTER:  # this node itself did not listen
            for silence in (self._simulator, self._estimator, self._controller):
                silence.excuse(now)
        self._looked = now
        while (raw := self._clock.take_raw()) is not None:
            self._simulator.heard(now)
            if raw != self._robot_time:
                self._robot_time, self._moved = raw, now
        faults = self._lost(now)
        changed = faults != self.faults
        self.faults = faults
        return changed

    def _lost(self, now: float) -> tuple[str, ...]:
        """Text for each silent node."""
        waits = now - self._moved > SILENT_AFTER / 2
        follows = "robot time waits for it" if waits else "drives damp"
        faults = []
        simulator_lost = self._simulator.lost(now)
        if simulator_lost:
            # Without the simulator, the other nodes have nothing to answer.
            self._estimator.excuse(now)
            self._controller.excuse(now)
            faults.append("simulator lost: waiting for it")
        # A simulator that runs repeats a sample without an answer, and its clock.
        asked = self._simulator.since - self._estimator.since > _REPEATED
        estimator_lost = asked and self._estimator.lost(now)
        if estimator_lost:
            self._controller.excuse(now)
            faults.append(f"state_estimator lost: {follows}")
        controller_lost = self.controller_lost(now)
        if controller_lost:
            faults.append(f"gait_controller lost: {follows}")
        self._conditions.set("simulator", "lost: no /clock" if simulator_lost else "")
        self._conditions.set("state_estimator", "lost: no states" if estimator_lost else "")
        self._conditions.set("gait_controller", "lost: no status" if controller_lost else "")
        return tuple(faults)
