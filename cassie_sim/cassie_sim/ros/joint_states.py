"""The measured joints on /joint_states."""

from __future__ import annotations

from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

from cassie_gaits.names import DRIVES, JOINTS, SENSED_JOINTS
from cassie_msgs.layout import Sensors
from cassie_msgs.ros.stencil import Stencil

_PASSIVE = tuple(name for name in SENSED_JOINTS if name not in DRIVES)
_NAMES = DRIVES + _PASSIVE
_PASSIVE_INDEX = [SENSED_JOINTS.index(name) for name in _PASSIVE]


class JointStates:
    """Publisher of the drives by their own encoders, and of shin and tarsus by joint encoders.

    The toes have both encoders; the drive's encoder has the finer resolution.
    """

    def __init__(self, node: Node) -> None:
        self._publisher = node.create_publisher(JointState, "/joint_states", QoSProfile(depth=10))
        count = len(_NAMES)
        message = JointState(
            name=list(_NAMES), position=[0.0] * count, velocity=[0.0] * count, effort=[0.0] * count
        )
        self._stencil = Stencil(message, [(f, count) for f in ("position", "velocity", "effort")])
        self._no_effort = [0.0] * len(_PASSIVE)

    def publish(self, sample: Sensors) -> None:
        """Publish the joints of a sample, if there is a subscriber."""
        if not self._publisher.get_subscription_count():
            return
        position = sample.drive_position.tolist() + sample.joint_position[_PASSIVE_INDEX].tolist()
        velocity = sample.drive_velocity.tolist() + sample.joint_velocity[_PASSIVE_INDEX].tolist()
        effort = sample.drive_torque.tolist() + self._no_effort
        self._publisher.publish(self._stencil.fill(sample.stamp_ns, position, velocity, effort))


if set(_NAMES) != set(JOINTS):
    raise RuntimeError(f"joint states leave out {set(JOINTS) - set(_NAMES)}")
