"""The estimate for ROS tools: /imu/data, /odom, /tf and /tf_static, decimated."""

from __future__ import annotations

import math

from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import Imu

from cassie_control.estimator.kinematic import IMU_RATE_VARIANCE, IMU_TILT_VARIANCE
from cassie_control.ros.transforms import Transforms
from cassie_gaits.link_frames import BASE_FRAME, IMU_FRAME, ODOM_FRAME
from cassie_msgs.layout import RobotState, Sensors
from cassie_msgs.ros.stencil import Stencil

RATE = 100
"""Highest rate of /imu/data and /odom, in robot time. In Hz."""

_ACCELEROMETER_VARIANCE = 0.04**2  # (m/s^2)^2
_IMU_VARIANCES = {
    "orientation": IMU_TILT_VARIANCE,
    "angular_velocity": IMU_RATE_VARIANCE,
    "linear_acceleration": _ACCELEROMETER_VARIANCE,
}


class StandardTopics:
    """Publishes samples and states on standard topics."""

    def __init__(self, node: Node, control_rate: int) -> None:
        qos = QoSProfile(depth=10)
        self._period = max(1, control_rate // RATE)
        self._offset = min(2, self._period - 1)  # a tick on which the supervisor does not answer
        self._imu = node.create_publisher(Imu, "/imu/data", qos)
        self._odom = node.create_publisher(Odometry, "/odom", qos)
        self._imu_bytes = _imu_stencil()
        self._odom_bytes = _odom_stencil()
        self._transforms = Transforms(node, control_rate)

    def publish(self, seq: int, sample: Sensors, state: RobotState) -> None:
        """Publish the messages that are due at this tick, if they have subscribers.

        Args:
            seq: Control tick.
            sample: Sample of this tick.
            state: State of this tick.
        """
        self._transforms.publish(seq, state)
        if seq % self._period != self._offset:
            return
        if self._imu.get_subscription_count():
            self._publish_imu(sample)
        if self._odom.get_subscription_count():
            self._publish_odometry(state)

    def _publish_imu(self, sample: Sensors) -> None:
        orientation = sample.orientation.tolist()
        rates = sample.angular_velocity.tolist()
        acceleration = sample.linear_acceleration.tolist()
        raw = self._imu_bytes.fill(sample.stamp_ns, orientation, rates, acceleration)
        self._imu.publish(raw)

    def _publish_odometry(self, state: RobotState) -> None:
        x, y, z, yaw, pitch, roll = state.q[:6].tolist()
        quaternion = quaternion_of(yaw, pitch, roll)
        linear = into_frame(quaternion, state.v[:3].tolist())
        covariance = state.covariance.tolist()
        self._odom.publish(
            self._odom_bytes.fill(
                state.stamp_ns,
                (x, y, z),
                quaternion,
                _diagonal(covariance[0:3] + covariance[5:2:-1]),
                linear,
                state.angular_velocity.tolist(),
                _diagonal(covariance[6:9] + covariance[9:12]),
            )
        )


def quaternion_of(yaw: float, pitch: float, roll: float) -> tuple[float, float, float, float]:
    """Quaternion x, y, z, w of z-y-x Euler angles.

    Args:
        yaw, pitch, roll: Angles. In rad.
    """
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    return (
        cy * cp * sr - sy * sp * cr,
        cy * sp * cr + sy * cp * sr,
        sy * cp * cr - cy * sp * sr,
        cy * cp * cr + sy * sp * sr,
    )


def into_frame(
    quaternion: tuple[float, float, float, float], vector: list[float]
) -> tuple[float, float, float]:
    """A world vector in the frame that the quaternion x, y, z, w rotates into the world."""
    x, y, z, w = quaternion
    vx, vy, vz = vector
    tx, ty, tz = 2.0 * (vy * z - vz * y), 2.0 * (vz * x - vx * z), 2.0 * (vx * y - vy * x)
    return (
        vx + w * tx + ty * z - tz * y,
        vy + w * ty + tz * x - tx * z,
        vz + w * tz + tx * y - ty * x,
    )


def _diagonal(variances: list[float]) -> list[float]:
    matrix = [0.0] * 36
    matrix[::7] = variances
    return matrix


def _imu_stencil() -> Stencil:
    message = Imu()
    message.header.frame_id = IMU_FRAME
    for name, variance in _IMU_VARIANCES.items():
        getattr(message, f"{name}_covariance")[::4] = variance
    return Stencil(
        message, [("orientation", 4), ("angular_velocity", 3), ("linear_acceleration", 3)]
    )


def _odom_stencil() -> Stencil:
    message = Odometry(child_frame_id=BASE_FRAME)
    message.header.frame_id = ODOM_FRAME
    return Stencil(
        message,
        [
            ("pose.pose.position", 3),
            ("pose.pose.orientation", 4),
            ("pose.covariance", 36),
            ("twist.twist.linear", 3),
            ("twist.twist.angular", 3),
            ("twist.covariance", 36),
        ],
    )
