"""The URDF has the same frames as the model in the simulator."""

from __future__ import annotations

import math
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest

from cassie_gaits.names import JOINTS
from cassie_sim.robot_mjcf import robot_spec
from cassie_sim.robot_urdf import robot_urdf


def _rotation(roll: float, pitch: float, yaw: float) -> np.ndarray:
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def _numbers(text: str | None) -> list[float]:
    assert text is not None
    return [float(word) for word in text.split()]


def test_every_joint_of_joint_states_is_in_it() -> None:
    root = ElementTree.fromstring(robot_urdf())
    assert {joint.get("name") for joint in root.iter("joint")} == set(JOINTS)


@pytest.mark.parametrize("leg", ["left", "right"])
def test_forward_kinematics_agree_with_the_simulator(leg: str) -> None:
    model = robot_spec().compile()
    data = mujoco.MjData(model)
    rng = np.random.default_rng(3)
    angles = {name: rng.uniform(-1.0, 1.0) for name in JOINTS}
    for name, angle in angles.items():
        data.qpos[model.joint(name).qposadr[0]] = angle
    mujoco.mj_kinematics(model, data)
    pelvis = data.body("pelvis")
    position, rotation = pelvis.xpos.copy(), pelvis.xmat.reshape(3, 3).copy()
    for joint in ElementTree.fromstring(robot_urdf()).iter("joint"):
        name = str(joint.get("name"))
        if not name.startswith(leg):
            continue
        origin = joint.find("origin")
        assert origin is not None
        position = position + rotation @ np.array(_numbers(origin.get("xyz")))
        roll, pitch, yaw = _numbers(origin.get("rpy"))
        rotation = rotation @ _rotation(roll, pitch, yaw) @ _rotation(0.0, 0.0, angles[name])
        body = data.body(name)
        assert position == pytest.approx(body.xpos, abs=1e-6), name
        assert rotation == pytest.approx(body.xmat.reshape(3, 3), abs=1e-6), name
