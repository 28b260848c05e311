"""/robot_description, /tf and /tf_static are enough to draw the robot where it is."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest
from closed_loop import PERIOD, Robot
from rclpy.serialization import deserialize_message
from tf2_msgs.msg import TFMessage

from cassie_control.frame_messages import RATE
from cassie_control.ros.transforms import Transforms
from cassie_gaits.gait_library_file import default_library_path, load_library
from cassie_msgs.experiment.scenario import Scenario
from cassie_msgs.layout import RobotMode
from cassie_sim.robot_mjcf import robot_model
from cassie_sim.robot_urdf import robot_urdf

FAR = np.array([0.4, 0.0, 0.0])
"""A point of each link as far out as the links are long. In m, in the link's frame."""

Pose = tuple[np.ndarray, np.ndarray]


class Topics:
    """Takes the place of a node: keeps what is published, as ROS reads it."""

    def __init__(self) -> None:
        self.messages: dict[str, list[TFMessage]] = {}

    def create_publisher(self, _: Any, topic: str, __: Any) -> Any:
        """A publisher onto a list."""
        received = self.messages.setdefault(topic, [])

        class Publisher:
            def get_subscription_count(self) -> int:
                return 1

            def publish(self, raw: bytes) -> None:
                received.append(deserialize_message(raw, TFMessage))

        return Publisher()


def pose_of(transform: Any) -> Pose:
    """Position and rotation matrix."""
    t, r = transform.translation, transform.rotation
    assert np.linalg.norm([r.x, r.y, r.z, r.w]) == pytest.approx(1.0, abs=1e-12)
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, np.array([r.w, r.x, r.y, r.z]))
    return np.array([t.x, t.y, t.z]), matrix.reshape(3, 3)


def in_the_world(messages: list[TFMessage], joints: dict[str, str], base: Pose) -> dict[str, Pose]:
    """World poses of all links of the URDF.

    Args:
        messages: Transforms from /tf_static and /tf.
        joints: Parent of each link of the URDF, parents first.
        base: Pose of the base.
    """
    parents, poses = {}, {}
    for message in messages:
        for entry in message.transforms:
            parents[entry.child_frame_id] = entry.header.frame_id
            poses[entry.child_frame_id] = pose_of(entry.transform)
    assert parents == joints | {"base_link": "odom"}
    world = {"base_link": base}
    for child, parent in joints.items():
        (p, R), (arm, turn) = world[parent], poses[child]
        world[child] = p + R @ arm, R @ turn
    return world


@pytest.fixture(scope="module")
def walk() -> list[tuple[dict[str, Pose], mujoco.MjData]]:
    """Two seconds of a walk at 0.8 m/s: poses by the topics, and the truth."""
    root = ElementTree.fromstring(robot_urdf())
    joints = {
        str(joint.find("child").get("link")): str(joint.find("parent").get("link"))  # type: ignore
        for joint in root.iter("joint")
    }
    robot = Robot(
        Scenario(start="standing"), "faithful", library=load_library(default_library_path())
    )
    topics, model, found = Topics(), robot_model(), []
    transforms = Transforms(topics, round(1 / PERIOD))
    robot.ask(height=0.98)
    robot.run(1.5)
    robot.ask(mode=int(RobotMode.WALK), vx=0.8, yaw_rate=0.2)
    robot.run(3.0)
    for _ in range(round(2.0 / PERIOD)):
        truth = mujoco.MjData(model)
        truth.qpos[:] = robot.plant.data.qpos[: model.nq]
        seq = robot.plant.seq
        robot.run(PERIOD)
        before = len(topics.messages["/tf"])
        transforms.publish(seq, robot.state)
        if len(topics.messages["/tf"]) == before:
            continue
        mujoco.mj_kinematics(model, truth)
        base = truth.body("pelvis").xpos, truth.body("pelvis").xmat.reshape(3, 3)
        messages = [topics.messages["/tf_static"][0], topics.messages["/tf"][-1]]
        stamp = messages[1].transforms[0].header.stamp
        assert stamp.sec + 1e-9 * stamp.nanosec == pytest.approx(seq * PERIOD, abs=1e-9)
        found.append((in_the_world(messages, joints, base), truth))
    assert len(topics.messages["/tf_static"]) == 1
    assert not robot.fallen
    assert np.hypot(*robot.plant.pelvis_pose[0][:2]) > 2.0
    return found


def test_the_rate_is_fit_to_look_at(walk: list[tuple[dict[str, Pose], mujoco.MjData]]) -> None:
    assert len(walk) == 2 * RATE
    assert 25 <= RATE <= 50


def test_every_link_of_a_walking_robot_is_drawn_within_a_centimetre(
    walk: list[tuple[dict[str, Pose], mujoco.MjData]],
) -> None:
    for world, truth in walk:
        for link, (position, rotation) in world.items():
            if link == "imu_link":
                assert position == pytest.approx(truth.site("imu").xpos, abs=1e-6)
                continue
            body = truth.body("pelvis" if link == "base_link" else link.removesuffix("_link"))
            far = body.xpos + body.xmat.reshape(3, 3) @ FAR
            assert np.linalg.norm(position - body.xpos) < 0.01, link
            assert np.linalg.norm(position + rotation @ FAR - far) < 0.01, link
