"""Cassie with rigid springs as numbers for `inverse_dynamics`: bodies, joints and rods of a leg.

The shin counts as one body with the knee link, as its spring is rigid. The heel spring and the
foot crank are separate bodies. A rod is a mass matrix of its two ends, with the rod's mass, centre
of mass and transverse moment of inertia. The inertia about its length, 4e-6 kg m^2, rotates with
the link parallel to it, or with the hip for the achilles rod.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cassie_gaits import robot
from cassie_gaits.linkage import link_rotation, pin_in_target
from cassie_gaits.records import FloatArray

CHAIN = ("hip_roll", "hip_yaw", "hip_pitch", "knee", "tarsus", "toe")
"""Bodies of a leg from the pelvis to the foot."""

BRANCHES = ("heel_spring", "foot_crank")
"""Bodies attached to the tarsus that are not in the chain."""


@dataclass(frozen=True, eq=False)
class Body:
    """Mass (kg), centre of mass (3,) in m, and inertia about it (3, 3) in kg m^2."""

    mass: float
    com: FloatArray
    inertia: FloatArray


@dataclass(frozen=True, eq=False)
class Hinge:
    """A joint about the child's z axis.

    Attributes:
        position: Position of the child's frame in the parent's frame. Shape (3,), in m.
        rotation: Rotation of the child's frame in the parent's frame at `zero`. Shape (3, 3).
        zero: Joint angle of that rotation. In rad.
        armature: Inertia of the rotor reflected to the joint. In kg m^2.
    """

    position: FloatArray
    rotation: FloatArray
    zero: float
    armature: float


@dataclass(frozen=True, eq=False)
class TwoPointRod:
    """A rod as a mass matrix of its ends.

    Attributes:
        base_body, base: Body at one end, and the end in its frame. Shape (3,), in m.
        tip_body, tip: Body at the other end, and that end in its frame. Shape (3,), in m.
        base_mass, shared_mass, tip_mass: Force at the base is base_mass times the base's
            acceleration plus shared_mass times the tip's, and so on. In kg.
    """

    base_body: str
    base: FloatArray
    tip_body: str
    tip: FloatArray
    base_mass: float
    shared_mass: float
    tip_mass: float


@dataclass(frozen=True, eq=False)
class Leg:
    """Bodies, joints and rods of a leg; the sole's middle in the toe link's frame (m); the achilles
    rod's inertia about its length (kg m^2)."""

    bodies: dict[str, Body]
    hinges: dict[str, Hinge]
    rods: tuple[TwoPointRod, ...]
    sole: FloatArray
    achilles_spin: float


def leg(name: str) -> Leg:
    """Parameters of the "left" or "right" leg."""
    links = {link.name: link for link in robot.leg_links(name)}
    bodies = {part: _body(links[part]) for part in (*CHAIN, *BRANCHES)}
    fixed = [bodies["knee"], _carried(links["knee_spring"]), _carried(links["shin"])]
    bodies["knee"] = joined(fixed)
    # The achilles rod remains parallel to the shin, the plantar rod to the tarsus.
    parallel = link_rotation(links["knee"]).T
    achilles = replace(links["achilles_rod"], inertia=(0.0, *links["achilles_rod"].inertia[1:]))
    bodies["knee"] = joined([bodies["knee"], _left_over(achilles, parallel)])
    bodies["tarsus"] = joined([bodies["tarsus"], _left_over(links["plantar_rod"], np.eye(3))])
    hinges = {part: _hinge(links[part]) for part in (*CHAIN, *BRANCHES)}
    shin, tarsus = links["shin"], links["tarsus"]
    turn = link_rotation(shin)
    hinges["tarsus"] = Hinge(
        np.array(shin.position) + turn @ tarsus.position,
        turn @ link_rotation(tarsus),
        tarsus.joint.zero,
        tarsus.joint.armature,
    )
    sign = -1.0 if name == "right" else 1.0
    rods = tuple(_rod(closure, links, sign) for closure in robot.RODS)
    sole = np.mean(np.array(robot.FOOT_CONTACTS), axis=0)
    return Leg(bodies, hinges, rods, sole, links["achilles_rod"].inertia[0])


def pelvis() -> Body:
    """The real pelvis, which is not quite symmetric."""
    return _body(robot.PELVIS)


def foot_tilt() -> float:
    """Angle of the toe link beyond that of its joint angles. In rad.

    Link frames of the robot table are rounded to five digits.
    """
    return sum(
        float(np.arctan2(link.x_axis[1], link.x_axis[0])) - link.joint.zero
        for link in robot.LEFT_LEG
        if link.name in ("knee", "tarsus")
    )


def joined(parts: Sequence[Body]) -> Body:
    """One body that combines several bodies, all in the same frame."""
    mass = sum(part.mass for part in parts)
    com = sum((part.mass * part.com for part in parts), np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for part in parts:
        d = part.com - com
        inertia += part.inertia + part.mass * (d @ d * np.eye(3) - np.outer(d, d))
    return Body(mass, com, inertia)


def _body(link: robot.Link) -> Body:
    xx, yy, zz, xy, xz, yz = link.inertia
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return Body(link.mass, np.array(link.com), inertia)


def _carried(link: robot.Link) -> Body:
    """The link's body in its parent's frame, with its joint at zero."""
    body, turn = _body(link), link_rotation(link)
    return Body(body.mass, np.array(link.position) + turn @ body.com, turn @ body.inertia @ turn.T)


def _left_over(rod: robot.Link, parallel: FloatArray) -> Body:
    """Inertia of a rod beyond that of its point masses, as a massless body of a parallel link.

    `parallel` rotates axes of the rod's parent into those of that link, with all joints at zero.
    """
    body = _body(rod)
    across = rod.inertia[2]
    turn = parallel @ link_rotation(rod)
    rest = turn @ (body.inertia - np.diag([0.0, across, across])) @ turn.T
    # A rod does not spin about itself when that link turns in the plane of the leg.
    rest[2, :] = rest[:, 2] = 0.0
    return Body(0.0, np.zeros(3), rest)


def _hinge(link: robot.Link) -> Hinge:
    return Hinge(np.array(link.position), link_rotation(link), link.joint.zero, link.joint.armature)


def _rod(closure: robot.Rod, links: dict[str, robot.Link], sign: float) -> TwoPointRod:
    link, length = links[closure.rod], closure.length
    share = link.com[0] / length
    across = link.inertia[2]
    at_base = across / (link.com[0] * length)
    at_tip = across / ((length - link.com[0]) * length)
    between = link.mass - at_base - at_tip
    return TwoPointRod(
        base_body=link.parent,
        base=np.array(link.position),
        tip_body=closure.target,
        tip=pin_in_target(closure) * (1.0, 1.0, sign),
        base_mass=at_base + between * (1.0 - share) ** 2,
        shared_mass=between * share * (1.0 - share),
        tip_mass=at_tip + between * share**2,
    )
