"""Angular momentum of the robot about a foot, from joint angles and rates."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from cassie_control.control.robot import LegReadings, Readings, Robot
from cassie_gaits import robot
from cassie_gaits.compiled import compiled
from cassie_gaits.linkage import link_rotation
from cassie_gaits.names import LEG_JOINTS, LEGS
from cassie_gaits.records import FloatArray, Record, Records, array, part


class LegInertia(Record):
    """Links of a leg, hip_roll to toe.

    Attributes:
        positions, rotations: Pose in the parent's frame at joint zero; columns are axes. In m.
        zeros: Joint angle there. In rad.
        masses: In kg.
        centres: Centre of mass in the link's frame. In m.
        inertias: About it. In kg m^2.
    """

    positions: FloatArray = array(7, 3)
    rotations: FloatArray = array(7, 3, 3)
    zeros: FloatArray = array(7)
    masses: FloatArray = array(7)
    centres: FloatArray = array(7, 3)
    inertias: FloatArray = array(7, 3, 3)


class Masses(Record):
    """The masses of the robot.

    Attributes:
        legs: Left and right.
        pelvis: Its inertia about its origin. In kg m^2.
        mass: Of the robot. In kg.
    """

    legs: Sequence[LegInertia] = part(LegInertia, 2)
    pelvis: FloatArray = array(3, 3)
    mass: float


def leg_inertia(leg: str) -> LegInertia:
    """Links of a leg; the rods count with the links that carry them."""
    links = {link.name: link for link in robot.leg_links(leg)}
    record = LegInertia()
    for i, joint in enumerate(LEG_JOINTS):
        link = links[joint]
        record.positions[i] = link.position
        record.rotations[i] = link_rotation(link)
        record.zeros[i] = link.joint.zero
        record.masses[i] = link.mass
        record.centres[i] = link.com
        record.inertias[i] = inertia_matrix(link)
    _carry(record, "knee", links["knee_spring"])
    for name in ("heel_spring", "foot_crank"):
        _carry(record, "tarsus", links[name])
    _carry_point(record, "hip_pitch", links["achilles_rod"])
    _carry_point(record, "tarsus", links["plantar_rod"], np.array(links["foot_crank"].position))
    return record


def inertia_matrix(link: robot.Link) -> FloatArray:
    """Inertia of a link about its centre of mass. Shape (3, 3), in kg m^2."""
    xx, yy, zz, xy, xz, yz = link.inertia
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _carry(record: LegInertia, joint: str, link: robot.Link) -> None:
    rotation = link_rotation(link)
    centre = np.array(link.position) + rotation @ np.array(link.com)
    _merge(record, joint, link.mass, centre, rotation @ inertia_matrix(link) @ rotation.T)


def _carry_point(
    record: LegInertia, joint: str, link: robot.Link, centre: FloatArray | None = None
) -> None:
    if centre is None:
        centre = np.array(link.position) + link_rotation(link) @ np.array(link.com)
    _merge(record, joint, link.mass, centre, np.zeros((3, 3)))


def _merge(
    record: LegInertia, joint: str, mass: float, centre: FloatArray, inertia: FloatArray
) -> None:
    """Join a body, given in the link's frame, to a link."""
    i = LEG_JOINTS.index(joint)
    own, own_centre = float(record.masses[i]), record.centres[i].copy()
    both = own + mass
    middle = (own * own_centre + mass * centre) / both
    record.inertias[i] += inertia
    for share, at in ((own, own_centre), (mass, centre)):
        arm = at - middle
        record.inertias[i] += share * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    record.masses[i], record.centres[i] = both, middle


@compiled
def _about_pelvis(
    joints: FloatArray,
    rates: FloatArray,
    omega: FloatArray,
    momenta: Records[Masses],
    total: FloatArray,
) -> None:
    """See `AngularMomentum.about_pelvis`."""
    momentum = momenta[0]
    pelvis = momentum.pelvis
    for k in range(3):
        total[k] = pelvis[k, 0] * omega[0] + pelvis[k, 1] * omega[1] + pelvis[k, 2] * omega[2]
    for i in range(2):
        _add_spin(joints[i], rates[i], omega, momentum.legs[i], total)


@compiled
def momentum_velocity(
    robots: Records[Robot], stance: int, momenta: Records[Masses]
) -> tuple[float, float]:
    """See `AngularMomentum.velocity`; `stance` is the number of that leg."""
    robot = robots[0]
    tilt, total, mass = robot.tilt, np.empty(3), momenta[0].mass
    _about_pelvis(robot.joints, robot.rates, robot.angular_velocity, momenta, total)
    hx = hy = 0.0
    for k in range(3):
        hx += tilt[0, k] * total[k]
        hy += tilt[1, k] * total[k]
    x, y, z = robot.com[0], robot.com[1], robot.com[2]
    vx, vy, vz = robot.com_velocity[0], robot.com_velocity[1], robot.com_velocity[2]
    px, py, pz = robot.ankle[stance, 0], robot.ankle[stance, 1], robot.ankle[stance, 2]
    ux, uy, uz = robot.velocity[0], robot.velocity[1], robot.velocity[2]
    hx += mass * (y * uz - z * uy - py * vz + pz * vy)
    hy += mass * (z * ux - x * uz - pz * vx + px * vz)
    lever = mass * max(0.4, z - pz)
    return hy / lever, -hx / lever


@compiled
def _add_spin(
    joints: FloatArray, rates: FloatArray, omega: FloatArray, leg: LegInertia, total: FloatArray
) -> None:
    """Add the angular momentum of a leg to `total`.

    About the pelvis origin, with the velocities that the links have against it, pelvis frame.

    Args:
        joints, rates: The seven joints. Shape (7,), in rad and rad/s.
        omega: Angular velocity of the pelvis, pelvis frame. Shape (3,), in rad/s.
        leg: Its links.
        total: Shape (3,), in kg m^2/s. Changed in place.
    """
    axes = np.eye(3)
    turned = np.empty((3, 3))
    place = np.zeros(3)
    speed = np.zeros(3)
    turn = omega.copy()
    arm, centre, velocity, own = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for i in range(7):
        _rotate(axes, leg.positions[i], arm)
        _add_cross(turn, arm, speed)
        place += arm
        c, s = math.cos(joints[i] - leg.zeros[i]), math.sin(joints[i] - leg.zeros[i])
        for k in range(3):
            x = y = z = 0.0
            for j in range(3):
                x += axes[k, j] * leg.rotations[i, j, 0]
                y += axes[k, j] * leg.rotations[i, j, 1]
                z += axes[k, j] * leg.rotations[i, j, 2]
            turned[k, 0], turned[k, 1], turned[k, 2] = c * x + s * y, c * y - s * x, z
        axes[:] = turned
        for k in range(3):
            turn[k] += rates[i] * axes[k, 2]
        _rotate(axes, leg.centres[i], arm)
        for k in range(3):
            centre[k] = place[k] + arm[k]
            velocity[k] = speed[k]
        _add_cross(turn, arm, velocity)
        for k in range(3):
            velocity[k] *= leg.masses[i]
        _add_cross(centre, velocity, total)
        # Axes times inertia times axes transposed times angular velocity.
        for k in range(3):
            arm[k] = axes[0, k] * turn[0] + axes[1, k] * turn[1] + axes[2, k] * turn[2]
        _rotate(leg.inertias[i], arm, own)
        _rotate(axes, own, arm)
        for k in range(3):
            total[k] += arm[k]


@compiled
def _rotate(axes: FloatArray, vector: FloatArray, out: FloatArray) -> None:
    x, y, z = vector[0], vector[1], vector[2]
    for k in range(3):
        out[k] = axes[k, 0] * x + axes[k, 1] * y + axes[k, 2] * z


@compiled
def _add_cross(a: FloatArray, b: FloatArray, out: FloatArray) -> None:
    x = a[1] * b[2] - a[2] * b[1]
    y = a[2] * b[0] - a[0] * b[2]
    z = a[0] * b[1] - a[1] * b[0]
    out[0] += x
    out[1] += y
    out[2] += z


class AngularMomentum:
    """Angular momentum about a point, from what the estimator gives."""

    def __init__(self) -> None:
        masses, pelvis = Masses(), robot.PELVIS
        self.records = masses.records
        """The masses of the robot, for compiled functions."""
        for i, leg in enumerate(LEGS):
            masses.records["legs"][0, i] = leg_inertia(leg).records[0]
        com = np.array(pelvis.com)
        spread = com @ com * np.eye(3) - np.outer(com, com)
        masses.pelvis[:] = inertia_matrix(pelvis) + pelvis.mass * spread
        masses.mass = robot.total_mass()

    def velocity(self, readings: Readings, stance: LegReadings) -> tuple[float, float]:
        """Angular momentum about the stance toe joint, as the velocity of a mass at the CoM.

        Returns:
            Forward and to the left, heading frame. In m/s.
        """
        x, y = momentum_velocity(readings.records, stance.number, self.records)
        return x, y

    def about_pelvis(self, q: FloatArray, v: FloatArray, omega: FloatArray) -> FloatArray:
        """About the pelvis origin, with velocities against it, pelvis frame.

        Args:
            q, v: Joints of both legs and their rates. Shape (14,), in rad and rad/s.
            omega: Angular velocity of the pelvis, pelvis frame. Shape (3,), in rad/s.

        Returns:
            Shape (3,), in kg m^2/s.
        """
        total = np.zeros(3)
        _about_pelvis(q.reshape(2, 7), v.reshape(2, 7), omega, self.records, total)
        return total
