"""The robot's links, shapes and meshes from its URDF, as the browser page draws them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

Numbers = list[float]
_GREY = [0.6, 0.6, 0.6, 1.0]


class DescriptionError(ValueError):
    """A robot description that cannot be drawn."""


@dataclass(frozen=True)
class RobotDescription:
    """Links to draw, and torque limits of the drives.

    Attributes:
        moving: The root link, then the links below a joint that moves.
        efforts: Greatest torque of each drive, by the name of its joint. In Nm.
        meshes: Files of the meshes; shapes refer to them by index.
        links: Links for the page, parents before children: name, parent, pose at rest (x, y, z and
            quaternion x, y, z, w), shapes, whether the link moves, and the points of its sole.
    """

    moving: list[str]
    efforts: Mapping[str, float]
    meshes: list[Path]
    links: list[dict[str, Any]]


def read_description(text: str, share: Callable[[str], str]) -> RobotDescription:
    """The robot in a URDF.

    Args:
        text: The URDF.
        share: Returns the share folder of an installed package; raises LookupError if there is
            no such package.

    Returns:
        The robot, without meshes that are not on this computer.

    Raises:
        DescriptionError: if `text` is no URDF of one tree.
    """
    try:
        return _read(text, share)
    except (ElementTree.ParseError, AttributeError, KeyError, ValueError) as error:
        raise DescriptionError(f"/robot_description cannot be drawn: {error}") from None


def _read(text: str, share: Callable[[str], str]) -> RobotDescription:
    robot = ElementTree.fromstring(text)
    colours = {
        material.attrib["name"]: _numbers(colour.attrib["rgba"], 4)
        for material in robot.findall("material")
        if (colour := material.find("color")) is not None
    }
    joints = {joint.find("child").attrib["link"]: joint for joint in robot.findall("joint")}  # type: ignore[union-attr]
    elements = {link.attrib["name"]: link for link in robot.findall("link")}
    roots = [name for name in elements if name not in joints]
    if len(roots) != 1:
        raise ValueError(f"{len(roots)} links have no parent, expected one")
    meshes: list[Path] = []
    links: list[dict[str, Any]] = []
    for name in _parents_first(roots[0], joints):
        joint = joints.get(name)
        links.append(
            {
                "name": name,
                "parent": "" if joint is None else _parent(joint),
                "rest": [0.0] * 6 + [1.0] if joint is None else _pose(joint.find("origin")),
                "shapes": _shapes(elements[name], colours, meshes, share),
                "moves": joint is None or joint.get("type") != "fixed",
                "soles": _soles(elements[name]) if "toe" in name else [],
            }
        )
    limits = {joint.attrib["name"]: joint.find("limit") for joint in joints.values()}
    efforts = {name: float(e.get("effort", 0.0)) for name, e in limits.items() if e is not None}
    return RobotDescription(
        moving=[link["name"] for link in links if link["moves"]],
        efforts={name: effort for name, effort in efforts.items() if effort > 0.0},
        meshes=meshes,
        links=links,
    )


def _parent(joint: Element) -> str:
    return joint.find("parent").attrib["link"]  # type: ignore[union-attr]


def _parents_first(root: str, joints: Mapping[str, Element]) -> list[str]:
    order, waiting = [root], dict(joints)
    while waiting:
        ready = [name for name, joint in waiting.items() if _parent(joint) in order]
        if not ready:
            raise ValueError(f"{next(iter(waiting))} hangs on no link")
        order += ready
        for name in ready:
            del waiting[name]
    return order


def _shapes(
    link: Element,
    colours: Mapping[str, Numbers],
    meshes: list[Path],
    share: Callable[[str], str],
) -> list[dict[str, Any]]:
    found = []
    for visual in link.findall("visual"):
        geometry = visual.find("geometry")
        if geometry is None or not len(geometry):
            continue
        shape = {"pose": _pose(visual.find("origin")), "colour": _colour(visual, colours)}
        shape |= _geometry(geometry[0], meshes, share)
        if "kind" in shape:
            found.append(shape)
    return found


def _geometry(element: Element, meshes: list[Path], share: Callable[[str], str]) -> dict[str, Any]:
    if element.tag == "mesh":
        path = _mesh_file(element.attrib["filename"], share)
        if path is None:
            return {}
        if path not in meshes:
            meshes.append(path)
        scale = _numbers(element.get("scale", "1 1 1"), 3)
        return {"kind": "mesh", "mesh": meshes.index(path), "size": scale}
    if element.tag == "box":
        return {"kind": "box", "size": _numbers(element.attrib["size"], 3)}
    if element.tag in ("sphere", "cylinder"):
        size = [float(element.attrib["radius"]), float(element.get("length", 0.0))]
        return {"kind": element.tag, "size": size}
    return {}


def _mesh_file(uri: str, share: Callable[[str], str]) -> Path | None:
    """File of a mesh; None if it is not an STL file in the share folder of a package."""
    package, _, inside = uri.removeprefix("package://").partition("/")
    if not uri.startswith("package://") or not inside.lower().endswith(".stl"):
        return None
    try:
        folder = Path(share(package))
    except LookupError:
        return None
    if ".." in Path(inside).parts:
        return None
    path = folder / inside
    return path if path.is_file() else None


def _colour(visual: Element, colours: Mapping[str, Numbers]) -> Numbers:
    material = visual.find("material")
    if material is None:
        return _GREY
    colour = material.find("color")
    if colour is not None:
        return _numbers(colour.attrib["rgba"], 4)
    return colours.get(material.get("name", ""), _GREY)


def _soles(link: Element) -> list[Numbers]:
    """Centre and radius of each ball on which a foot stands. In m."""
    found = []
    for collision in link.findall("collision"):
        sphere = collision.find("geometry/sphere")
        if sphere is not None:
            centre = _pose(collision.find("origin"))[:3]
            found.append([*centre, float(sphere.attrib["radius"])])
    return found


def _pose(origin: Element | None) -> Numbers:
    if origin is None:
        return [0.0] * 6 + [1.0]
    roll, pitch, yaw = _numbers(origin.get("rpy", "0 0 0"), 3)
    return _numbers(origin.get("xyz", "0 0 0"), 3) + quaternion(roll, pitch, yaw)


def quaternion(roll: float, pitch: float, yaw: float) -> Numbers:
    """Quaternion x, y, z, w of Euler angles z-y-x, in rad."""
    (sr, cr), (sp, cp), (sy, cy) = (
        (math.sin(0.5 * angle), math.cos(0.5 * angle)) for angle in (roll, pitch, yaw)
    )
    return [
        cy * cp * sr - sy * sp * cr,
        cy * sp * cr + sy * cp * sr,
        sy * cp * cr - cy * sp * sr,
        cy * cp * cr + sy * sp * sr,
    ]


def _numbers(text: str, count: int) -> Numbers:
    numbers = [float(word) for word in text.split()]
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise ValueError(f"{text!r} are not {count} numbers")
    return numbers
