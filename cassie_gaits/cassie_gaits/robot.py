"""Cassie's parameters: links, joints, springs, rods and drives, for every model of the robot.

This table is their only source. `cassie_sim.robot_mjcf` makes the MuJoCo model from it,
`cassie_gaits.dynamics` the Pinocchio model. The table has only the left leg; the right leg is
its mirror image (`mirrored`).

A link's frame has its joint axis along z. Poses are in the parent's frame, inertias about the
centre of mass in axes parallel to the link's frame. Units: m, kg, kg m^2, Nm, rad.

Source: link masses, inertias and poses of the public Cassie models (Agility Robotics; Dynamic
Robotics Laboratory; `example-robot-data`). The reflected inertias, damping and ranges are those
of the same models.
"""

from __future__ import annotations

import math
from dataclasses import replace

from cassie_gaits.robot_parts import Drive, Joint, Link, Rod, Vector

__all__ = [
    "DRIVES",
    "DRIVE_DELAY",
    "DRIVE_VELOCITY_FILTER",
    "ENCODER_RATE",
    "FOOT_CONTACTS",
    "GRAVITY",
    "IMU_POSITION",
    "JOINT_ENCODER_BITS",
    "JOINT_VELOCITY_FILTER",
    "KNEE_STOPS",
    "LEFT_LEG",
    "MASS",
    "NEUTRAL_TARSUS",
    "PELVIS",
    "PELVIS_BALL",
    "RODS",
    "SOLE_RADIUS",
    "WEIGHT",
    "Drive",
    "Joint",
    "Link",
    "Rod",
    "Vector",
    "leg_links",
    "mirror_vector",
    "mirrored",
    "stops",
    "symmetric_pelvis",
]

NEUTRAL_TARSUS = math.radians(13.0)
"""q4 + q5 + q6 with relaxed springs, eq:SpringRelaxed. In rad."""


def _deg(low: float, high: float) -> tuple[float, float]:
    return (math.radians(low), math.radians(high))


PELVIS = Link(
    name="pelvis",
    parent="world",
    position=(0.0, 0.0, 1.01),
    x_axis=(1.0, 0.0, 0.0),
    y_axis=(0.0, 1.0, 0.0),
    mass=10.33,
    com=(0.05066, 0.000346, 0.02841),
    inertia=(0.085821, 0.049222, 0.08626, 1.276e-05, -0.00016022, -0.000414),
    joint=Joint(kind="free"),
    mirror_axis=1,
    mesh="pelvis",
)

PELVIS_BALL: tuple[float, Vector] = (0.15, (0.02, 0.0, 0.02))
"""Radius and centre, in the pelvis frame, of the pelvis's collision shape. In m."""

IMU_POSITION: Vector = (0.03155, 0.0, -0.07996)
"""Origin of the IMU in the pelvis frame. In m."""

_TARSUS_TO_HEEL: Vector = (-0.01269, -0.03059, 0.00092)

LEFT_LEG: tuple[Link, ...] = (
    Link(
        "hip_roll", "pelvis", (0.021, 0.135, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0),
        1.82, (-0.01793, 0.0001, -0.04428),
        (0.003431, 0.003793, 0.002135, -6.65e-07, -0.00084, 3.99e-06),
        Joint(limits=_deg(-15, 22.5), damping=1.0, armature=0.038125), 1, "hip-roll",
    ),
    Link(
        "hip_yaw", "hip_roll", (0.0, 0.0, -0.07), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0),
        1.171, (0.0, -1e-05, -0.034277),
        (0.002443, 0.002803, 0.000842, -4e-08, 2.462e-07, -2.71e-08),
        Joint(limits=_deg(-22.5, 22.5), damping=1.0, armature=0.038125), 1, "hip-yaw",
    ),
    Link(
        "hip_pitch", "hip_yaw", (0.0, 0.0, -0.09), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0),
        5.52, (0.05946, 5e-05, -0.03581),
        (0.010898, 0.029714, 0.030257, -0.0002669, -5.721e-05, 9.17e-06),
        Joint(limits=_deg(-50, 80), damping=1.0, armature=0.09344), 2, "hip-pitch",
        (0.08, (0.0, 0.0, -0.04), (0.12, 0.0, -0.0355)),
    ),
    Link(
        "achilles_rod", "hip_pitch", (0.0, 0.0, 0.045),
        (0.7922, -0.60599, -0.072096), (0.60349, 0.79547, -0.054922),
        0.1567, (0.24719, 0.0, 0.0),
        (3.754e-06, 0.004487, 0.004488, -3.74e-08, -1.61e-08, 0.0),
        Joint(kind="ball", damping=0.01), 2, "achilles-rod",
    ),
    Link(
        "knee", "hip_pitch", (0.12, 0.0, 0.0045),
        (math.sqrt(0.5), -math.sqrt(0.5), 0.0), (math.sqrt(0.5), math.sqrt(0.5), 0.0),
        0.7578, (0.023, 0.03207, -0.002181),
        (0.001376, 0.0010335, 0.0021637, -0.00039744, -4.085e-05, -5.374e-05),
        Joint(zero=math.radians(-45), limits=_deg(-164, -37), damping=1.0, armature=0.09344),
        2, "knee",
    ),
    Link(
        "knee_spring", "knee", (0.06068, 0.08241, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0),
        0.186, (0.0836, 0.0034, 0.0),
        (5.215e-05, 0.00041205, 0.0003669, 6.87e-06, 0.0, 0.0),
        Joint(kind="fixed"), 2, "knee-spring",
    ),
    Link(
        "shin", "knee", (0.06068, 0.04741, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0),
        0.577, (0.18338, 0.001169, 0.0002123),
        (0.00035939, 0.014728, 0.014707, -0.00020981, 2.266e-05, -1.2e-07),
        Joint(limits=_deg(-20, 20), damping=0.1, stiffness=1500.0), 2, "shin",
        (0.04, (0.0, 0.0, 0.0), (0.43476, 0.02, 0.0)),
    ),
    Link(
        "tarsus", "shin", (0.43476, 0.02, 0.0), (0.52992, 0.84805, 0.0), (-0.84805, 0.52992, 0.0),
        0.782, (0.11046, -0.03058, -0.00131),
        (0.00039238, 0.013595, 0.013674, 0.00023651, -4.987e-05, -4.82e-06),
        Joint(zero=math.radians(58), limits=_deg(50, 170), damping=0.1), 2, "tarsus",
        (0.04, _TARSUS_TO_HEEL, (0.408, -0.04, 0.0)),
    ),
    Link(
        "heel_spring", "tarsus", _TARSUS_TO_HEEL,
        (-0.91211, 0.40829, 0.036948), (-0.40992, -0.90952, -0.068841),
        0.126, (0.081, 0.0022, 0.0),
        (2.959e-05, 0.00022231, 0.0002007, 7.15e-06, -6e-07, 1e-07),
        Joint(stiffness=1250.0), 2, "heel-spring",
    ),
    Link(
        "foot_crank", "tarsus", (0.058, -0.034, 0.02275), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0),
        0.1261, (0.00493, 2e-05, -0.00215),
        (2.6941e-05, 4.9621e-05, 6.3362e-05, -2.1e-09, -3.9623e-06, -1.09e-08),
        Joint(limits=_deg(-140, -30), damping=1.0), 2, "foot-crank",
    ),
    Link(
        "plantar_rod", "foot_crank", (0.055, 0.0, -0.00791), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0),
        0.1186, (0.17792, 0.0, 0.0),
        (2.779e-06, 0.001774, 0.001775, -2.34e-08, -8.1e-09, 0.0),
        Joint(), 2, "plantar-rod",
    ),
    Link(
        "toe", "tarsus", (0.408, -0.04, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0),
        0.1498, (0.00474, 0.02748, -0.00014),
        (0.00017388, 0.00016793, 0.00033261, 0.00011814, 1.36e-06, -4e-07),
        Joint(limits=_deg(-140, -30), damping=1.0, armature=0.01225), 2, "foot",
    ),
)  # fmt: skip

RODS: tuple[Rod, ...] = (
    Rod("achilles_rod", "heel_spring", 0.5012),
    Rod("plantar_rod", "toe", 0.35012),
)
"""Loop closures of each leg. The pin's position in the target follows from the neutral pose."""

FOOT_CONTACTS: tuple[Vector, Vector] = (
    (-0.052821, 0.092622, 0.0),
    (0.069746, -0.010224, 0.0),
)
"""Toe and heel end of the sole's centre line in the toe link's frame. In m."""

SOLE_RADIUS = 0.02
"""Radius of the rounded sole about that line. In m."""

DRIVES: dict[str, Drive] = {
    "hip_roll": Drive(25.0, 4.5, 2900.0, 13),
    "hip_yaw": Drive(25.0, 4.5, 2900.0, 13),
    "hip_pitch": Drive(16.0, 12.2, 1300.0, 13),
    "knee": Drive(16.0, 12.2, 1300.0, 13),
    "toe": Drive(50.0, 0.9, 5500.0, 18),
}
"""Drives of each leg by joint."""

JOINT_ENCODER_BITS = {"shin": 18, "tarsus": 18, "toe": 13}
"""Bits of the joint-side encoders of each leg."""

ENCODER_RATE = 2000.0
"""Rate of all encoders, and of the filters that compute velocities from their angles. In Hz."""

DRIVE_VELOCITY_FILTER = tuple(
    tap / math.pi for tap in (2727.0, 534.0, -2658.0, -795.0, 72.0, 110.0, 19.0, -6.0, -3.0)
)
"""Velocity filter of the drives' angles, newest first. In 1/s."""

JOINT_VELOCITY_FILTER = ((12.348, 12.348, -12.348, -12.348), (-1.7658, 0.79045))
"""Velocity filter of the joints, newest first: coefficients of angles (1/s), and coefficients of
past velocities, which are subtracted."""

DRIVE_DELAY = 0.003
"""Latency from a torque set-point to the torque. In s."""


def mirror_vector(vector: Vector, axis: int) -> Vector:
    """The vector with its component along `axis` (1 is y, 2 is z) negated."""
    return (
        vector[0],
        -vector[1] if axis == 1 else vector[1],
        -vector[2] if axis == 2 else vector[2],
    )


def mirrored(link: Link) -> Link:
    """The right leg's link for one of the left leg.

    A mirror image of the parent negates one axis of the parent's frame, a mirror image of the link
    negates `link.mirror_axis` of the link's frame; axes that both negate keep their sign.
    """
    parent_axis = 1 if link.parent == "pelvis" else _mirror_axis_of(link.parent)
    ixx, iyy, izz, ixy, ixz, iyz = link.inertia
    sign_xy = -1.0 if link.mirror_axis == 1 else 1.0
    sign_xz = -1.0 if link.mirror_axis == 2 else 1.0
    y_axis = mirror_vector(link.y_axis, parent_axis)
    if link.mirror_axis == 1:
        y_axis = (-y_axis[0], -y_axis[1], -y_axis[2])
    joint = link.joint
    if link.mirror_axis == 1 and joint.limits is not None:
        joint = replace(joint, limits=(-joint.limits[1], -joint.limits[0]))
    capsule = link.capsule
    if capsule is not None:
        radius, start, end = capsule
        capsule = (
            radius,
            mirror_vector(start, link.mirror_axis),
            mirror_vector(end, link.mirror_axis),
        )
    return replace(
        link,
        position=mirror_vector(link.position, parent_axis),
        x_axis=mirror_vector(link.x_axis, parent_axis),
        y_axis=y_axis,
        com=mirror_vector(link.com, link.mirror_axis),
        inertia=(ixx, iyy, izz, sign_xy * ixy, sign_xz * ixz, -iyz),
        joint=joint,
        capsule=capsule,
    )


def _mirror_axis_of(name: str) -> int:
    return next(link.mirror_axis for link in LEFT_LEG if link.name == name)


def leg_links(leg: str) -> tuple[Link, ...]:
    """The links of "left" or "right" leg, parents before children."""
    return LEFT_LEG if leg == "left" else tuple(mirrored(link) for link in LEFT_LEG)


def stops(leg: str) -> dict[str, tuple[float, float]]:
    """Lower and upper stop of each joint of "left" or "right" leg that has stops. In rad."""
    joints = {link.name: link.joint.limits for link in leg_links(leg)}
    return {name: limits for name, limits in joints.items() if limits is not None}


def _knee_stops() -> tuple[float, float]:
    joints = stops("left")
    (low, high), (tarsus_low, tarsus_high) = joints["knee"], joints["tarsus"]
    return max(low, NEUTRAL_TARSUS - tarsus_high), min(high, NEUTRAL_TARSUS - tarsus_low)


KNEE_STOPS = _knee_stops()
"""Stops of either knee with relaxed springs: those of the knee and, as the knee then turns the
tarsus, those of the tarsus. In rad."""


def symmetric_pelvis() -> Link:
    """The pelvis without its asymmetry of 0.35 mm and 5e-4 kg m^2."""
    ixx, iyy, izz, _, ixz, _ = PELVIS.inertia
    com = (PELVIS.com[0], 0.0, PELVIS.com[2])
    return replace(PELVIS, com=com, inertia=(ixx, iyy, izz, 0.0, ixz, 0.0))


MASS = PELVIS.mass + 2.0 * sum(link.mass for link in LEFT_LEG)
"""Mass of the robot. In kg."""

GRAVITY = 9.81
"""Gravity. In m/s^2."""

WEIGHT = MASS * GRAVITY
"""Weight of the robot. In N."""
