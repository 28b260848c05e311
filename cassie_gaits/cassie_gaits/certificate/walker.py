"""Cassie with rigid springs on one foot, from the 20-DoF Pinocchio model with closed loops.

The stance foot's position, pitch and yaw are held (eq:holonomicConstraintsCR); it rolls freely
about the middle line of its sole. States are q and v of the 20 coordinates with relaxed springs;
"rigid" vectors are those of pelvis and drives, `dynamics.RIGID`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cassie_gaits import robot
from cassie_gaits.dynamics import INPUT, RIGID, Dynamics, Terms
from cassie_gaits.names import LEGS

FloatArray = npt.NDArray[np.float64]

BASE_AND_DRIVES = RIGID.shape[1]


@dataclass(frozen=True, eq=False)
class Motion:
    """Acceleration of the 20 coordinates, and the ground's push on the stance foot.

    Attributes:
        acceleration: Shape (20,).
        force: Force (3) in N and moment about the sole's middle (3) in Nm, ground axes: ahead
            along the stance foot, left, and up across the ground. Shape (6,).
    """

    acceleration: FloatArray
    force: FloatArray


class Walker:
    """Equations of motion on one foot.

    Args:
        symmetric: Whether the pelvis counts as symmetric.
        slope: Rise of the ground ahead, along the world's x axis. In rad.
    """

    def __init__(self, *, symmetric: bool, slope: float = 0.0) -> None:
        pelvis = robot.symmetric_pelvis() if symmetric else robot.PELVIS
        self.dynamics = Dynamics(pelvis=pelvis)
        self.slope = slope

    def ground_axes(self, heading: float = 0.0) -> FloatArray:
        """Columns: ahead along a foot of this heading, left, and up across the ground. (3, 3)."""
        c, s = math.cos(self.slope), math.sin(self.slope)
        tilt = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
        ch, sh = math.cos(heading), math.sin(heading)
        turn = np.array([[ch, -sh, 0.0], [sh, ch, 0.0], [0.0, 0.0, 1.0]])
        result: FloatArray = tilt @ turn
        return result

    def contact(self, terms: Terms, leg: str, heading: float = 0.0) -> FloatArray:
        """What the ground can hold of a foot: position, pitch and yaw, by rigid v. (5, 16)."""
        jacobian: FloatArray = self._directions(heading) @ terms.soles[LEGS.index(leg)] @ RIGID
        return jacobian

    def motion(self, q: FloatArray, v: FloatArray, torques: FloatArray, leg: str) -> Motion:
        """Acceleration and ground force of the foot that stands along the world's x axis.

        Source:
            eq:FloatingBaseModel with eq:holonomicConstraints.
        """
        terms = self.dynamics.terms(q, v)
        D = RIGID.T @ terms.mass @ RIGID
        J = self.contact(terms, leg)
        push = RIGID.T @ (INPUT @ torques - terms.bias)
        drift = self._directions(0.0) @ terms.sole_drifts[LEGS.index(leg)]
        solution = _saddle(D, J, push, -drift)
        force = self._directions(0.0).T @ solution[BASE_AND_DRIVES:]
        axes = self.ground_axes()
        in_ground = np.concatenate([axes.T @ force[:3], axes.T @ force[3:]])
        return Motion(RIGID @ solution[:BASE_AND_DRIVES], in_ground)

    def impact(self, q: FloatArray, v: FloatArray, leg: str, heading: float) -> FloatArray:
        """Velocity just after `leg` of this heading has met the ground. Shape (20,).

        Source:
            eq:impactMap.
        """
        terms = self.dynamics.terms(q, np.zeros_like(v))
        D = RIGID.T @ terms.mass @ RIGID
        J = self.contact(terms, leg, heading)
        before = np.linalg.lstsq(RIGID, v, rcond=None)[0]
        after = _saddle(D, J, D @ before, np.zeros(len(J)))
        result: FloatArray = RIGID @ after[:BASE_AND_DRIVES]
        return result

    def residual(
        self, q: FloatArray, v: FloatArray, a: FloatArray, torques: FloatArray, leg: str
    ) -> FloatArray:
        """Torques that a motion lacks, of the stance foot's roll and the ten drives. (11,), Nm."""
        terms = self.dynamics.terms(q, v)
        lacking = RIGID.T @ (terms.mass @ a + terms.bias - INPUT @ torques)
        sole = terms.soles[LEGS.index(leg)] @ RIGID
        drives = np.eye(BASE_AND_DRIVES)[6:]
        ways = np.linalg.inv(np.vstack([sole, drives]))
        ahead = np.concatenate([np.zeros(3), self.ground_axes()[:, 0]])
        free = np.column_stack([ways[:, :6] @ ahead, ways[:, 6:]])
        result: FloatArray = free.T @ lacking
        return result

    def _directions(self, heading: float) -> FloatArray:
        axes = self.ground_axes(heading)
        rows = np.zeros((5, 6))
        rows[:3, :3] = np.eye(3)
        rows[3:, 3:] = axes[:, 1:].T
        return rows


def _saddle(D: FloatArray, J: FloatArray, push: FloatArray, target: FloatArray) -> FloatArray:
    """Solution (a, f) of D a - J^T f = push, J a = target."""
    n, m = len(D), len(J)
    matrix = np.zeros((n + m, n + m))
    matrix[:n, :n] = D
    matrix[:n, n:] = -J.T
    matrix[n:, :n] = J
    result: FloatArray = np.linalg.solve(matrix, np.concatenate([push, target]))
    return result
