"""The robot's frames for ROS tools: /tf, decimated, and /tf_static."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import TransformStamped
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from tf2_msgs.msg import TFMessage

from cassie_gaits.link_frames import (
    BASE_FRAME,
    FIXED_FRAMES,
    MOVING_FRAMES,
    ODOM_FRAME,
    LinkPoses,
)
from cassie_msgs.layout import RobotState
from cassie_msgs.ros.stencil import TransformStencil

RATE = 50
"""Highest rate of /tf, in robot time. In Hz."""


class Transforms:
    """Publishes the pose of the base in the odometry frame, and of each link in its parent."""

    def __init__(self, node: Node, control_rate: int) -> None:
        self._period = max(1, control_rate // RATE)
        self._offset = min(3, self._period - 1)  # a tick that has little else to publish
        self._links = LinkPoses()
        self._publisher = node.create_publisher(TFMessage, "/tf", QoSProfile(depth=100))
        pairs = [(frame.parent, frame.name) for frame in MOVING_FRAMES]
        self._stencil = TransformStencil(_message([(ODOM_FRAME, BASE_FRAME), *pairs]))
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._static_publisher = node.create_publisher(TFMessage, "/tf_static", latched)
        fixed = TransformStencil(_message([(frame.parent, frame.name) for frame in FIXED_FRAMES]))
        poses = np.array([frame.rest for frame in FIXED_FRAMES])
        self._static_publisher.publish(fixed.fill(0, poses))

    def publish(self, seq: int, state: RobotState) -> None:
        """Publish, if it is due at this tick and there is a subscriber."""
        if seq % self._period == self._offset and self._publisher.get_subscription_count():
            self._publisher.publish(self._stencil.fill(state.stamp_ns, self._links.at(state.q)))


def _message(pairs: Sequence[tuple[str, str]]) -> TFMessage:
    """A message with one transform for each pair of parent and child."""
    message = TFMessage(transforms=[TransformStamped(child_frame_id=child) for _, child in pairs])
    for entry, (parent, _) in zip(message.transforms, pairs, strict=True):
        entry.header.frame_id = parent
    return message
