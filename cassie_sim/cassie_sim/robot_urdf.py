"""A URDF of Cassie for ROS tools, made from `cassie_gaits.robot`.

It has all links with their masses, meshes, colours and the collision shapes of the simulation. A
URDF is a tree, so rods are attached at one end only. Rods, heel springs and foot cranks have no
encoder; their frames on /tf are those of `cassie_gaits.link_frames`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from cassie_gaits import robot
from cassie_gaits.link_frames import BASE_FRAME, FRAMES, LinkFrame
from cassie_gaits.records import FloatArray
from cassie_sim.robot_mjcf import BODY_COLOUR, COLOURED, SHAPE_COLOUR

Shape = tuple[dict[str, str], str, dict[str, str]]
"""Origin, and tag and attributes of a geometry."""

INSTALLED_MESHES = "package://cassie_sim/meshes"
"""URI of the folder into which the build copies the meshes, if it finds them."""

_COLOURS = {"body": BODY_COLOUR, "parts": SHAPE_COLOUR}
_IMU_SIZE = (0.036, 0.033, 0.009)  # size of the VN-100, in m
_SPOT_RADIUS = 0.03


def robot_urdf(meshes: str | None = None) -> str:
    """The robot as URDF text.

    Args:
        meshes: URI of the folder of the meshes, such as package://cassie_sim/meshes; None shows
            collision shapes instead, and a small sphere for a link without one.
    """
    root = Element("robot", name="cassie")
    for name, colour in _COLOURS.items():
        material = SubElement(root, "material", name=name)
        SubElement(material, "color", rgba=_text(colour))
    _add_link(root, BASE_FRAME, robot.PELVIS, _pelvis_shapes(), meshes)
    for frame in FRAMES:
        if frame.link is None:
            _add_imu(root, frame)
        else:
            _add_link(root, frame.name, frame.link, _leg_shapes(frame.link), meshes, frame.leg)
        _add_joint(root, frame)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")


def _add_link(
    root: Element,
    name: str,
    link: robot.Link,
    shapes: list[Shape],
    meshes: str | None,
    leg: str = "",
) -> None:
    element = SubElement(root, "link", name=name)
    inertial = SubElement(element, "inertial")
    SubElement(inertial, "origin", _origin(link.com))
    SubElement(inertial, "mass", value=f"{link.mass:.12g}")
    names = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    figures = {key: f"{value:.12g}" for key, value in zip(names, link.inertia, strict=True)}
    SubElement(inertial, "inertia", figures)
    visible = shapes or [_sphere(_SPOT_RADIUS, link.com)]
    if meshes is not None:
        visible = [_mesh(link, meshes, leg)]
    material = "body" if link.name in COLOURED else "parts"
    for shape in visible:
        visual = _add_shape(element, "visual", shape)
        SubElement(visual, "material", name=material)
    for shape in shapes:
        _add_shape(element, "collision", shape)


def _add_imu(root: Element, frame: LinkFrame) -> None:
    """Add the frame of the IMU, whose mass is part of the pelvis."""
    element = SubElement(root, "link", name=frame.name)
    visual = _add_shape(element, "visual", (_origin(), "box", {"size": _text(_IMU_SIZE)}))
    SubElement(visual, "material", name="parts")


def _add_joint(root: Element, frame: LinkFrame) -> None:
    kind = "fixed" if frame.axis is None else "revolute"
    joint = SubElement(root, "joint", name=frame.joint, type=kind)
    SubElement(joint, "parent", link=frame.parent)
    SubElement(joint, "child", link=frame.name)
    SubElement(joint, "origin", _origin(frame.position, frame.rotation))
    if frame.axis is None or frame.link is None:
        return
    SubElement(joint, "axis", xyz=_text(frame.axis))
    low, high = frame.link.joint.limits or (-math.pi, math.pi)
    drive = robot.DRIVES.get(frame.link.name)
    effort = drive.torque_limit if drive else 0.0
    speed = drive.speed_limit if drive else 100.0
    limit = {"lower": low, "upper": high, "effort": effort, "velocity": speed}
    SubElement(joint, "limit", {key: f"{value:.6g}" for key, value in limit.items()})


def _add_shape(element: Element, role: str, shape: Shape) -> Element:
    origin, tag, attributes = shape
    added = SubElement(element, role)
    SubElement(added, "origin", origin)
    SubElement(SubElement(added, "geometry"), tag, attributes)
    return added


def _pelvis_shapes() -> list[Shape]:
    radius, centre = robot.PELVIS_BALL
    return [_sphere(radius, centre)]


def _leg_shapes(link: robot.Link) -> list[Shape]:
    if link.name == "toe":  # only the ends of the sole touch the ground
        return [_sphere(robot.SOLE_RADIUS, point) for point in robot.FOOT_CONTACTS]
    return [] if link.capsule is None else _capsule(*link.capsule)


def _sphere(radius: float, centre: Iterable[float]) -> Shape:
    return _origin(centre), "sphere", {"radius": f"{radius:.6g}"}


def _capsule(radius: float, start: robot.Vector, end: robot.Vector) -> list[Shape]:
    """A cylinder from start to end, with its axis along z, and a sphere at each end."""
    a, b = np.array(start), np.array(end)
    length = float(np.linalg.norm(b - a))
    z_axis = (b - a) / length
    x_axis = np.cross(np.eye(3)[np.argmin(np.abs(z_axis))], z_axis)
    x_axis /= np.linalg.norm(x_axis)
    turn = np.column_stack([x_axis, np.cross(z_axis, x_axis), z_axis])
    sizes = {"radius": f"{radius:.6g}", "length": f"{length:.6g}"}
    cylinder = _origin((a + b) / 2, turn), "cylinder", sizes
    return [cylinder, _sphere(radius, start), _sphere(radius, end)]


def _mesh(link: robot.Link, meshes: str, leg: str) -> Shape:
    scale = [1.0, 1.0, 1.0]
    if leg == "right":  # only the left meshes exist; the right ones are their mirror images
        scale[link.mirror_axis] = -1.0
    return _origin(), "mesh", {"filename": f"{meshes}/{link.mesh}.stl", "scale": _text(scale)}


def _origin(
    position: Iterable[float] = (0.0, 0.0, 0.0), rotation: FloatArray | None = None
) -> dict[str, str]:
    turned = np.eye(3) if rotation is None else rotation
    return {"xyz": _text(position), "rpy": _text(_roll_pitch_yaw(turned))}


def _roll_pitch_yaw(rotation: FloatArray) -> tuple[float, float, float]:
    """Angles of a rotation matrix, in rad; a pitch of 90 degrees, as at the hips, has yaw 0."""
    sine = max(-1.0, min(1.0, -float(rotation[2, 0])))
    if abs(sine) > 1.0 - 1e-12:
        return math.atan2(sine * rotation[0, 1], sine * rotation[0, 2]), math.asin(sine), 0.0
    return (
        math.atan2(rotation[2, 1], rotation[2, 2]),
        math.asin(sine),
        math.atan2(rotation[1, 0], rotation[0, 0]),
    )


def _text(values: Iterable[float]) -> str:
    return " ".join(f"{value + 0.0:.12g}" for value in values)  # no -0
