"""Standard messages as bytes: as ROS itself reads and writes them."""

from __future__ import annotations

import numpy as np
import pytest
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import Imu
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from cassie_msgs.sample import LayoutError
from cassie_msgs.standard_messages import (
    IMU,
    ODOMETRY,
    TransformWriter,
    Writer,
    read_rows,
    read_transforms,
    text_message,
)

FRAMES = [("odom", "base_link"), ("", ""), ("a", "bcd"), ("world/of/frames", "x" * 40)]


@pytest.mark.parametrize(("parent", "child"), FRAMES)
def test_standard_topics_is_written_as_ros_reads_it_and_read_as_ros_writes_it(parent, child):
    writer = Writer(ODOMETRY, parent, child)
    writer.figures[:] = np.arange(85.0)
    message = deserialize_message(writer.to_bytes(3_000_000_004), Odometry)
    assert (message.header.frame_id, message.child_frame_id) == (parent, child)
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (3, 4)
    assert message.pose.pose.orientation.w == 6.0
    assert message.twist.covariance[35] == 84.0
    rows = read_rows(ODOMETRY, [serialize_message(message)] * 3)
    assert rows["sec"].tolist() == [3, 3, 3]
    assert rows["position"][1].tolist() == [0.0, 1.0, 2.0]
    assert rows["orientation"][2].tolist() == [3.0, 4.0, 5.0, 6.0]
    assert rows["linear"][0].tolist() == [43.0, 44.0, 45.0]
    assert rows["angular"][0].tolist() == [46.0, 47.0, 48.0]


@pytest.mark.parametrize("frame", ["", "imu", "pelvis/imu_link"])
def test_an_imu_message_is_written_as_ros_reads_it_and_read_as_ros_writes_it(frame):
    writer = Writer(IMU, frame)
    writer.figures[:] = np.arange(37.0)
    message = deserialize_message(writer.to_bytes(0), Imu)
    assert message.header.frame_id == frame
    assert message.linear_acceleration_covariance[8] == 36.0
    (row,) = read_rows(IMU, [serialize_message(message)])
    assert row["angular"].tolist() == [13.0, 14.0, 15.0]
    assert row["force"].tolist() == [25.0, 26.0, 27.0]


def transforms_between(*frames):
    message = TFMessage()
    for index, (parent, child) in enumerate(frames):
        entry = TransformStamped(child_frame_id=child)
        entry.header.frame_id = parent
        t, r = entry.transform.translation, entry.transform.rotation
        t.x, t.y, t.z, r.x, r.y, r.z, r.w = (index + 0.1 * i for i in range(7))
        message.transforms.append(entry)
    return serialize_message(message)


def test_transforms_are_read_as_ros_writes_them():
    frames = [("odom", "pelvis"), ("pelvis", "left_hip"), ("a", ""), ("", "größe"), ("odom", "x")]
    poses = read_transforms(transforms_between(*frames))
    assert list(poses) == [child for _, child in frames]
    for index, pose in enumerate(poses.values()):
        assert pose == tuple(index + 0.1 * i for i in range(7))
    assert read_transforms(transforms_between()) == {}


def test_transforms_cut_or_altered_are_read_or_refused():
    raw = transforms_between(("odom", "pelvis"), ("pelvis", "left_hip"))
    whole = set(read_transforms(raw))
    for length in range(len(raw)):
        with pytest.raises(LayoutError, match="TFMessage"):
            read_transforms(raw[:length])
    random = np.random.default_rng(7)
    for _ in range(300):
        altered = bytearray(raw)
        altered[random.integers(4, len(raw))] = random.integers(256)
        try:
            assert len(read_transforms(bytes(altered))) <= len(whole)
        except LayoutError as error:
            assert "TFMessage" in str(error)


@pytest.mark.parametrize("kind", [ODOMETRY, IMU])
def test_what_is_too_short_is_refused_at_every_length(kind):
    raw = Writer(kind, *["frame"] * kind.names).to_bytes(0)
    for length in range(len(raw)):
        with pytest.raises(LayoutError, match=kind.type):
            read_rows(kind, [raw[:length]])


def test_messages_of_different_length_are_refused():
    one, other = (Writer(IMU, name).to_bytes(0) for name in ("imu", "another_imu"))
    with pytest.raises(LayoutError, match="differ in length"):
        read_rows(IMU, [one, other])


def test_no_message_is_no_row():
    assert len(read_rows(ODOMETRY, [])) == 0


@pytest.mark.parametrize("names", [[], ["base_link"], ["a", "bc", "left_toe_link", "", "größe"]])
def test_transforms_are_written_as_ros_writes_them(names: list[str]):
    writer = TransformWriter([(f"parent of {name}", name) for name in names])
    random = np.random.default_rng(1)
    for stamp in (3_000_000_007, 4):
        poses = random.normal(size=(len(names), 7))
        message = TFMessage()
        for name, pose in zip(names, poses.tolist(), strict=True):
            entry = TransformStamped(child_frame_id=name)
            entry.header.frame_id = f"parent of {name}"
            entry.header.stamp.sec, entry.header.stamp.nanosec = divmod(stamp, 10**9)
            t, r = entry.transform.translation, entry.transform.rotation
            t.x, t.y, t.z, r.x, r.y, r.z, r.w = pose
            message.transforms.append(entry)
        raw = writer.to_bytes(stamp, poses)
        assert len(raw) == len(serialize_message(message))  # whose padding has any bytes
        assert deserialize_message(raw, TFMessage) == message


def test_a_text_is_written_as_ros_writes_it():
    assert text_message("größe") == serialize_message(String(data="größe"))
