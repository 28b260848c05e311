"""Recursive Newton-Euler from the right foot up to the pelvis and down to the left foot, symbolic.

Each quantity of a body is in the body's own frame. `rods` gives the motion of heel springs and foot
cranks; their torques add to those of knee and toe by virtual work. Gravity enters as an upward
acceleration of the ground.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from cassie_gaits import robot
from cassie_gaits.optimize import bodies, rods
from cassie_gaits.optimize.bodies import BRANCHES, CHAIN, Body, Hinge

RIGID_JOINTS = ("hip_roll", "hip_yaw", "hip_pitch", "knee", "toe")

Motion = dict[str, tuple[ca.SX, ca.SX, ca.SX]]
"""Angle, rate and acceleration of each hinge of a leg."""


@dataclass
class State:
    """A body in the recursion: rates, accelerations, and the force that its subtree needs."""

    omega: ca.SX
    alpha: ca.SX
    accel: ca.SX
    force: ca.SX = field(default_factory=lambda: ca.SX.zeros(3))
    moment: ca.SX = field(default_factory=lambda: ca.SX.zeros(3))

    def point(self, position: ca.DM | ca.SX) -> ca.SX:
        """Acceleration of a point of the body."""
        swing = ca.cross(self.omega, ca.cross(self.omega, position))
        return self.accel + ca.cross(self.alpha, position) + swing

    def push(self, position: ca.DM | ca.SX, force: ca.SX) -> None:
        """Add a force that the body needs at a point."""
        self.force += force
        self.moment += ca.cross(position, force)


@dataclass(frozen=True)
class Efforts:
    """Torques and ground reaction of a motion.

    Attributes:
        stance, swing: Torques of `RIGID_JOINTS`. Shape (5, 1), in Nm.
        force: Ground force on the stance foot, in the toe link's frame. Shape (3, 1), in N.
        moment: Ground moment about the sole's middle, in the toe link's frame. In Nm.
    """

    stance: ca.SX
    swing: ca.SX
    force: ca.SX
    moment: ca.SX


def leg_motion(q: ca.SX, v: ca.SX, a: ca.SX) -> tuple[Motion, dict[str, ca.SX]]:
    """Motion of every hinge of a leg from its five joints, and derivatives of the rods' hinges.

    Args:
        q, v, a: Angles, rates and accelerations of `RIGID_JOINTS`. Shape (5, 1).
    """
    motion = {name: (q[i], v[i], a[i]) for i, name in enumerate(RIGID_JOINTS)}
    knee, toe = RIGID_JOINTS.index("knee"), RIGID_JOINTS.index("toe")
    motion["tarsus"] = (robot.NEUTRAL_TARSUS - q[knee], -v[knee], -a[knee])
    slopes = {}
    curves: tuple[tuple[str, int, Callable[[ca.SX], ca.SX]], ...] = (
        ("heel_spring", knee, rods.heel_angle),
        ("foot_crank", toe, rods.crank_angle),
    )
    for name, joint, curve in curves:
        x = ca.SX.sym("x")
        angle = curve(x)
        slope = ca.gradient(angle, x)
        bend = ca.gradient(slope, x)
        angle, slope, bend = ca.substitute([angle, slope, bend], [x], [q[joint]])
        motion[name] = (angle, slope * v[joint], slope * a[joint] + bend * v[joint] ** 2)
        slopes[name] = slope
    return motion, slopes


@dataclass(frozen=True)
class SymbolicBody:
    """A body as `bodies.Body`, with symbols."""

    mass: ca.SX
    com: ca.SX
    inertia: ca.SX


class Recursion:
    """One pass over the robot: construct it and call `run` once.

    Args:
        asymmetry: Factor on the pelvis's asymmetry: 1 the real one, 0 none, -1 its mirror image.
        payload: Additional mass at the pelvis's centre of mass. In kg.
    """

    def __init__(self, asymmetry: ca.SX, payload: ca.SX) -> None:
        self._legs = {"right": bodies.leg("right"), "left": bodies.leg("left")}
        self._pelvis = _pelvis(asymmetry, payload)
        self._states: dict[tuple[str, str], State] = {}
        self._motion: dict[str, Motion] = {}

    def run(
        self, root: State, stance: tuple[ca.SX, ca.SX, ca.SX], swing: tuple[ca.SX, ca.SX, ca.SX]
    ) -> Efforts:
        """Torques and ground reaction for a motion.

        Args:
            root: Rates and accelerations of the right toe link at the toe joint.
            stance, swing: Angles, rates, accelerations of `RIGID_JOINTS` of the right, left leg.
        """
        slopes = {}
        for leg, joints in (("right", stance), ("left", swing)):
            self._motion[leg], slopes[leg] = leg_motion(*joints)
        self._states["right", "toe"] = root
        self._spread()
        for leg in self._legs:
            for rod in self._legs[leg].rods:
                self._add_rod(leg, rod)
        spins = {leg: self._add_spin(leg) for leg in self._legs}
        torques = self._collect()
        for leg, knee in spins.items():
            torques[leg, "knee"] += knee
        sole = ca.DM(self._legs["right"].sole)
        force = root.force
        moment = root.moment - ca.cross(sole, force)
        return Efforts(
            self._project("right", torques, slopes["right"]),
            self._project("left", torques, slopes["left"]),
            force,
            moment,
        )

    def _hinge(self, leg: str, name: str) -> tuple[Hinge, ca.SX, ca.SX, ca.SX]:
        """The hinge, its child's rotation in its parent, rate and acceleration."""
        hinge = self._legs[leg].hinges[name]
        angle, rate, accel = self._motion[leg][name]
        turn = ca.mtimes(ca.DM(hinge.rotation), rods.about_z(angle - hinge.zero))
        return hinge, turn, rate, accel

    def _spread(self) -> None:
        """Propagate rates and accelerations outward from the right foot."""
        above = dict(zip(CHAIN, ("pelvis", *CHAIN), strict=False))
        for name in reversed(CHAIN):
            self._climb(name, above[name])
        for name in CHAIN:
            self._descend("left", name, above[name])
        for leg in self._legs:
            for name in BRANCHES:
                self._descend(leg, name, "tarsus")

    def _climb(self, child: str, parent: str) -> None:
        """Propagate from a link of the right leg to its parent in the robot table."""
        hinge, turn, rate, accel = self._hinge("right", child)
        below = self._states["right", child]
        spin = ca.vertcat(0.0, 0.0, rate)
        omega = ca.mtimes(turn, below.omega - spin)
        alpha = ca.mtimes(
            turn, below.alpha - ca.vertcat(0.0, 0.0, accel) - ca.cross(below.omega, spin)
        )
        state = State(omega, alpha, ca.mtimes(turn, below.accel))
        state.accel = state.point(ca.DM(-hinge.position))
        self._states[_key("right", parent)] = state

    def _descend(self, leg: str, child: str, parent: str) -> None:
        hinge, turn, rate, accel = self._hinge(leg, child)
        above = self._states[_key(leg, parent)]
        spin = ca.vertcat(0.0, 0.0, rate)
        omega = ca.mtimes(turn.T, above.omega)
        alpha = ca.mtimes(turn.T, above.alpha) + ca.vertcat(0.0, 0.0, accel) + ca.cross(omega, spin)
        position = ca.mtimes(turn.T, above.point(ca.DM(hinge.position)))
        self._states[leg, child] = State(omega + spin, alpha, position)

    def _add_rod(self, leg: str, rod: bodies.TwoPointRod) -> None:
        base, tip = self._states[leg, rod.base_body], self._states[leg, rod.tip_body]
        turn = self._between(leg, rod.base_body, rod.tip_body)
        at_base, at_tip = base.point(ca.DM(rod.base)), tip.point(ca.DM(rod.tip))
        base.push(
            ca.DM(rod.base), rod.base_mass * at_base + rod.shared_mass * ca.mtimes(turn, at_tip)
        )
        tip.push(
            ca.DM(rod.tip), rod.tip_mass * at_tip + rod.shared_mass * ca.mtimes(turn.T, at_base)
        )

    def _add_spin(self, leg: str) -> ca.SX:
        """Add the achilles rod's inertia about its length; returns its torque at the knee. In Nm.

        The rod does not spin on its ball joint: its rate along itself is that of the hip pitch
        link.
        """
        angle, rate, _ = self._motion[leg]["knee"]
        inertia, hip = self._legs[leg].achilles_spin, self._states[leg, "hip_pitch"]
        x = ca.SX.sym("x")
        side = ca.DM([1.0, 1.0, -1.0 if leg == "right" else 1.0])
        along = side * rods.achilles_direction(x)
        along, change = ca.substitute([along, ca.jacobian(along, x)], [x], [angle])
        spin = ca.dot(hip.omega, along)
        growth = ca.dot(hip.alpha, along) + ca.dot(hip.omega, change) * rate
        turn = ca.cross(hip.omega, along) + change * rate
        hip.moment += inertia * (growth * along + spin * turn)
        return -inertia * spin * ca.dot(hip.omega, change)

    def _between(self, leg: str, base: str, tip: str) -> ca.SX:
        """Rotation of the body `tip` in the body `base`, along the chain between them."""
        if base == "foot_crank":
            return ca.mtimes(self._hinge(leg, base)[1].T, self._hinge(leg, tip)[1])
        turn = ca.mtimes(self._hinge(leg, "knee")[1], self._hinge(leg, "tarsus")[1])
        return ca.mtimes(turn, self._hinge(leg, tip)[1])

    def _collect(self) -> dict[tuple[str, str], ca.SX]:
        """Torque of every hinge, from the outermost bodies inward."""
        for (leg, name), state in self._states.items():
            _load(state, self._pelvis if name == "pelvis" else self._legs[leg].bodies[name])
        torques: dict[tuple[str, str], ca.SX] = {}
        above = dict(zip(CHAIN, ("pelvis", *CHAIN), strict=False))
        order = [(leg, name, "tarsus") for leg in self._legs for name in BRANCHES]
        order += [("left", name, above[name]) for name in reversed(CHAIN)]
        for leg, child, parent in order:
            hinge, turn, _, accel = self._hinge(leg, child)
            state, carrier = self._states[leg, child], self._states[_key(leg, parent)]
            torques[leg, child] = state.moment[2] + hinge.armature * accel
            carrier.push(ca.DM(hinge.position), ca.mtimes(turn, state.force))
            carrier.moment += ca.mtimes(turn, state.moment)
        for child in CHAIN:
            hinge, turn, _, accel = self._hinge("right", child)
            state, carrier = self._states["right", child], self._states[_key("right", above[child])]
            moment = carrier.moment - ca.cross(ca.DM(hinge.position), carrier.force)
            moment = ca.mtimes(turn.T, moment)
            torques["right", child] = -moment[2] + hinge.armature * accel
            state.force += ca.mtimes(turn.T, carrier.force)
            state.moment += moment
        return torques

    @staticmethod
    def _project(
        leg: str, torques: dict[tuple[str, str], ca.SX], slopes: dict[str, ca.SX]
    ) -> ca.SX:
        """Torques of the drives; torques of the rods' hinges add to those of knee and toe."""
        by_joint = {name: torques[leg, name] for name in RIGID_JOINTS}
        by_joint["knee"] += slopes["heel_spring"] * torques[leg, "heel_spring"]
        by_joint["knee"] -= torques[leg, "tarsus"]
        by_joint["toe"] += slopes["foot_crank"] * torques[leg, "foot_crank"]
        return ca.vertcat(*(by_joint[name] for name in RIGID_JOINTS))


def _key(leg: str, name: str) -> tuple[str, str]:
    return ("", "pelvis") if name == "pelvis" else (leg, name)


def _load(state: State, body: Body | SymbolicBody) -> None:
    """Add the force and moment that a body's own inertia needs."""
    com, inertia = ca.SX(body.com), ca.SX(body.inertia)
    push = body.mass * state.point(com)
    turn = ca.mtimes(inertia, state.alpha) + ca.cross(state.omega, ca.mtimes(inertia, state.omega))
    state.push(com, push)
    state.moment += turn


def _pelvis(asymmetry: ca.SX, payload: ca.SX) -> SymbolicBody:
    """The pelvis with scaled asymmetry and with its payload."""
    body = bodies.pelvis()
    com, inertia = ca.SX(ca.DM(body.com)), ca.SX(ca.DM(body.inertia))
    com[1] *= asymmetry
    for i, j in ((0, 1), (1, 2)):
        inertia[i, j] *= asymmetry
        inertia[j, i] = inertia[i, j]
    return SymbolicBody(body.mass + payload, com, inertia)


def foot_frame() -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Rotation from level foot (ahead, left, up) to toe link: v_toe = result @ v_foot. (3, 3)."""
    bend = np.radians(50.0) - bodies.foot_tilt()
    c, s = np.cos(bend), np.sin(bend)
    pitch = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    hip = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])
    result: np.ndarray[tuple[int, ...], np.dtype[np.float64]] = (pitch @ hip).T
    return result
