"""The kinds of parts that `robot` lists: joints, links, rods and drives."""

from __future__ import annotations

import math
from dataclasses import dataclass

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Joint:
    """The joint between a link and its parent.

    Attributes:
        kind: "hinge" (about the link's z axis), "ball" or "fixed".
        zero: Joint angle in the pose that `Link.x_axis`, `Link.y_axis` describe. In rad.
        limits: Lower and upper stop, or None. In rad.
        damping: Viscous friction. In Nms/rad.
        armature: Inertia of the rotor reflected to the joint. In kg m^2.
        stiffness: Stiffness of the leaf spring that the joint models, relaxed at 0. In Nm/rad.
    """

    kind: str = "hinge"
    zero: float = 0.0
    limits: tuple[float, float] | None = None
    damping: float = 0.0
    armature: float = 0.0
    stiffness: float = 0.0


@dataclass(frozen=True)
class Link:
    """A rigid body.

    Attributes:
        name: Name, without the leg for links of a leg.
        parent: Name of the link that carries it.
        position: Origin in the parent's frame. In m.
        x_axis: The link's x axis in the parent's frame.
        y_axis: The link's y axis in the parent's frame.
        mass: Mass. In kg.
        com: Centre of mass in the link's frame. In m.
        inertia: ixx, iyy, izz, ixy, ixz, iyz about the centre of mass. In kg m^2.
        joint: Joint between the link and its parent.
        mirror_axis: Axis of the link's frame that the mirror image negates: 1 is y, 2 is z.
        mesh: File stem of the link's mesh in `cassie_description`, or None.
        capsule: Radius and end points of the link's collision shape, or None. In m.
    """

    name: str
    parent: str
    position: Vector
    x_axis: Vector
    y_axis: Vector
    mass: float
    com: Vector
    inertia: tuple[float, float, float, float, float, float]
    joint: Joint
    mirror_axis: int = 2
    mesh: str | None = None
    capsule: tuple[float, Vector, Vector] | None = None


@dataclass(frozen=True)
class Rod:
    """A loop closure: the far end of link `rod` is pinned to a point of link `target`.

    Attributes:
        rod: Link that closes the loop; the pin is at (length, 0, 0) in its frame.
        target: Link to which the rod is pinned.
        length: Length of the rod. In m.
    """

    rod: str
    target: str
    length: float


@dataclass(frozen=True)
class Drive:
    """A motor with its gear.

    Attributes:
        gear: Gear ratio, motor turns per turn of the joint.
        motor_torque: Largest torque of the motor. In Nm.
        no_load_speed: Speed of the motor without load. In rpm.
        encoder_bits: Resolution of the motor-side encoder; a turn has two to this power counts.
    """

    gear: float
    motor_torque: float
    no_load_speed: float
    encoder_bits: int

    @property
    def torque_limit(self) -> float:
        """Largest torque at the joint. In Nm."""
        return self.gear * self.motor_torque

    @property
    def speed_limit(self) -> float:
        """Speed of the joint without load. In rad/s."""
        return self.no_load_speed * 2.0 * math.pi / 60.0 / self.gear
