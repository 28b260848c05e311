"""Cassie with rigid springs on one foot, from the 20-DoF Pinocchio model with closed loops.

The stance foot's position, pitch and yaw are fixed (eq:holonomicConstraintsCR); the foot rolls
freely about the middle line of its sole. States are q and v of the 20 coordinates with relaxed
springs; "rigid" vectors have the coordinates of pelvis and drives, `dynamics.RIGID`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from cassie_gaits import robot
from cassie_gaits.certificate.rigid_tree import RigidTree
from cassie_gaits.dynamics import INPUT, RIGID
from cassie_gaits.records import FloatArray

BASE_AND_DRIVES = RIGID.shape[1]

_INPUT: FloatArray = RIGID.T @ INPUT
_RIGID_OF_V: FloatArray = np.linalg.pinv(RIGID).astype(np.float64)
"""Rigid velocities from v of the 20 coordinates with relaxed springs. Shape (16, 20)."""


def rigid_velocity(v: FloatArray) -> FloatArray:
    """Velocities of pelvis and drives. Shape (16,) from (20,)."""
    result: FloatArray = _RIGID_OF_V @ v
    return result


@dataclass(frozen=True, eq=False)
class Motion:
    """Acceleration of the 20 coordinates, and ground force on the stance foot.

    Attributes:
        acceleration: Acceleration. Shape (20,).
        force: Force (3) in N and moment about the sole's middle (3) in Nm, ground axes: ahead
            along the stance foot, left, and up along the ground's normal. Shape (6,).
    """

    acceleration: FloatArray
    force: FloatArray


class Walker:
    """Equations of motion on one foot.

    Args:
        symmetric: Whether the pelvis counts as symmetric.
        slope: Rise of the ground ahead, along the world's x axis. In rad.
        payload: Additional mass at the pelvis's centre of mass. In kg.
    """

    def __init__(self, *, symmetric: bool, slope: float = 0.0, payload: float = 0.0) -> None:
        pelvis = robot.symmetric_pelvis() if symmetric else robot.PELVIS
        self.tree = _tree(replace(pelvis, mass=pelvis.mass + payload))
        self.slope = slope
        self._straight = self._directions(0.0)
        self._axes = self.ground_axes()

    def ground_axes(self, heading: float = 0.0) -> FloatArray:
        """Columns: ahead along a foot of this heading, left, and the ground's normal. (3, 3)."""
        c, s = math.cos(self.slope), math.sin(self.slope)
        tilt = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
        ch, sh = math.cos(heading), math.sin(heading)
        turn = np.array([[ch, -sh, 0.0], [sh, ch, 0.0], [0.0, 0.0, 1.0]])
        result: FloatArray = tilt @ turn
        return result

    def motion(self, q: FloatArray, v: FloatArray, torques: FloatArray, leg: str) -> Motion:
        """Acceleration and ground force of the foot that stands along the world's x axis.

        Source:
            eq:FloatingBaseModel with eq:holonomicConstraints.
        """
        terms = self.tree.terms(q, rigid_velocity(v), leg)
        J = self._straight @ terms.sole
        push = _INPUT @ torques - terms.bias
        solution = _saddle(terms.mass, J, push, -self._straight @ terms.drift)
        force = self._straight.T @ solution[BASE_AND_DRIVES:]
        in_ground = np.concatenate([self._axes.T @ force[:3], self._axes.T @ force[3:]])
        return Motion(RIGID @ solution[:BASE_AND_DRIVES], in_ground)

    def impact(self, q: FloatArray, v: FloatArray, leg: str, heading: float) -> FloatArray:
        """Velocity just after the impact of `leg`, whose foot has this heading. Shape (20,).

        Source:
            eq:impactMap.
        """
        before = rigid_velocity(v)
        terms = self.tree.terms(q, before, leg)
        J = self._directions(heading) @ terms.sole
        after = _saddle(terms.mass, J, terms.mass @ before, np.zeros(len(J)))
        result: FloatArray = RIGID @ after[:BASE_AND_DRIVES]
        return result

    def residual(
        self, q: FloatArray, v: FloatArray, a: FloatArray, torques: FloatArray, leg: str
    ) -> FloatArray:
        """Residual torques of a motion, of the stance foot's roll and the ten drives. (11,), Nm."""
        terms = self.tree.terms(q, rigid_velocity(v), leg)
        lacking = terms.mass @ rigid_velocity(a) + terms.bias - _INPUT @ torques
        drives = np.eye(BASE_AND_DRIVES)[6:]
        ways = np.linalg.inv(np.vstack([terms.sole, drives]))
        ahead = np.concatenate([np.zeros(3), self._axes[:, 0]])
        free = np.column_stack([ways[:, :6] @ ahead, ways[:, 6:]])
        result: FloatArray = free.T @ lacking
        return result

    def _directions(self, heading: float) -> FloatArray:
        axes = self.ground_axes(heading)
        rows = np.zeros((5, 6))
        rows[:3, :3] = np.eye(3)
        rows[3:, 3:] = axes[:, 1:].T
        return rows


@lru_cache(maxsize=16)
def walker(*, symmetric: bool, slope: float, payload: float) -> Walker:
    """The equations of motion; the last ones are cached."""
    return Walker(symmetric=symmetric, slope=slope, payload=payload)


@lru_cache(maxsize=16)
def _tree(pelvis: robot.Link) -> RigidTree:
    return RigidTree(pelvis)


def _saddle(D: FloatArray, J: FloatArray, push: FloatArray, target: FloatArray) -> FloatArray:
    """Solution (a, f) of D a - J^T f = push, J a = target."""
    n, m = len(D), len(J)
    matrix = np.zeros((n + m, n + m))
    matrix[:n, :n] = D
    matrix[:n, n:] = -J.T
    matrix[n:, :n] = J
    result: FloatArray = np.linalg.solve(matrix, np.concatenate([push, target]))
    return result
