"""A URDF of Cassie for ROS tools: links, joints and simple shapes from `cassie_gaits.robot`.

For looks and frames. The rods, heel springs and foot cranks that close the loops are left
out: a URDF is a tree, and no joint state of theirs is published.
"""

from __future__ import annotations

import math
from xml.etree import ElementTree

import numpy as np

from cassie_gaits import robot
from cassie_gaits.names import LEG_JOINTS, LEGS

BASE_LINK = "base_link"
_PELVIS_RADIUS = 0.12


def robot_urdf() -> str:
    """The robot as URDF text; joints are named as in /joint_states."""
    root = ElementTree.Element("robot", name="cassie")
    base = _add_link(root, BASE_LINK, robot.PELVIS)
    _add_shape(base, robot.PELVIS.com, (0.0, 0.0, 0.0), "sphere", radius=_PELVIS_RADIUS)
    for leg in LEGS:
        for link in robot.leg_links(leg):
            if link.name in LEG_JOINTS:
                _add_leg_link(root, leg, link)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")


def _add_leg_link(root: ElementTree.Element, leg: str, link: robot.Link) -> None:
    name = f"{leg}_{link.name}"
    element = _add_link(root, f"{name}_link", link)
    if link.capsule is not None:
        radius, start, end = link.capsule
        _add_capsule(element, radius, np.array(start), np.array(end))
    if link.name == "toe":
        contacts = np.array(robot.FOOT_CONTACTS)
        _add_capsule(element, robot.SOLE_RADIUS, contacts[0], contacts[1])
    parent = BASE_LINK if link.parent == "pelvis" else f"{leg}_{link.parent}_link"
    joint = ElementTree.SubElement(root, "joint", name=name, type="revolute")
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=f"{name}_link")
    ElementTree.SubElement(joint, "origin", _origin(link))
    ElementTree.SubElement(joint, "axis", xyz="0 0 1")
    low, high = link.joint.limits or (-math.pi, math.pi)
    drive = robot.DRIVES.get(link.name)
    effort = drive.torque_limit if drive else 0.0
    speed = drive.speed_limit if drive else 100.0
    limit = {"lower": low, "upper": high, "effort": effort, "velocity": speed}
    ElementTree.SubElement(joint, "limit", {key: f"{value:.6g}" for key, value in limit.items()})


def _add_link(root: ElementTree.Element, name: str, link: robot.Link) -> ElementTree.Element:
    element = ElementTree.SubElement(root, "link", name=name)
    inertial = ElementTree.SubElement(element, "inertial")
    ElementTree.SubElement(inertial, "origin", xyz=_text(link.com), rpy="0 0 0")
    ElementTree.SubElement(inertial, "mass", value=f"{link.mass:.9g}")
    names = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    figures = {key: f"{value:.9g}" for key, value in zip(names, link.inertia, strict=True)}
    ElementTree.SubElement(inertial, "inertia", figures)
    return element


def _add_capsule(
    element: ElementTree.Element, radius: float, start: np.ndarray, end: np.ndarray
) -> None:
    """A cylinder from start to end, whose own axis is z."""
    along = end - start
    length = float(np.linalg.norm(along))
    pitch = math.acos(along[2] / length)
    yaw = math.atan2(along[1], along[0])
    middle = tuple(((start + end) / 2).tolist())
    _add_shape(element, middle, (0.0, pitch, yaw), "cylinder", radius=radius, length=length)


def _add_shape(
    element: ElementTree.Element,
    position: tuple[float, ...],
    angles: tuple[float, float, float],
    shape: str,
    **sizes: float,
) -> None:
    visual = ElementTree.SubElement(element, "visual")
    ElementTree.SubElement(visual, "origin", xyz=_text(position), rpy=_text(angles))
    geometry = ElementTree.SubElement(visual, "geometry")
    ElementTree.SubElement(geometry, shape, {key: f"{size:.6g}" for key, size in sizes.items()})


def _origin(link: robot.Link) -> dict[str, str]:
    """Pose of the link at joint angle zero, in its parent."""
    x_axis = np.array(link.x_axis) / np.linalg.norm(link.x_axis)
    z_axis = np.cross(x_axis, link.y_axis)
    z_axis /= np.linalg.norm(z_axis)
    pose = np.column_stack([x_axis, np.cross(z_axis, x_axis), z_axis])
    # The table gives the pose at `joint.zero`; turn it back about the joint's axis.
    cosine, sine = math.cos(link.joint.zero), math.sin(link.joint.zero)
    rotation = pose @ np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return {"xyz": _text(link.position), "rpy": _text(_roll_pitch_yaw(rotation))}


def _roll_pitch_yaw(rotation: np.ndarray) -> tuple[float, float, float]:
    """Angles of a rotation matrix, in rad; a pitch of 90 degrees, as at the hips, has yaw 0."""
    sine = max(-1.0, min(1.0, -float(rotation[2, 0])))
    if abs(sine) > 1.0 - 1e-12:
        return math.atan2(sine * rotation[0, 1], sine * rotation[0, 2]), math.asin(sine), 0.0
    return (
        math.atan2(rotation[2, 1], rotation[2, 2]),
        math.asin(sine),
        math.atan2(rotation[1, 0], rotation[0, 0]),
    )


def _text(values: tuple[float, ...]) -> str:
    return " ".join(f"{value:.9g}" for value in values)
