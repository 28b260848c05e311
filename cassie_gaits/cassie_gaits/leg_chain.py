"""Kinematics of Cassie's legs with deflected springs, compiled for the control loop.

Everything is in the pelvis frame. The chain runs hip_roll, hip_yaw, hip_pitch, knee, shin,
tarsus, toe; the achilles rod, heel spring, foot crank and plantar rod follow in closed form.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from numba import njit

from cassie_gaits import robot
from cassie_gaits.names import LEG_JOINTS

FloatArray = npt.NDArray[np.float64]

SHIN_STIFFNESS = 1500.0
HEEL_STIFFNESS = 1250.0


@dataclass
class LegState:
    """Result of `LegChain.update`; the arrays are reused.

    Attributes:
        foot: Middle of the sole's centre line. Shape (3,), in m.
        foot_velocity: Its velocity against the pelvis. Shape (3,), in m/s.
        foot_rotation: Toe link to pelvis. Shape (3, 3).
        ankle: Toe joint. Shape (3,), in m.
        ankle_jacobian: Of the toe joint's position by the seven joints. Shape (3, 7), in m/rad.
        com_moment: Sum of mass times position over the leg's links. Shape (3,), in kg m.
        com_rate: Its rate of change against the pelvis. Shape (3,), in kg m/s.
        springs: Deflection of shin and heel spring. Shape (2,), in rad.
        heel_gradient: Derivative of the heel spring's deflection by shin and tarsus. Shape (2,).
    """

    foot: FloatArray = field(default_factory=lambda: np.zeros(3))
    foot_velocity: FloatArray = field(default_factory=lambda: np.zeros(3))
    foot_rotation: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))
    ankle: FloatArray = field(default_factory=lambda: np.zeros(3))
    ankle_jacobian: FloatArray = field(default_factory=lambda: np.zeros((3, 7)))
    com_moment: FloatArray = field(default_factory=lambda: np.zeros(3))
    com_rate: FloatArray = field(default_factory=lambda: np.zeros(3))
    springs: FloatArray = field(default_factory=lambda: np.zeros(2))
    heel_gradient: FloatArray = field(default_factory=lambda: np.zeros(2))


class LegChain:
    """Forward kinematics, centre of mass and spring forces of one leg.

    Args:
        leg: "left" or "right".
    """

    def __init__(self, leg: str) -> None:
        links = {link.name: link for link in robot.leg_links(leg)}
        chain = [links[name] for name in LEG_JOINTS]
        self._positions = np.array([link.position for link in chain])
        self._rotations = np.array([_rotation(link) for link in chain])
        self._zeros = np.array([link.joint.zero for link in chain])
        bodies = [_with_fixed(link, links) for link in chain]
        self._masses = np.array([mass for mass, _ in bodies])
        self._coms = np.array([com for _, com in bodies])
        self._heel = _heel_table(links)
        self._crank = _crank_table(links)
        self._sole = np.mean(np.array(robot.FOOT_CONTACTS), axis=0)
        self.mass = float(sum(link.mass for link in links.values()))
        self.state = LegState()
        self.update(np.array([0.0, 0.0, 0.5, -1.2, 0.0, 1.2 + robot.NEUTRAL_TARSUS, -1.6]), np.zeros(7))

    def update(self, joints: FloatArray, rates: FloatArray) -> LegState:
        """Kinematics at a measured pose.

        Args:
            joints: Shape (7,), in rad.
            rates: Shape (7,), in rad/s.

        Returns:
            `state`, changed in place.
        """
        s = self.state
        _leg_kinematics(
            joints,
            rates,
            self._positions,
            self._rotations,
            self._zeros,
            self._masses,
            self._coms,
            self._heel,
            self._crank,
            self._sole,
            s.foot,
            s.foot_velocity,
            s.foot_rotation,
            s.ankle,
            s.ankle_jacobian,
            s.com_moment,
            s.com_rate,
            s.springs,
            s.heel_gradient,
        )
        return s

    def force(self, toe_torque: float) -> tuple[float, float, float]:
        """Ground force on the foot in the leg's plane, from the springs of the last update.

        The springs balance the ground force when shin and tarsus give way while the foot keeps
        its attitude: J_ankle^T F - toe_torque = dV/dq for shin and tarsus, with
        V = 1/2 k_shin q5^2 + 1/2 k_heel theta^2. Inertia and weight of the leg below the knee
        are left out (some 10 N).

        Args:
            toe_torque: Of the toe drive. In Nm.

        Returns:
            Force on the foot in the pelvis frame. In N.
        """
        s = self.state
        return _spring_force(s.ankle_jacobian, s.springs, s.heel_gradient, toe_torque)


def _rotation(link: robot.Link) -> FloatArray:
    x_axis = np.asarray(link.x_axis) / np.linalg.norm(link.x_axis)
    z_axis = np.cross(x_axis, link.y_axis)
    z_axis /= np.linalg.norm(z_axis)
    return np.column_stack([x_axis, np.cross(z_axis, x_axis), z_axis])


def _with_fixed(link: robot.Link, links: dict[str, robot.Link]) -> tuple[float, FloatArray]:
    """Mass and centre of mass of a link with what moves along with it.

    The heel spring deflects by a few degrees at most; it counts as fixed to the tarsus.
    """
    mass, moment = link.mass, link.mass * np.asarray(link.com)
    for other in links.values():
        fixed = other.joint.kind == "fixed" or other.name == "heel_spring"
        if fixed and other.parent == link.name:
            com = np.asarray(other.position) + _rotation(other) @ np.asarray(other.com)
            mass += other.mass
            moment += other.mass * com
    return mass, moment / mass


def _heel_table(links: dict[str, robot.Link]) -> FloatArray:
    """Rows: rod's origin in hip_pitch, spring's origin in tarsus, its x, y, z axes in tarsus,
    pin in the spring's frame, (rod length, rod mass, share of the rod up to its centre of mass).
    """
    rod, heel = links["achilles_rod"], links["heel_spring"]
    length = next(r.length for r in robot.RODS if r.rod == "achilles_rod")
    # The pin in the spring follows from the pose in which the frames are given: walk the chain
    # hip_pitch -> knee -> shin -> tarsus there.
    position, rotation = np.zeros(3), np.eye(3)
    for name in ("knee", "shin", "tarsus"):
        position = position + rotation @ np.asarray(links[name].position)
        rotation = rotation @ _rotation(links[name])
    spring_rotation = rotation @ _rotation(heel)
    spring_position = position + rotation @ np.asarray(heel.position)
    tip = np.asarray(rod.position) + _rotation(rod) @ np.array([length, 0.0, 0.0])
    pin = spring_rotation.T @ (tip - spring_position)
    axes = _rotation(heel)
    share = rod.com[0] / length
    return np.array(
        [rod.position, heel.position, axes[:, 0], axes[:, 1], axes[:, 2], pin, (length, rod.mass, share)]
    )


def _crank_table(links: dict[str, robot.Link]) -> FloatArray:
    """Rows: crank's origin, its centre of mass, rod's origin, rod's centre of mass, (masses)."""
    crank, rod = links["foot_crank"], links["plantar_rod"]
    return np.array([crank.position, crank.com, rod.position, rod.com, (crank.mass, rod.mass, 0.0)])


@njit(cache=True)
def _cross(a, b, out):  # type: ignore[no-untyped-def]
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@njit(cache=True)
def _wrapped(angle):  # type: ignore[no-untyped-def]
    return angle - 2.0 * math.pi * round(angle / (2.0 * math.pi))


@njit(cache=True)
def _add_body(mass, point, origin, velocity, omega, moment, rate):  # type: ignore[no-untyped-def]
    """Add a point mass that moves with a link to the sums."""
    rx, ry, rz = point[0] - origin[0], point[1] - origin[1], point[2] - origin[2]
    moment[0] += mass * point[0]
    moment[1] += mass * point[1]
    moment[2] += mass * point[2]
    rate[0] += mass * (velocity[0] + omega[1] * rz - omega[2] * ry)
    rate[1] += mass * (velocity[1] + omega[2] * rx - omega[0] * rz)
    rate[2] += mass * (velocity[2] + omega[0] * ry - omega[1] * rx)


@njit(cache=True)
def _leg_kinematics(  # type: ignore[no-untyped-def]
    joints, rates, positions, rotations, zeros, masses, coms, heel, crank, sole,
    foot, foot_velocity, foot_rotation, ankle, ankle_jacobian, com_moment, com_rate,
    springs, heel_gradient,
):  # fmt: skip
    rotation = np.eye(3)
    position = np.zeros(3)
    velocity = np.zeros(3)
    omega = np.zeros(3)
    arm = np.zeros(3)
    swept = np.zeros(3)
    axes = np.zeros((7, 3))
    origins = np.zeros((7, 3))
    com_moment[:] = 0.0
    com_rate[:] = 0.0
    fixed = np.zeros((3, 3))
    rod_origin = np.zeros(3)
    rod_velocity = np.zeros(3)
    for i in range(7):
        _into(rotation, positions[i], arm)
        _cross(omega, arm, swept)
        for k in range(3):
            position[k] += arm[k]
            velocity[k] += swept[k]
        for k in range(3):
            _into(rotation, rotations[i, :, k], fixed[:, k])
        angle = joints[i] - zeros[i]
        c, s = math.cos(angle), math.sin(angle)
        for k in range(3):
            axes[i, k] = fixed[k, 2]
            origins[i, k] = position[k]
            rotation[k, 0] = c * fixed[k, 0] + s * fixed[k, 1]
            rotation[k, 1] = c * fixed[k, 1] - s * fixed[k, 0]
            rotation[k, 2] = fixed[k, 2]
            omega[k] += rates[i] * fixed[k, 2]
        _into(rotation, coms[i], arm)
        for k in range(3):
            arm[k] += position[k]
        _add_body(masses[i], arm, position, velocity, omega, com_moment, com_rate)
        if i == 2:
            _into(rotation, heel[0], arm)
            _cross(omega, arm, swept)
            for k in range(3):
                rod_origin[k] = position[k] + arm[k]
                rod_velocity[k] = velocity[k] + swept[k]
        elif i == 5:
            _tarsus_bodies(
                rotation, position, velocity, omega, joints[6], rates[6], axes[5],
                heel, crank, rod_origin, rod_velocity, com_moment, com_rate,
            )  # fmt: skip
            springs[0] = joints[4]
            springs[1] = _heel_deflection(
                rotation, position, rod_origin, heel, axes, origins, heel_gradient
            )
    for k in range(3):
        ankle[k] = position[k]
    _into(rotation, sole, arm)
    _cross(omega, arm, swept)
    for k in range(3):
        foot[k] = position[k] + arm[k]
        foot_velocity[k] = velocity[k] + swept[k]
        for j in range(3):
            foot_rotation[k, j] = rotation[k, j]
    for i in range(7):
        for k in range(3):
            arm[k] = ankle[k] - origins[i, k]
        _cross(axes[i], arm, swept)
        for k in range(3):
            ankle_jacobian[k, i] = swept[k]


@njit(cache=True)
def _into(rotation, vector, out):  # type: ignore[no-untyped-def]
    for k in range(3):
        out[k] = (
            rotation[k, 0] * vector[0] + rotation[k, 1] * vector[1] + rotation[k, 2] * vector[2]
        )


@njit(cache=True)
def _tarsus_bodies(  # type: ignore[no-untyped-def]
    rotation, position, velocity, omega, toe, toe_rate, axis,
    heel, crank, rod_origin, rod_velocity, com_moment, com_rate,
):  # fmt: skip
    """Add foot crank, plantar rod and achilles rod to the sums."""
    arm = np.zeros(3)
    swept = np.zeros(3)
    origin = np.zeros(3)
    origin_velocity = np.zeros(3)
    turning = np.zeros(3)
    _into(rotation, crank[0], arm)
    _cross(omega, arm, swept)
    for k in range(3):
        origin[k] = position[k] + arm[k]
        origin_velocity[k] = velocity[k] + swept[k]
        turning[k] = omega[k] + toe_rate * axis[k]
    c, s = math.cos(toe), math.sin(toe)
    turned = np.zeros(3)
    point = np.zeros(3)
    # The crank turns with the foot.
    turned[0] = c * crank[1, 0] - s * crank[1, 1]
    turned[1] = s * crank[1, 0] + c * crank[1, 1]
    turned[2] = crank[1, 2]
    _into(rotation, turned, arm)
    for k in range(3):
        point[k] = origin[k] + arm[k]
    _add_body(crank[4, 0], point, origin, origin_velocity, turning, com_moment, com_rate)
    # Crank, rod, foot and tarsus form a parallelogram: the rod keeps the tarsus's attitude.
    turned[0] = c * crank[2, 0] - s * crank[2, 1]
    turned[1] = s * crank[2, 0] + c * crank[2, 1]
    turned[2] = crank[2, 2]
    _into(rotation, turned, arm)
    _cross(turning, arm, swept)
    for k in range(3):
        origin[k] += arm[k]
        origin_velocity[k] += swept[k]
    _into(rotation, crank[3], arm)
    for k in range(3):
        point[k] = origin[k] + arm[k]
    _add_body(crank[4, 1], point, origin, origin_velocity, omega, com_moment, com_rate)
    # The achilles rod's far end moves with the heel spring's tip, here at rest in the tarsus.
    _heel_tip(heel, 0.0, turned)
    _into(rotation, turned, arm)
    _cross(omega, arm, swept)
    mass, share = heel[6, 1], heel[6, 2]
    for k in range(3):
        tip = position[k] + arm[k]
        tip_velocity = velocity[k] + swept[k]
        com_moment[k] += mass * (rod_origin[k] + share * (tip - rod_origin[k]))
        com_rate[k] += mass * (rod_velocity[k] + share * (tip_velocity - rod_velocity[k]))


@njit(cache=True)
def _heel_tip(heel, angle, out):  # type: ignore[no-untyped-def]
    """Pin of the achilles rod in the tarsus frame at a deflection of the heel spring."""
    c, s = math.cos(angle), math.sin(angle)
    px, py, pz = heel[5, 0], heel[5, 1], heel[5, 2]
    for k in range(3):
        out[k] = (
            heel[1, k]
            + (c * px - s * py) * heel[2, k]
            + (s * px + c * py) * heel[3, k]
            + pz * heel[4, k]
        )


@njit(cache=True)
def _heel_deflection(  # type: ignore[no-untyped-def]
    rotation, position, rod_origin, heel, axes, origins, gradient
):
    """Heel spring's deflection from the rod's length, and its gradient by shin and tarsus."""
    local = np.zeros(3)
    for k in range(3):
        for j in range(3):
            local[k] += rotation[j, k] * (rod_origin[j] - position[j])
    d = heel[1] - local
    px, py, pz = heel[5, 0], heel[5, 1], heel[5, 2]
    a = b = dz = square = 0.0
    for k in range(3):
        a += d[k] * (px * heel[2, k] + py * heel[3, k])
        b += d[k] * (px * heel[3, k] - py * heel[2, k])
        dz += d[k] * heel[4, k]
        square += d[k] * d[k]
    length = heel[6, 0]
    c = 0.5 * (length * length - square - px * px - py * py - pz * pz) - pz * dz
    ratio = c / math.sqrt(a * a + b * b)
    ratio = max(-1.0, min(1.0, ratio))
    middle, half = math.atan2(b, a), math.acos(ratio)
    first = _wrapped(middle - half)
    second = _wrapped(middle + half)
    angle = first if abs(first) < abs(second) else second
    tip_local = np.zeros(3)
    tip = np.zeros(3)
    arm = np.zeros(3)
    swept = np.zeros(3)
    axis = np.zeros(3)
    spring = np.zeros(3)
    _heel_tip(heel, angle, tip_local)
    _into(rotation, tip_local, arm)
    for k in range(3):
        tip[k] = position[k] + arm[k]
    _into(rotation, heel[4], axis)
    _into(rotation, heel[1], spring)
    rod = tip - rod_origin
    for k in range(3):
        arm[k] = tip[k] - position[k] - spring[k]
    _cross(axis, arm, swept)
    along = rod[0] * swept[0] + rod[1] * swept[1] + rod[2] * swept[2]
    for i in range(2):
        for k in range(3):
            arm[k] = tip[k] - origins[4 + i, k]
        _cross(axes[4 + i], arm, swept)
        gradient[i] = -(rod[0] * swept[0] + rod[1] * swept[1] + rod[2] * swept[2]) / along
    return angle


@njit(cache=True)
def _spring_force(jacobian, springs, gradient, toe_torque):  # type: ignore[no-untyped-def]
    shin = SHIN_STIFFNESS * springs[0] + HEEL_STIFFNESS * springs[1] * gradient[0] + toe_torque
    tarsus = HEEL_STIFFNESS * springs[1] * gradient[1] + toe_torque
    aa = ab = bb = 0.0
    for k in range(3):
        aa += jacobian[k, 4] * jacobian[k, 4]
        ab += jacobian[k, 4] * jacobian[k, 5]
        bb += jacobian[k, 5] * jacobian[k, 5]
    determinant = aa * bb - ab * ab
    if determinant < 1e-9:
        return 0.0, 0.0, 0.0
    x = (bb * shin - ab * tarsus) / determinant
    y = (aa * tarsus - ab * shin) / determinant
    return (
        jacobian[0, 4] * x + jacobian[0, 5] * y,
        jacobian[1, 4] * x + jacobian[1, 5] * y,
        jacobian[2, 4] * x + jacobian[2, 5] * y,
    )
