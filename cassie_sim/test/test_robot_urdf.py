"""The URDF, as ROS's own parser reads it, is the robot of the simulator."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from ament_index_python.packages import get_package_share_directory

from cassie_gaits import robot
from cassie_gaits.link_frames import BASE_FRAME, FRAMES, IMU_FRAME, MOVING_FRAMES
from cassie_gaits.names import JOINTS
from cassie_sim.robot_mjcf import robot_model
from cassie_sim.robot_urdf import robot_urdf

MESHES = "package://cassie_sim/meshes"
ROOT = ElementTree.fromstring(robot_urdf(MESHES))
MODEL = robot_model()
BODIES = {BASE_FRAME: "pelvis"} | {frame.name: frame.joint for frame in FRAMES if frame.link}
"""MuJoCo's name of each link."""


@pytest.fixture(scope="module")
def urdf() -> Any:
    """The model that Pinocchio makes of the URDF, through urdfdom."""
    return pin.buildModelFromXML(robot_urdf(MESHES), pin.JointModelFreeFlyer())


def numbers(element: ElementTree.Element | None, attribute: str) -> np.ndarray:
    assert element is not None
    return np.array([float(word) for word in str(element.get(attribute)).split()])


def random_pose(urdf: Any, seed: int) -> tuple[np.ndarray, mujoco.MjData]:
    """The same joint angles for both, pelvis at the origin; loops stay open."""
    rng = np.random.default_rng(seed)
    q, data = pin.neutral(urdf), mujoco.MjData(MODEL)
    data.qpos[:3] = 0.0
    for frame in MOVING_FRAMES:
        angle = rng.uniform(-1.5, 1.5)
        q[urdf.joints[urdf.getJointId(frame.joint)].idx_q] = angle
        joint = data.joint(frame.joint)
        if len(joint.qpos) == 4:  # the achilles rod's ball joint
            joint.qpos[:] = np.cos(angle / 2), *(np.sin(angle / 2) * frame.axis)
        else:
            joint.qpos[:] = angle
    mujoco.mj_forward(MODEL, data)
    return q, data


def test_joints_are_those_of_joint_states_and_of_the_loops(urdf: Any) -> None:
    passive = ("achilles_rod", "heel_spring", "foot_crank", "plantar_rod")
    expected = {*JOINTS, *(f"{leg}_{name}" for leg in ("left", "right") for name in passive)}
    assert {*urdf.names} - {"universe", "root_joint"} == expected


def test_it_weighs_what_the_robot_weighs(urdf: Any) -> None:
    assert pin.computeTotalMass(urdf) == pytest.approx(33.312, abs=1e-9)
    masses = sum(numbers(mass, "value")[0] for mass in ROOT.iter("mass"))
    assert masses == pytest.approx(MODEL.body_mass.sum(), abs=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_every_link_is_where_it_is_in_the_simulator(urdf: Any, seed: int) -> None:
    q, data = random_pose(urdf, seed)
    frames = urdf.createData()
    pin.framesForwardKinematics(urdf, frames, q)
    for link, body in BODIES.items():
        pose = frames.oMf[urdf.getFrameId(link, pin.FrameType.BODY)]
        np.testing.assert_allclose(pose.translation, data.body(body).xpos, atol=1e-6)
        np.testing.assert_allclose(pose.rotation.ravel(), data.body(body).xmat, atol=1e-6)
    imu = frames.oMf[urdf.getFrameId(IMU_FRAME, pin.FrameType.BODY)]
    np.testing.assert_allclose(imu.translation, data.site("imu").xpos, atol=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_masses_and_inertias_are_those_of_the_simulator(urdf: Any, seed: int) -> None:
    q, data = random_pose(urdf, seed)
    dynamics = urdf.createData()
    com = pin.centerOfMass(urdf, dynamics, q)
    np.testing.assert_allclose(com, data.subtree_com[1], atol=1e-6)
    matrix = pin.crba(urdf, dynamics, q)
    expected = np.zeros((MODEL.nv, MODEL.nv))
    mujoco.mj_fullM(MODEL, data, expected)
    expected -= np.diag(MODEL.dof_armature)
    hinges = [frame.joint for frame in MOVING_FRAMES if frame.link.joint.kind == "hinge"]
    ours = [urdf.joints[urdf.getJointId(name)].idx_v for name in hinges]
    theirs = [MODEL.joint(name).dofadr[0] for name in hinges]
    np.testing.assert_allclose(
        matrix[np.ix_(ours, ours)], expected[np.ix_(theirs, theirs)], atol=1e-6
    )


def test_every_link_can_be_seen_with_a_mesh_that_is_installed_and_a_colour() -> None:
    materials = {material.get("name") for material in ROOT.iterfind("material/color/..")}
    share = Path(get_package_share_directory("cassie_sim"))
    for link in ROOT.iter("link"):
        visual = link.find("visual")
        assert visual is not None, link.get("name")
        colour = visual.find("material")
        assert colour is not None and colour.get("name") in materials
        mesh = visual.find("geometry/mesh")
        if link.get("name") == IMU_FRAME:
            continue
        assert mesh is not None
        path = share / str(mesh.get("filename")).removeprefix("package://cassie_sim/")
        assert path.is_file()
        mirrored = np.prod(numbers(mesh, "scale"))
        assert mirrored == (-1.0 if str(link.get("name")).startswith("right") else 1.0)


@pytest.mark.filterwarnings("ignore:You passed package dir")
def test_pinocchio_finds_the_meshes(urdf: Any) -> None:
    folders = [str(Path(get_package_share_directory("cassie_sim")).parent)]
    text = robot_urdf(MESHES)
    seen = pin.buildGeomFromUrdfString(urdf, text, pin.GeometryType.VISUAL, folders)
    assert seen.ngeoms == len(BODIES) + 1


@pytest.mark.parametrize("name", BODIES)
def test_collision_shapes_are_those_of_the_simulator(name: str) -> None:
    (link,) = ROOT.iterfind(f"link[@name='{name}']")
    spheres, cylinders = [], []
    for collision in link.iter("collision"):
        centre = numbers(collision.find("origin"), "xyz")
        if (sphere := collision.find("geometry/sphere")) is not None:
            spheres.append([*numbers(sphere, "radius"), *centre])
        else:
            cylinder = collision.find("geometry/cylinder")
            axis = pin.rpy.rpyToMatrix(numbers(collision.find("origin"), "rpy"))[:, 2]
            half = 0.5 * numbers(cylinder, "length") * axis
            cylinders.append([*numbers(cylinder, "radius"), *(centre - half), *(centre + half)])
    balls, capsules = [], []
    for geom in np.flatnonzero(MODEL.geom_bodyid == MODEL.body(BODIES[name]).id):
        radius, length, _ = MODEL.geom_size[geom]
        centre, rotation = MODEL.geom_pos[geom], np.zeros(9)
        mujoco.mju_quat2Mat(rotation, MODEL.geom_quat[geom])
        half = -length * rotation.reshape(3, 3)[:, 2]  # its z axis points to the first end
        if MODEL.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CAPSULE:
            capsules.append([radius, *(centre - half), *(centre + half)])
            balls += [[radius, *(centre - half)], [radius, *(centre + half)]]
        else:
            balls.append([radius, *centre])
    np.testing.assert_allclose(np.array(spheres), np.array(balls), atol=1e-5)
    np.testing.assert_allclose(np.array(cylinders), np.array(capsules), atol=1e-5)


def test_without_meshes_every_link_has_a_simple_shape() -> None:
    root = ElementTree.fromstring(robot_urdf())
    assert not list(root.iter("mesh"))
    assert all(link.find("visual/geometry/*") is not None for link in root.iter("link"))
    assert len(list(root.iter("link"))) == 2 + 2 * len(robot.LEFT_LEG)
