"""A stencil gives the bytes that ROS would send."""

from __future__ import annotations

from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Imu, JointState

from cassie_msgs.ros.stencil import Stencil


def test_sequences_and_stamp_are_written_and_names_stay() -> None:
    message = JointState(name=["a", "bcd"], position=[0.0] * 2, velocity=[0.0] * 2)
    message.header.frame_id = "base_link"
    stencil = Stencil(message, [("position", 2), ("velocity", 2)])
    for stamp, values in ((3_000_000_007, (1.0, 2.0)), (4, (-1.0, 0.5))):
        raw = stencil.fill(stamp, values, [3.0, 4.0])
        got = deserialize_message(raw, JointState)
        assert got.header.stamp.sec * 1_000_000_000 + got.header.stamp.nanosec == stamp
        assert got.header.frame_id == "base_link"
        assert (got.name, list(got.position)) == (["a", "bcd"], list(values))
        assert list(got.velocity) == [3.0, 4.0]
        assert list(got.effort) == []


def test_nested_messages_and_arrays_are_written_in_their_order() -> None:
    message = Odometry(child_frame_id="base_link")
    fields = [("pose.pose.orientation", 4), ("twist.covariance", 36), ("twist.twist.angular", 3)]
    raw = Stencil(message, fields).fill(0, [1.0, 2.0, 3.0, 4.0], range(36), [5.0, 6.0, 7.0])
    got = deserialize_message(raw, Odometry)
    q = got.pose.pose.orientation
    assert (q.x, q.y, q.z, q.w) == (1.0, 2.0, 3.0, 4.0)
    assert list(got.twist.covariance) == list(range(36))
    assert got.twist.twist.angular.z == 7.0
    assert got.pose.pose.position.x == 0.0


def test_what_the_template_says_besides_stays() -> None:
    message = Imu()
    message.orientation_covariance[0] = 3.0
    message.orientation.w = 1.0
    got = deserialize_message(
        Stencil(message, [("angular_velocity", 3)]).fill(0, [1.0, 2.0, 3.0]), Imu
    )
    assert got.orientation_covariance[0] == 3.0
    assert got.orientation.w == 1.0
