"""What the Segway does reaches bags as ordinary ROS messages."""

from __future__ import annotations

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Imu

from cassie_gaits.robot import GRAVITY
from cassie_msgs.experiment.scenario import Scenario
from cassie_sim.plant import Plant
from cassie_sim.plant_config import PlantConfig
from cassie_sim.segway_truth import IMU_TOPIC, TRUTH_TOPIC, SegwayTruth


@pytest.fixture(scope="module")
def plant() -> Plant:
    plant = Plant(PlantConfig(), Scenario(scene="segway"))
    for _ in range(50):
        plant.sense()
        plant.step(None)
    return plant


def test_its_pose_is_an_ordinary_odometry(plant: Plant) -> None:
    message = deserialize_message(dict(SegwayTruth().messages(plant))[TRUTH_TOPIC], Odometry)
    stamp = message.header.stamp
    assert (stamp.sec, stamp.nanosec) == (0, 100_000_000)
    assert (message.header.frame_id, message.child_frame_id) == ("odom", "segway")
    p, r = message.pose.pose.position, message.pose.pose.orientation
    assert [p.x, p.y, p.z, r.w, r.x, r.y, r.z] == plant.data.joint("segway").qpos.tolist()
    rates = message.twist.twist.angular
    assert [rates.x, rates.y, rates.z] == plant.data.joint("segway").qvel[3:].tolist()


def test_its_imu_feels_gravity_and_gives_no_orientation(plant: Plant) -> None:
    message = deserialize_message(dict(SegwayTruth().messages(plant))[IMU_TOPIC], Imu)
    assert message.header.frame_id == "segway_imu"
    assert message.header.stamp.nanosec == 100_000_000
    force, rates = message.linear_acceleration, message.angular_velocity
    assert [rates.x, rates.y, rates.z] == plant.data.sensor("segway_gyro").data.tolist()
    assert [force.x, force.y, force.z] == plant.data.sensor("segway_accelerometer").data.tolist()
    assert force.z == pytest.approx(GRAVITY, abs=0.5)
    assert message.orientation_covariance[0] == -1.0
    assert not np.any(message.linear_acceleration_covariance)


def test_it_is_published_at_100_hz_and_only_where_there_is_a_segway(plant: Plant) -> None:
    truth = SegwayTruth()
    plant.seq = 51
    assert truth.messages(plant) == []
    plant.seq = 50
    assert len(truth.messages(plant)) == 2
    assert truth.messages(Plant(PlantConfig())) == []
    assert len(truth.messages(plant)) == 2
