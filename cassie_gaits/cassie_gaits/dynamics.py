"""Cassie's dynamics in the 20 coordinates of eq:qdef, with the rods' loops closed exactly.

    D(q) q'' + H(q, q') = B u + tau_sp(q) + J(q)^T lambda                 (eq:FloatingBaseModel)

Rods, heel springs and foot cranks move as functions of the 20 coordinates; their masses and the
rotors' reflected inertias are all in D and H. The leaf springs are coordinates here (q5, and q6
through the heel spring); the model with rigid springs is the projection by `RIGID`. Joint
damping is not part of H. An achilles rod does not spin about itself.

This module is for gait design, tests and feed-forward tables: a call takes up to a millisecond. The
computations for every control tick are in `leg`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from cassie_gaits import linkage, robot
from cassie_gaits.errors import KinematicsError
from cassie_gaits.names import BASE_COORDINATES, COORDINATES, DRIVE_IN_Q, LEGS
from cassie_gaits.pinocchio_model import BASE_SIZE, Loop, build_tree
from cassie_gaits.records import FloatArray

SIZE = len(COORDINATES)


def _stiffness(name: str) -> float:
    return next(link.joint.stiffness for link in robot.LEFT_LEG if link.name == name)


def _index(leg: str, joint: str) -> int:
    return COORDINATES.index(f"{leg}_{joint}")


def _rigid_projection() -> FloatArray:
    free = [*range(len(BASE_COORDINATES)), *DRIVE_IN_Q]
    projection = np.zeros((SIZE, len(free)))
    projection[free, range(len(free))] = 1.0
    for leg in LEGS:
        knee = free.index(_index(leg, "knee"))
        projection[_index(leg, "tarsus"), knee] = -1.0
    return projection


def _input_matrix() -> FloatArray:
    matrix = np.zeros((SIZE, len(DRIVE_IN_Q)))
    matrix[list(DRIVE_IN_Q), range(len(DRIVE_IN_Q))] = 1.0
    return matrix


RIGID = _rigid_projection()
"""Velocities of 20 coordinates from those of pelvis and drives, with rigid springs. (20, 16)."""

INPUT = _input_matrix()
"""B of eq:FloatingBaseModel: drive torques, in the order of `names.DRIVES`, to q. (20, 10)."""


def rigid_pose(base: npt.ArrayLike, drives: npt.ArrayLike) -> FloatArray:
    """Coordinates with relaxed springs: q5 = 0, q6 = 13 degrees - q4.

    Args:
        base: x, y, z, yaw, pitch, roll. Shape (6,), in m and rad.
        drives: Positions in the order of `names.DRIVES`. Shape (10,), in rad.

    Returns:
        q. Shape (20,).

    Source:
        eq:SpringRelaxed. With the real rods the heel spring's deflection there is not quite
        zero but -0.017 to 0.007 rad, depending on the knee.
    """
    q = np.zeros(SIZE)
    q[:BASE_SIZE] = base
    q[list(DRIVE_IN_Q)] = drives
    for leg in LEGS:
        q[_index(leg, "tarsus")] = robot.NEUTRAL_TARSUS - q[_index(leg, "knee")]
    return q


@dataclass(frozen=True, eq=False)
class Terms:
    """Terms of the equation of motion at one state.

    Attributes:
        mass: D. Shape (20, 20).
        bias: H. Shape (20,), in N and Nm.
        soles: Jacobians as in `Dynamics.sole_jacobian`, left and right. Shape (2, 6, 20).
        sole_drifts: Accelerations of the soles when v' = 0. Shape (2, 6), in m/s^2, rad/s^2.
    """

    mass: FloatArray
    bias: FloatArray
    soles: FloatArray
    sole_drifts: FloatArray


class Dynamics:
    """Mass matrix, bias forces, feet and centre of mass in the paper's coordinates.

    Every method takes q of shape (20,) in m and rad, and where needed v, its time derivative, and
    raises KinematicsError if they have another shape or are not finite, or if a rod does not
    reach. Legs are "left" and "right". Vectors are in world axes.
    """

    def __init__(self, gravity: float = 9.81, pelvis: robot.Link = robot.PELVIS) -> None:
        """Build the model.

        Args:
            gravity: Gravity. In m/s^2.
            pelvis: Link of the pelvis, such as a symmetric one.
        """
        self._tree = build_tree(gravity, pelvis)
        self._model: Any = self._tree.model
        self._data: Any = self._model.createData()

    @property
    def mass(self) -> float:
        """Mass of the whole robot. In kg."""
        return float(pin.computeTotalMass(self._model))

    def configuration(self, q: npt.ArrayLike) -> FloatArray:
        """Configuration of the tree with closed loops, from q. Shape (34,)."""
        q = _checked(q, "q")
        tree = self._tree
        full: FloatArray = pin.neutral(self._model)
        full[tree.joints_q] = q - tree.zeros
        for i, leg in enumerate(LEGS):
            knee, shin, tarsus, toe = (
                float(q[_index(leg, joint)]) for joint in ("knee", "shin", "tarsus", "toe")
            )
            full[tree.heels_q[i]] = linkage.heel_angle(knee, shin, tarsus)
            full[tree.cranks_q[i] : tree.cranks_q[i] + 2] = linkage.crank_angles(toe)
            w, *turn = linkage.achilles_turn(leg, knee, shin, tarsus)
            full[tree.balls_q[i] : tree.balls_q[i] + 4] = (*turn, w)
        return full

    def embedding(self, q: npt.ArrayLike) -> FloatArray:
        """Jacobian of the closed loops, from v to the tree's velocity. Shape (32, 20)."""
        return self._embed(self.configuration(q))

    def mass_matrix(self, q: npt.ArrayLike) -> FloatArray:
        """D(q) with the rotors' inertias. Shape (20, 20)."""
        full = self.configuration(q)
        return self._mass_matrix(full, self._embed(full))

    def gravity(self, q: npt.ArrayLike) -> FloatArray:
        """H(q, 0): torques that hold the robot against gravity. Shape (20,), in N and Nm."""
        full = self.configuration(q)
        G = self._embed(full)
        result: FloatArray = G.T @ pin.computeGeneralizedGravity(self._model, self._data, full)
        return result

    def bias(self, q: npt.ArrayLike, v: npt.ArrayLike) -> FloatArray:
        """H(q, v): gravity, centrifugal and Coriolis terms. Shape (20,), in N and Nm."""
        full = self.configuration(q)
        G = self._embed(full)
        rate = G @ _checked(v, "v")
        drift = self._drift(full, rate)
        result: FloatArray = G.T @ pin.rnea(self._model, self._data, full, rate, drift)
        return result

    def terms(self, q: npt.ArrayLike, v: npt.ArrayLike) -> Terms:
        """D, H and the contact terms of the soles, in one pass."""
        full = self.configuration(q)
        G = self._embed(full)
        mass = self._mass_matrix(full, G)
        rate = G @ _checked(v, "v")
        drift = self._drift(full, rate)
        soles, accels = [], []
        pin.forwardKinematics(self._model, self._data, full, rate, drift)
        for frame in self._tree.soles:
            world = pin.LOCAL_WORLD_ALIGNED
            soles.append(pin.getFrameJacobian(self._model, self._data, frame, world) @ G)
            accel = pin.getFrameClassicalAcceleration(self._model, self._data, frame, world)
            accels.append(np.concatenate([accel.linear, accel.angular]))
        bias = G.T @ pin.rnea(self._model, self._data, full, rate, drift)
        return Terms(mass, bias, np.array(soles), np.array(accels))

    def spring_torque(self, q: npt.ArrayLike) -> FloatArray:
        """tau_sp(q): generalized forces of the four leaf springs. Shape (20,), in Nm.

        Source:
            Departs from eq:SpringJacobian, which takes q4 + q5 + q6 - 13 degrees for the heel
            spring's deflection. Here it comes from the achilles rod.
        """
        q = _checked(q, "q")
        torque = np.zeros(SIZE)
        for leg in LEGS:
            joints = [_index(leg, joint) for joint in ("knee", "shin", "tarsus")]
            heel, *slopes = linkage.heel_angle_and_slopes(*(float(q[i]) for i in joints))
            torque[joints] = -_stiffness("heel_spring") * heel * np.array(slopes)
            torque[joints[1]] -= _stiffness("shin") * q[joints[1]]
        return torque

    def com(self, q: npt.ArrayLike) -> FloatArray:
        """Centre of mass. Shape (3,), in m."""
        full = self.configuration(q)
        return np.array(pin.centerOfMass(self._model, self._data, full))

    def sole(self, q: npt.ArrayLike, leg: str) -> tuple[FloatArray, FloatArray]:
        """Middle of a sole's centre line, and its axes: ahead, left, up. (3,) in m, (3, 3)."""
        return self._placement(q, self._tree.soles[LEGS.index(leg)])

    def toe_joint(self, q: npt.ArrayLike, leg: str) -> tuple[FloatArray, FloatArray]:
        """Toe joint, the end of the virtual leg, and the toe link's axes. (3,) in m, (3, 3)."""
        return self._placement(q, self._tree.toes[LEGS.index(leg)])

    def sole_jacobian(self, q: npt.ArrayLike, leg: str) -> FloatArray:
        """Jacobian from v to velocity of a sole's middle, then angular velocity. Shape (6, 20)."""
        full = self.configuration(q)
        G = self._embed(full)
        frame = self._tree.soles[LEGS.index(leg)]
        jacobian = pin.computeFrameJacobian(
            self._model, self._data, full, frame, pin.LOCAL_WORLD_ALIGNED
        )
        result: FloatArray = jacobian @ G
        return result

    def _mass_matrix(self, full: FloatArray, G: FloatArray) -> FloatArray:
        upper = pin.crba(self._model, self._data, full)
        M = np.triu(upper) + np.triu(upper, 1).T
        mass: FloatArray = G.T @ M @ G
        return mass

    def _placement(self, q: npt.ArrayLike, frame: int) -> tuple[FloatArray, FloatArray]:
        pin.framesForwardKinematics(self._model, self._data, self.configuration(q))
        placement = self._data.oMf[frame]
        return np.array(placement.translation), np.array(placement.rotation)

    def _embed(self, full: FloatArray) -> FloatArray:
        tree = self._tree
        G = np.zeros((self._model.nv, SIZE))
        G[tree.joints_v, range(SIZE)] = 1.0
        pin.computeJointJacobians(self._model, self._data, full)
        pin.updateFramePlacements(self._model, self._data)
        for loop in tree.loops:
            jacobian = self._gap_jacobian(loop)
            own = jacobian[:, loop.follows]
            G[loop.follows] = -_least_squares(own, jacobian[:, tree.joints_v])
        return G

    def _gap_jacobian(self, loop: Loop) -> FloatArray:
        tip, target = (
            pin.getFrameJacobian(self._model, self._data, frame, pin.LOCAL_WORLD_ALIGNED)[:3]
            for frame in (loop.tip, loop.pin)
        )
        gap: FloatArray = tip - target
        return gap

    def _drift(self, full: FloatArray, rate: FloatArray) -> FloatArray:
        """Acceleration of the tree at v' = 0, which keeps the pins together in motion."""
        drift = np.zeros(self._model.nv)
        pin.computeJointJacobians(self._model, self._data, full)
        pin.forwardKinematics(self._model, self._data, full, rate, drift)
        pin.updateFramePlacements(self._model, self._data)
        for loop in self._tree.loops:
            tip, target = (
                pin.getFrameClassicalAcceleration(
                    self._model, self._data, frame, pin.LOCAL_WORLD_ALIGNED
                ).linear
                for frame in (loop.tip, loop.pin)
            )
            own = self._gap_jacobian(loop)[:, loop.follows]
            drift[loop.follows] = -_least_squares(own, tip - target)
        return drift


def _least_squares(matrix: FloatArray, target: FloatArray) -> FloatArray:
    """Solution of a small system; if there are several, the one of least norm."""
    return np.asarray(np.linalg.lstsq(matrix, target, rcond=None)[0], dtype=np.float64)


def _checked(values: npt.ArrayLike, name: str) -> FloatArray:
    array = np.asarray(values, dtype=np.float64)
    if array.shape != (SIZE,):
        raise KinematicsError(f"{name} has shape {array.shape}, expected ({SIZE},)")
    if not np.isfinite(array).all():
        wrong = [COORDINATES[i] for i in np.flatnonzero(~np.isfinite(array))]
        raise KinematicsError(f"{name} is not finite at {', '.join(wrong)}")
    return array
