"""The hand-made Odometry bytes are what ROS would send."""

from __future__ import annotations

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message, serialize_message

from cassie_sim.ground_truth import GroundTruth
from cassie_sim.plant import Plant
from cassie_sim.plant_config import PlantConfig


@pytest.fixture(scope="module")
def plant() -> Plant:
    plant = Plant(PlantConfig())
    rng = np.random.default_rng(1)
    plant.seq = 1_234_567
    plant.data.qpos[:7] = rng.normal(size=7)
    plant.data.qpos[3:7] /= np.linalg.norm(plant.data.qpos[3:7])
    plant.data.qvel[:6] = rng.normal(size=6)
    return plant


def test_it_is_an_ordinary_odometry(plant: Plant) -> None:
    message = deserialize_message(GroundTruth().write(plant), Odometry)
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (2469, 134_000_000)
    assert (message.header.frame_id, message.child_frame_id) == ("odom", "base_link")
    p, r = message.pose.pose.position, message.pose.pose.orientation
    assert [p.x, p.y, p.z, r.w, r.x, r.y, r.z] == plant.data.qpos[:7].tolist()
    w = message.twist.twist.angular
    assert [w.x, w.y, w.z] == plant.data.qvel[3:6].tolist()
    assert not message.pose.covariance.any()
    assert not message.twist.covariance.any()


def test_linear_velocity_is_in_the_pelvis_frame(plant: Plant) -> None:
    v = deserialize_message(GroundTruth().write(plant), Odometry).twist.twist.linear
    w, *xyz = plant.data.qpos[3:7]
    x, y, z = xyz
    R_WP = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    assert [v.x, v.y, v.z] == pytest.approx(R_WP.T @ plant.data.qvel[:3], abs=1e-12)


def test_ros_serializes_the_same_message_to_the_same_size(plant: Plant) -> None:
    raw = GroundTruth().write(plant)
    again = serialize_message(deserialize_message(raw, Odometry))
    # ROS leaves the bytes between strings and doubles as they happen to be.
    assert len(again) == len(raw)
    assert again[44:] == raw[44:]
