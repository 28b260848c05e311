"""The states that the nodes outside the chain from sample to command answer: every tenth.

A node that receives every state takes processor time from the chain for each, and the estimator
sends each state once for every receiver. So the estimator also publishes every tenth state, and
each that it repeats, on a topic of their own.
"""

from __future__ import annotations

from rclpy.node import Node

from cassie_msgs.layout import DECIMATED_STATE, RobotState
from cassie_msgs.ros.fast_lane import EVERY, LaneSubscription
from cassie_msgs.ros.one_writer import OneWriter
from cassie_msgs.schedule import PERIOD_TICKS


class DecimatedStates(LaneSubscription[RobotState]):
    """Takes every tenth state and repeated ones.

    An estimator of the user's own may publish `/cassie/state` only. The states are then taken from
    there: `follow_estimator` looks which topic has a publisher.

    Args:
        node: Node it belongs to.

    Attributes:
        estimator: Guard that accepts the states of one estimator.
    """

    def __init__(self, node: Node) -> None:
        self.estimator = OneWriter(RobotState)
        self.estimator.topic = DECIMATED_STATE
        super().__init__(node, RobotState, DECIMATED_STATE, EVERY, self.estimator)
        self._last = (-1, -1)

    def follow_estimator(self) -> None:
        """Subscribe to the topic that an estimator publishes; call it between takes."""
        published = self._node.count_publishers
        for topic in (DECIMATED_STATE, RobotState.TOPIC):
            if published(topic):
                if topic != self.topic:
                    self.change_topic(topic)
                return

    def _load(self, sample: RobotState) -> memoryview | bool:
        taken = super()._load(sample)
        while taken is True and self.topic == RobotState.TOPIC and self._is_between(sample):
            taken = super()._load(sample)
        return taken

    def _is_between(self, state: RobotState) -> bool:
        """Whether a state is neither a tenth one nor repeated."""
        before, self._last = self._last, state.place
        return self._last[1] % PERIOD_TICKS != 0 and self._last != before
