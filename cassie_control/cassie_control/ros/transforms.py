"""Publisher of the robot's frames: /tf, decimated, and /tf_static."""

from __future__ import annotations

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from tf2_msgs.msg import TFMessage

from cassie_control.frame_messages import FrameMessages, fixed_frames
from cassie_msgs.layout import RobotState


class Transforms:
    """Publishes the frames of a node's estimates."""

    def __init__(self, node: Node, control_rate: int) -> None:
        self._messages = FrameMessages(control_rate)
        self._publisher = node.create_publisher(TFMessage, "/tf", QoSProfile(depth=100))
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._static_publisher = node.create_publisher(TFMessage, "/tf_static", latched)
        self._static_publisher.publish(fixed_frames())

    def publish(self, seq: int, state: RobotState) -> None:
        """Publish, if it is due at this tick and there is a subscriber."""
        if self._messages.due(seq) and self._publisher.get_subscription_count():
            self._publisher.publish(self._messages.moving(state))
