"""A leg with deflected springs: its parameters, its kinematics and the force from its springs.

Everything is in the pelvis frame. The chain is hip_roll, hip_yaw, hip_pitch, knee, shin, tarsus,
toe; the heel spring's deflection follows from the achilles rod (`linkage`). Records are C
structures of floats: as an argument of a compiled function, a record costs no more than an array.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np

from cassie_gaits import robot, virtual_leg
from cassie_gaits.compiled import compiled
from cassie_gaits.linkage import (
    HeelLoop,
    heel_deflection,
    heel_loop,
    link_rotation,
    pin_in_target,
)
from cassie_gaits.names import LEG_JOINTS, LEGS
from cassie_gaits.records import FloatArray, Record, Records, array, part
from cassie_gaits.vectors import Vector, VectorLike, cross, dot, minus, plus, times


class Leg(Record):
    """Parameters of one leg, hip_roll to toe.

    Attributes:
        positions: Position of each link's frame in its parent's frame. In m.
        rotations: Rotations of these frames, with the joints at their zeros; columns are axes.
        zeros: Zeros of the joints. In rad.
        masses: Masses of the links with all parts that move with them. In kg.
        moments: Mass times centre of mass in the link's frame. In kg m.
        heel_moment_gradient: Derivative of the tarsus's moment with respect to the heel spring's
            angle. In kg m.
        sole: Middle of the sole's centre line in the toe link. In m.
        shin_stiffness, heel_stiffness: Stiffness of the leaf springs. In Nm/rad.
    """

    positions: FloatArray = array(7, 3)
    rotations: FloatArray = array(7, 3, 3)
    zeros: FloatArray = array(7)
    masses: FloatArray = array(7)
    moments: FloatArray = array(7, 3)
    heel_moment_gradient: FloatArray = array(3)
    sole: FloatArray = array(3)
    shin_stiffness: float
    heel_stiffness: float


class LegState(Record):
    """Kinematics of one leg.

    Attributes:
        axes: Axes of the joints.
        origins: Origins of the links, on the joint axes. In m.
        foot: Middle of the sole's centre line. In m.
        foot_velocity: Velocity of `foot` relative to the pelvis. In m/s.
        foot_rotation: Rotation from toe link to pelvis.
        toe_joint: Position of the toe joint. In m.
        toe_jacobian: Jacobian of the toe joint's position with respect to the joints. In m/rad.
        com_moment: Sum of mass times position over the leg's links. In kg m.
        com_rate: Rate of change of `com_moment` relative to the pelvis. In kg m/s.
        springs: Deflection of shin and heel spring. The heel's is 0 where the achilles rod does not
            reach, which does not happen for true angles. In rad.
        heel_gradient: Derivatives of the heel spring's deflection by shin and tarsus.
        lower_leg: Derivatives by shin and tarsus of the sum of mass times position below the
            springs, while the foot keeps its attitude. In kg m/rad.
    """

    axes: FloatArray = array(7, 3)
    origins: FloatArray = array(7, 3)
    foot: FloatArray = array(3)
    foot_velocity: FloatArray = array(3)
    foot_rotation: FloatArray = array(3, 3)
    toe_joint: FloatArray = array(3)
    toe_jacobian: FloatArray = array(3, 7)
    com_moment: FloatArray = array(3)
    com_rate: FloatArray = array(3)
    springs: FloatArray = array(2)
    heel_gradient: FloatArray = array(2)
    lower_leg: FloatArray = array(2, 3)


class Chain(Protocol):
    """The fields of a record of links that `next_link` reads, see `Leg`."""

    positions: FloatArray
    rotations: FloatArray
    zeros: FloatArray


Axes = tuple[Vector, Vector, Vector]
Motion = tuple[Axes, Vector, Vector, Vector]
"""Motion of a link: axes, origin (m), velocity of the origin (m/s), angular velocity (rad/s)."""

UPRIGHT = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
"""Axes of the pelvis."""

ZERO = (0.0, 0.0, 0.0)

_ITERATIONS = 25  # of `bent_leg`, each of which leaves at most 0.6 of the error


@compiled
def into(axes: Axes, v: VectorLike) -> Vector:
    """A vector in the pelvis frame, from its components in another frame."""
    x, y, z = axes
    return (
        x[0] * v[0] + y[0] * v[1] + z[0] * v[2],
        x[1] * v[0] + y[1] * v[1] + z[1] * v[2],
        x[2] * v[0] + y[2] * v[1] + z[2] * v[2],
    )


@compiled
def _store(vector: Vector, out: FloatArray) -> None:
    out[0], out[1], out[2] = vector


@compiled
def next_link(motion: Motion, leg: Chain, i: int, joint: float, rate: float) -> Motion:
    """Motion of a link, from the motion of its parent.

    Args:
        motion: Motion of the parent.
        leg: Positions and rotations of the links' frames, and zeros of the joints.
        i: Index of the link.
        joint: Angle of its joint. In rad.
        rate: Rate of its joint. In rad/s.
    """
    axes, origin, velocity, omega = motion
    arm, fixed = into(axes, leg.positions[i]), leg.rotations[i]
    x, y = into(axes, fixed[:, 0]), into(axes, fixed[:, 1])
    z = into(axes, fixed[:, 2])
    c, s = math.cos(joint - leg.zeros[i]), math.sin(joint - leg.zeros[i])
    turned = (plus(times(c, x), times(s, y)), minus(times(c, y), times(s, x)), z)
    velocity = plus(velocity, cross(omega, arm))
    return turned, plus(origin, arm), velocity, plus(omega, times(rate, z))


@compiled
def leg_kinematics(
    joints: FloatArray,
    rates: FloatArray,
    leg: Leg,
    loop: HeelLoop,
    state: LegState,
) -> None:
    """Compute the kinematics of a leg.

    Args:
        joints: Joint angles. Shape (7,), in rad.
        rates: Joint rates. Shape (7,), in rad/s.
        leg: Parameters of the leg.
        loop: Geometry of the achilles rod.
        state: Result.
    """
    motion = (UPRIGHT, ZERO, ZERO, ZERO)
    moment, rate = ZERO, ZERO
    shin = tarsus = by_heel = ZERO
    for i in range(7):
        motion = next_link(motion, leg, i, joints[i], rates[i])
        axes, origin, velocity, omega = motion
        _store(axes[2], state.axes[i])
        _store(origin, state.origins[i])
        own = into(axes, leg.moments[i])
        moment = plus(moment, plus(times(leg.masses[i], origin), own))
        rate = plus(rate, plus(times(leg.masses[i], velocity), cross(omega, own)))
        if i == 4:
            shin = own
        elif i == 5:
            tarsus, by_heel = own, into(axes, leg.heel_moment_gradient)
    _store(moment, state.com_moment)
    _store(rate, state.com_rate)
    _place_foot(motion, leg, state)
    axes, _, velocity, omega = motion
    _store(plus(velocity, cross(omega, into(axes, leg.sole))), state.foot_velocity)
    _deflect_springs(joints, loop, state)
    _store_lower_leg_gradients(shin, tarsus, by_heel, leg, state)


@compiled
def _place_foot(motion: Motion, leg: Leg, state: LegState) -> None:
    axes, origin, _, _ = motion
    _store(origin, state.toe_joint)
    _store(plus(origin, into(axes, leg.sole)), state.foot)
    for k in range(3):
        _store(axes[k], state.foot_rotation[:, k])
    for i in range(7):
        arm = minus(origin, state.origins[i])
        _store(cross(state.axes[i], arm), state.toe_jacobian[:, i])


@compiled
def _deflect_springs(joints: FloatArray, loop: HeelLoop, state: LegState) -> None:
    heel, _, by_shin, by_tarsus = heel_deflection(joints[3], joints[4], joints[5], loop)
    if not math.isfinite(heel):
        heel = by_shin = by_tarsus = 0.0
    state.springs[0], state.springs[1] = joints[4], heel
    state.heel_gradient[0], state.heel_gradient[1] = by_shin, by_tarsus


@compiled
def _store_lower_leg_gradients(
    shin: Vector, tarsus: Vector, by_heel: Vector, leg: Leg, state: LegState
) -> None:
    """Write `LegState.lower_leg`; the foot counts as a mass at the toe joint.

    Args:
        shin, tarsus: Moments of these links about their own origins, pelvis frame. In kg m.
        by_heel: `Leg.heel_moment_gradient` in the pelvis frame.
        leg: Parameters of the leg.
        state: Result; has the origins, the axes and the heel spring's derivatives.
    """
    span = minus(state.origins[6], state.origins[5])
    about_tarsus = plus(tarsus, times(leg.masses[6], span))
    span = minus(state.origins[5], state.origins[4])
    carried = plus(about_tarsus, times(leg.masses[5] + leg.masses[6], span))
    about_shin = plus(shin, carried)
    turning = cross(state.axes[4], about_shin)
    _store(plus(turning, times(state.heel_gradient[0], by_heel)), state.lower_leg[0])
    turning = cross(state.axes[5], about_tarsus)
    _store(plus(turning, times(state.heel_gradient[1], by_heel)), state.lower_leg[1])


@compiled
def spring_force(leg: Leg, state: LegState, toe_torque: float, up: VectorLike) -> Vector:
    """Ground force on the foot in the leg's plane, from the springs.

    The springs balance the ground force and the weight below them in a virtual motion of shin and
    tarsus in which the foot keeps its attitude:

        J_i F = dV/dq_i + g up . d(sum of m p)/dq_i + u_toe,   i = shin, tarsus,
        V = 1/2 k_shin q5^2 + 1/2 k_heel heel(q4, q5, q6)^2

    J is the Jacobian of the toe joint. The toe drive balances the ground's moment about the toe
    joint and the foot's weight: the foot counts as a mass at the toe joint. Inertia is neglected,
    so that a swinging leg shows some force, too.

    Args:
        leg: Parameters of the leg.
        state: Kinematics of the leg.
        toe_torque: Torque of the toe drive at the joint. In Nm.
        up: Unit vector against gravity in the pelvis frame. Shape (3,).

    Returns:
        Force in the pelvis frame, in N. Zero where the achilles rod does not reach, and where shin
        and tarsus are in line, so that they do not determine the force.

    Source:
        The paper detects contact by the springs' deflection without a formula; its heel
        deflection q4 + q5 + q6 - 13 degrees (eq:SpringJacobian) is not used: see `heel_deflection`.
    """
    heel = leg.heel_stiffness * state.springs[1]
    shin = leg.shin_stiffness * state.springs[0] + heel * state.heel_gradient[0]
    shin += toe_torque + robot.GRAVITY * dot(up, state.lower_leg[0])
    tarsus = heel * state.heel_gradient[1] + toe_torque
    tarsus += robot.GRAVITY * dot(up, state.lower_leg[1])
    by_shin, by_tarsus = state.toe_jacobian[:, 4], state.toe_jacobian[:, 5]
    aa, ab = dot(by_shin, by_shin), dot(by_shin, by_tarsus)
    bb = dot(by_tarsus, by_tarsus)
    determinant = aa * bb - ab * ab
    if determinant < 1e-6 or state.heel_gradient[1] == 0.0:
        return ZERO
    x = (bb * shin - ab * tarsus) / determinant
    y = (aa * tarsus - ab * shin) / determinant
    return plus(times(x, by_shin), times(y, by_tarsus))


def bent_leg(length: float, force: float) -> FloatArray:
    """Joints of a leg that a force presses to a length: the inverse of `spring_force`.

    Args:
        length: Distance from hip pitch axis to toe joint. In m.
        force: Ground force at the toe joint, towards the hip. In N.

    Returns:
        Knee, shin and tarsus at which the springs balance the force and the weight of the leg
        below them, with a free toe drive; the other joints are 0. Shape (7,), in rad.
    """
    pair = LegPair()
    leg, state = pair.legs[0], pair.states[0]
    joints, still = np.zeros(7), np.zeros(7)
    rigid, shin, tarsus = length, 0.0, 0.0
    for _ in range(_ITERATIONS):
        knee = virtual_leg.knee_angle(rigid)
        joints[3:6] = knee, shin, robot.NEUTRAL_TARSUS - knee + tarsus
        leg_kinematics(joints, still, leg, pair.loop, state)
        towards_hip = state.origins[2] - state.toe_joint
        present = math.sqrt(dot(towards_hip, towards_hip))
        rigid += length - present
        up = towards_hip / present
        by_shin, by_tarsus = state.heel_gradient
        on_shin, on_tarsus = (
            force * dot(up, state.toe_jacobian[:, joint])
            - robot.GRAVITY * dot(up, state.lower_leg[joint - 4])
            for joint in (4, 5)
        )
        heel = on_tarsus / by_tarsus
        shin = (on_shin - heel * by_shin) / leg.shin_stiffness
        bend = heel / leg.heel_stiffness - state.springs[1]
        tarsus += (bend - by_shin * (shin - joints[4])) / by_tarsus
    return joints


def leg_shortening(length: float, force: float) -> float:
    """How much longer a leg would be without its springs' deflection; see `bent_leg`. In m."""
    return virtual_leg.length(float(bent_leg(length, force)[3])) - length


@compiled
def both_legs(
    joints: FloatArray,
    rates: FloatArray,
    toe_torques: FloatArray,
    up: VectorLike,
    pair: LegPair,
) -> None:
    """Compute kinematics and spring force (see `spring_force`) of both legs.

    Args:
        joints: Joint angles. Shape (2, 7), in rad.
        rates: Joint rates. Shape (2, 7), in rad/s.
        toe_torques: Torques of the two toe drives at the joint. Shape (2,), in Nm.
        up: Unit vector against gravity in the pelvis frame. Shape (3,).
        pair: Both legs; gets states and forces.
    """
    for i in range(2):
        leg, state = pair.legs[i], pair.states[i]
        leg_kinematics(joints[i], rates[i], leg, pair.loop, state)
        pair.forces[i] = dot(up, spring_force(leg, state, toe_torques[i], up))


@compiled
def place_legs(joints: FloatArray, pair: LegPair) -> None:
    """Compute the pose of both legs alone, without velocities, masses and springs.

    Args:
        joints: Joint angles. Shape (2, 7), in rad.
        pair: Both legs; gets `axes`, `origins`, `foot`, `foot_rotation`, `toe_joint` and
            `toe_jacobian`.
    """
    for i in range(2):
        leg, state = pair.legs[i], pair.states[i]
        motion = (UPRIGHT, ZERO, ZERO, ZERO)
        for k in range(7):
            motion = next_link(motion, leg, k, joints[i, k], 0.0)
            _store(motion[0][2], state.axes[k])
            _store(motion[1], state.origins[k])
        _place_foot(motion, leg, state)


class LegPair(Record):
    """Both legs.

    Attributes:
        legs: Parameters of left and right leg.
        loop: Achilles rod, the same for both legs.
        states: Kinematics of both legs.
        forces: Ground force on each foot, its component against gravity. In N.
    """

    legs: Records[Leg] = part(Leg, 2)
    loop: HeelLoop = part(HeelLoop)
    states: Records[LegState] = part(LegState, 2)
    forces: FloatArray = array(2)

    def __init__(self) -> None:
        super().__init__()
        self.records["legs"][0] = np.concatenate([_leg(name).records for name in LEGS])
        self.records["loop"] = heel_loop().records


def _leg(name: str) -> Leg:
    """The parameters of a leg.

    Parts attached to a link count with it. The heel spring deflects by a few degrees only and
    counts as fixed to the tarsus. The achilles rod is a mass at each of its ends. Foot crank,
    plantar rod, foot and tarsus are a parallelogram: the crank turns with the foot, the rod does
    not.
    """
    links = {link.name: link for link in robot.leg_links(name)}
    leg = Leg()
    for i, joint in enumerate(LEG_JOINTS):
        link = links[joint]
        leg.positions[i] = link.position
        leg.rotations[i] = link_rotation(link)
        leg.zeros[i] = link.joint.zero
        _add_mass(leg, joint, link.mass, np.array(link.com))
    _add_fixed(leg, "knee", links["knee_spring"])
    _add_fixed(leg, "tarsus", links["heel_spring"])
    _add_achilles_rod(leg, links, mirrored=name == "right")
    crank, rod = links["foot_crank"], links["plantar_rod"]
    _add_mass(leg, "tarsus", crank.mass, np.array(crank.position))
    _add_mass(leg, "tarsus", rod.mass, np.add(crank.position, rod.com))
    turning = crank.mass * np.array(crank.com) + rod.mass * np.array(rod.position)
    leg.moments[LEG_JOINTS.index("toe")] += turning
    leg.sole = np.mean(np.array(robot.FOOT_CONTACTS), axis=0)
    leg.shin_stiffness = links["shin"].joint.stiffness
    leg.heel_stiffness = links["heel_spring"].joint.stiffness
    return leg


def _add_mass(leg: Leg, joint: str, mass: float, position: FloatArray) -> None:
    i = LEG_JOINTS.index(joint)
    leg.masses[i] += mass
    leg.moments[i] += mass * position


def _add_fixed(leg: Leg, joint: str, link: robot.Link) -> None:
    _add_mass(leg, joint, link.mass, link.position + link_rotation(link) @ link.com)


def _add_achilles_rod(leg: Leg, links: dict[str, robot.Link], *, mirrored: bool) -> None:
    rod, heel = links["achilles_rod"], links["heel_spring"]
    closure = next(closure for closure in robot.RODS if closure.rod == rod.name)
    pin = pin_in_target(closure) * (1.0, 1.0, -1.0 if mirrored else 1.0)
    axes, far = link_rotation(heel), rod.mass * rod.com[0] / closure.length
    _add_mass(leg, "hip_pitch", rod.mass - far, np.array(rod.position))
    _add_mass(leg, "tarsus", far, heel.position + axes @ pin)
    heel_moment = axes @ (far * pin + heel.mass * np.array(heel.com))
    leg.heel_moment_gradient = np.cross(axes[:, 2], heel_moment)
