"""Angular momentum of the robot about a foot, from joint angles and rates."""

from __future__ import annotations

import numpy as np

from cassie_control.control.robot import Robot, pendulum_height
from cassie_gaits import robot as model
from cassie_gaits.compiled import compiled
from cassie_gaits.leg import UPRIGHT, ZERO, into, next_link
from cassie_gaits.linkage import link_rotation
from cassie_gaits.names import LEG_JOINTS, LEGS
from cassie_gaits.records import FloatArray, Record, Records, array, part
from cassie_gaits.vectors import Vector, VectorLike, cross, dot, plus, times, turned


class LegInertia(Record):
    """Links of a leg, hip_roll to toe.

    Attributes:
        positions, rotations: Pose in the parent's frame at joint zero; columns are axes. In m.
        zeros: Joint angle at joint zero. In rad.
        masses: Mass of each link. In kg.
        centres: Centre of mass in the link's frame. In m.
        inertias: Inertia about the centre of mass. In kg m^2.
    """

    positions: FloatArray = array(7, 3)
    rotations: FloatArray = array(7, 3, 3)
    zeros: FloatArray = array(7)
    masses: FloatArray = array(7)
    centres: FloatArray = array(7, 3)
    inertias: FloatArray = array(7, 3, 3)


class Masses(Record):
    """Masses and inertias of the robot.

    Attributes:
        legs: Left and right leg.
        pelvis: Inertia of the pelvis about its origin. In kg m^2.
        mass: Mass of the robot. In kg.
    """

    legs: Records[LegInertia] = part(LegInertia, 2)
    pelvis: FloatArray = array(3, 3)
    mass: float


def leg_inertia(leg: str) -> LegInertia:
    """Links of a leg; springs, cranks and rods are merged with the links that carry them."""
    links = {link.name: link for link in model.leg_links(leg)}
    record = LegInertia()
    for i, joint in enumerate(LEG_JOINTS):
        link = links[joint]
        record.positions[i] = link.position
        record.rotations[i] = link_rotation(link)
        record.zeros[i] = link.joint.zero
        record.masses[i] = link.mass
        record.centres[i] = link.com
        record.inertias[i] = inertia_matrix(link)
    _merge_link(record, "knee", links["knee_spring"])
    for name in ("heel_spring", "foot_crank"):
        _merge_link(record, "tarsus", links[name])
    _merge_point_mass(record, "hip_pitch", links["achilles_rod"])
    _merge_point_mass(
        record, "tarsus", links["plantar_rod"], np.array(links["foot_crank"].position)
    )
    return record


def inertia_matrix(link: model.Link) -> FloatArray:
    """Inertia of a link about its centre of mass. Shape (3, 3), in kg m^2."""
    xx, yy, zz, xy, xz, yz = link.inertia
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _merge_link(record: LegInertia, joint: str, link: model.Link) -> None:
    rotation = link_rotation(link)
    centre = np.array(link.position) + rotation @ np.array(link.com)
    _merge(record, joint, link.mass, centre, rotation @ inertia_matrix(link) @ rotation.T)


def _merge_point_mass(
    record: LegInertia, joint: str, link: model.Link, centre: FloatArray | None = None
) -> None:
    if centre is None:
        centre = np.array(link.position) + link_rotation(link) @ np.array(link.com)
    _merge(record, joint, link.mass, centre, np.zeros((3, 3)))


def _merge(
    record: LegInertia, joint: str, mass: float, centre: FloatArray, inertia: FloatArray
) -> None:
    """Merge a body, given in the link's frame, with a link."""
    i = LEG_JOINTS.index(joint)
    link_mass, link_centre = float(record.masses[i]), record.centres[i].copy()
    total = link_mass + mass
    common = (link_mass * link_centre + mass * centre) / total
    record.inertias[i] += inertia
    for body_mass, body_centre in ((link_mass, link_centre), (mass, centre)):
        arm = body_centre - common
        record.inertias[i] += body_mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    record.masses[i], record.centres[i] = total, common


@compiled
def momentum_about_pelvis(
    joints: FloatArray, rates: FloatArray, omega: VectorLike, all_masses: Records[Masses]
) -> Vector:
    """Angular momentum about the pelvis origin, by velocities relative to it, pelvis frame.

    Args:
        joints, rates: Joint angles and rates of both legs. Shape (2, 7), in rad and rad/s.
        omega: Angular velocity of the pelvis, pelvis frame. Shape (3,), in rad/s.
        all_masses: Masses of the robot. Shape (1,).

    Returns:
        In kg m^2/s.
    """
    masses, pelvis = all_masses[0], (omega[0], omega[1], omega[2])
    total = turned(masses.pelvis, pelvis)
    for i in range(2):
        leg, motion = masses.legs[i], (UPRIGHT, ZERO, ZERO, pelvis)
        for k in range(7):
            motion = next_link(motion, leg, k, joints[i, k], rates[i, k])
            axes, origin, velocity, turn = motion
            arm = into(axes, leg.centres[k])
            momentum = times(leg.masses[k], plus(velocity, cross(turn, arm)))
            total = plus(total, cross(plus(origin, arm), momentum))
            link_rate = (dot(axes[0], turn), dot(axes[1], turn), dot(axes[2], turn))
            total = plus(total, into(axes, turned(leg.inertias[k], link_rate)))
    return total


@compiled
def momentum_velocity(
    robots: Records[Robot], stance: int, all_masses: Records[Masses]
) -> tuple[float, float]:
    """Angular momentum about the stance toe joint, as the velocity of a mass at the CoM.

    Args:
        robots: The robot now. Shape (1,).
        stance: Number of the stance leg.
        all_masses: From `make_masses`.

    Returns:
        Forward and to the left, heading frame. In m/s.
    """
    robot = robots[0]
    R_HP, mass = robot.R_HP, all_masses[0].mass
    total = momentum_about_pelvis(robot.joints, robot.rates, robot.angular_velocity, all_masses)
    hx = hy = 0.0
    for k in range(3):
        hx += R_HP[0, k] * total[k]
        hy += R_HP[1, k] * total[k]
    x, y, z = robot.com[0], robot.com[1], robot.com[2]
    vx, vy, vz = robot.com_velocity[0], robot.com_velocity[1], robot.com_velocity[2]
    px, py, pz = robot.toe_joint[stance, 0], robot.toe_joint[stance, 1], robot.toe_joint[stance, 2]
    ux, uy, uz = robot.velocity[0], robot.velocity[1], robot.velocity[2]
    hx += mass * (y * uz - z * uy - py * vz + pz * vy)
    hy += mass * (z * ux - x * uz - pz * vx + px * vz)
    lever = mass * pendulum_height(robot, stance)
    return hy / lever, -hx / lever


def make_masses() -> Records[Masses]:
    """The masses of the robot, `Masses`. Shape (1,)."""
    masses, pelvis = Masses(), model.PELVIS
    for i, leg in enumerate(LEGS):
        masses.records["legs"][0, i] = leg_inertia(leg).records[0]
    com = np.array(pelvis.com)
    spread = com @ com * np.eye(3) - np.outer(com, com)
    masses.pelvis[:] = inertia_matrix(pelvis) + pelvis.mass * spread
    masses.mass = model.MASS
    records: Records[Masses] = masses.records
    return records
