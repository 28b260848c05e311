"""The Pinocchio tree of Cassie with rigid springs, by the 16 velocities of pelvis and drives.

With rigid springs the angles of a leg's rods, heel spring and foot crank are functions of its knee
and its toe angle only. These curves are sampled once from `dynamics`, which closes the loops, and
kept as Chebyshev series with an error of about 1e-11. A call then takes a tenth of the time.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin

from cassie_gaits import robot
from cassie_gaits.compiled import compiled
from cassie_gaits.dynamics import RIGID, Dynamics, rigid_pose
from cassie_gaits.errors import KinematicsError
from cassie_gaits.names import LEG_DRIVES, LEGS
from cassie_gaits.pinocchio_model import BASE_SIZE, Tree, build_tree
from cassie_gaits.records import FloatArray, IntArray

SIZE = RIGID.shape[1]

_DEGREE = 60
_KNEE_PLACES, _KNEE_RATES, _WIDTH = 5, 3, 11
_RANGES = {"knee": (-2.80, -0.60), "toe": (-2.50, -0.45)}  # rad, slightly beyond the stops


@dataclass(frozen=True, eq=False)
class RigidTerms:
    """Terms of the equation of motion in rigid velocities, and the contact terms of one sole.

    Attributes:
        mass: Mass matrix. Shape (16, 16).
        bias: Gravity, centrifugal and Coriolis terms. Shape (16,).
        sole: Jacobian of the sole's middle, velocity before angular velocity. Shape (6, 16).
        drift: Acceleration of the sole when v' = 0. Shape (6,).
    """

    mass: FloatArray
    bias: FloatArray
    sole: FloatArray
    drift: FloatArray


class RigidTree:
    """Dynamics from the 20 coordinates q with relaxed springs and rigid velocities (16,).

    Args:
        pelvis: The pelvis's link.

    Raises:
        KinematicsError: from every method, if a knee or toe is far beyond its stops.
    """

    def __init__(self, pelvis: robot.Link) -> None:
        self._tree: Tree = build_tree(pelvis_link=pelvis)
        self._model: Any = self._tree.model
        self._data: Any = self._model.createData()
        self._full: FloatArray = pin.neutral(self._model)
        self._embedding = np.zeros((self._model.nv, SIZE))
        self._embedding[self._tree.joints_v] = RIGID
        self._drift = np.zeros(self._model.nv)
        self._curves = _curves()

    def terms(self, q: FloatArray, v: FloatArray, leg: str) -> RigidTerms:
        """Mass, bias and the contact terms of a leg's sole.

        Args:
            q: Coordinates. Shape (20,).
            v: Velocities of pelvis and drives. Shape (16,).
            leg: "left" or "right".
        """
        model, data, G = self._model, self._data, self._embedding
        full = self._configure(q, v)
        rate = G @ v
        mass = G.T @ (pin.crba(model, data, full) @ G)
        bias = G.T @ pin.rnea(model, data, full, rate, self._drift)
        frame, world = self._tree.soles[LEGS.index(leg)], pin.LOCAL_WORLD_ALIGNED
        sole = pin.computeFrameJacobian(model, data, full, frame, world) @ G
        pin.forwardKinematics(model, data, full, rate, self._drift)
        accel = pin.getFrameClassicalAcceleration(model, data, frame, world).vector
        return RigidTerms(mass, bias, sole, np.array(accel))

    def sole(self, q: FloatArray, leg: str) -> tuple[FloatArray, FloatArray]:
        """Middle of a sole and its axes, as in `dynamics.Dynamics.sole`. (3,) in m, (3, 3)."""
        places = self.soles(q)
        return places[LEGS.index(leg)]

    def soles(self, q: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
        """Middle and axes of both soles, as in `sole`, left and right."""
        full = self._configure(q, None)
        pin.framesForwardKinematics(self._model, self._data, full)
        at = [self._data.oMf[frame] for frame in self._tree.soles]
        return [(np.array(place.translation), np.array(place.rotation)) for place in at]

    def sole_jacobian(self, q: FloatArray, leg: str) -> FloatArray:
        """Jacobian from rigid velocities to the velocity of a sole. Shape (6, 16)."""
        full = self._configure(q, None)
        frame = self._tree.soles[LEGS.index(leg)]
        world = pin.LOCAL_WORLD_ALIGNED
        jacobian = pin.computeFrameJacobian(self._model, self._data, full, frame, world)
        result: FloatArray = jacobian @ self._embedding
        return result

    def skeleton(self, q: FloatArray, leg: str) -> FloatArray:
        """Hip, hip pitch, knee, tarsus and toe joints, heel and tip of a foot. (7, 3), in m."""
        full = self._configure(q, None)
        pin.framesForwardKinematics(self._model, self._data, full)
        joints = ("hip_roll", "hip_pitch", "knee", "tarsus", "toe")
        at = [self._data.oMi[self._model.getJointId(f"{leg}_{joint}")] for joint in joints]
        foot = [at[-1].act(np.array(point)) for point in robot.FOOT_CONTACTS]
        return np.array([*(place.translation for place in at), *foot])

    def _configure(self, q: FloatArray, v: FloatArray | None) -> FloatArray:
        """Set configuration, embedding and, with velocities, drift."""
        self._full[self._tree.joints_q] = q - self._tree.zeros
        self._curves.write(q, v, self._full, self._embedding, self._drift)
        return self._full


class _Curves:
    """Followers of knee and toe in each leg: positions, rates per rate, and their derivatives."""

    def __init__(self, tree: Tree) -> None:
        joints = [(leg, joint) for leg in LEGS for joint in ("knee", "toe")]
        free = [BASE_SIZE + 5 * LEGS.index(leg) + LEG_DRIVES.index(joint) for leg, joint in joints]
        self._columns = free
        self._still = np.zeros(SIZE)
        self._low = np.array([_RANGES[joint][0] for _, joint in joints])
        self._span = np.array([_RANGES[joint][1] - _RANGES[joint][0] for _, joint in joints])
        places, follows = _followers(tree)
        self._places, self._follows = places, follows
        self._series = np.zeros((len(joints), _DEGREE + 1, _WIDTH))
        dynamics = Dynamics()
        for i in range(len(joints)):
            self._series[i] = self._fit(i, dynamics)
        # For each curve: column in the rigid velocities, joint in q, numbers of following positions
        # and rates, and the indices of these.
        self._table = np.full((len(joints), 4 + _KNEE_PLACES + _KNEE_RATES), -1, np.int64)
        for i, column in enumerate(free):
            joint = int(np.argmax(RIGID[:, column]))
            entries = [column, joint, len(places[i]), len(follows[i]), *places[i], *follows[i]]
            self._table[i, : len(entries)] = entries
        self._ranges = np.column_stack([self._low, self._span])

    def write(
        self,
        q: FloatArray,
        v: FloatArray | None,
        full: FloatArray,
        embedding: FloatArray,
        drift: FloatArray,
    ) -> None:
        """Write the followers' configuration, slopes and accelerations."""
        moves = self._still if v is None else v
        if not _write(
            self._table, self._ranges, self._series, q, moves, full, embedding, drift, v is not None
        ):
            knees_and_toes = q[self._table[:, 1]]
            raise KinematicsError(f"knees and toes are at {knees_and_toes}, far beyond their stops")

    def _fit(self, i: int, dynamics: Dynamics) -> FloatArray:
        chebyshev = np.polynomial.chebyshev
        count = _DEGREE + 1
        nodes = np.cos(np.pi * (np.arange(count) + 0.5) / count)
        column, places, follows = self._columns[i], self._places[i], self._follows[i]
        samples, middle = [], np.array([0.0, 0.0, 0.5, -1.6, -1.5] * 2)
        for node in nodes:
            drives = middle.copy()
            drives[column - BASE_SIZE] = self._low[i] + 0.5 * self._span[i] * (node + 1.0)
            q = rigid_pose(np.zeros(BASE_SIZE), drives)
            slopes = dynamics.embedding(q)[follows] @ RIGID[:, column]
            samples.append(np.concatenate([dynamics.configuration(q)[places], slopes]))
        values = np.array(samples)
        series = chebyshev.chebfit(nodes, values, _DEGREE)
        slopes_of = chebyshev.chebder(series, scl=2.0 / self._span[i])
        changes = np.asarray(chebyshev.chebval(nodes, slopes_of).T, dtype=np.float64)
        bends = changes[:, len(places) :]
        if len(places) == _KNEE_PLACES:
            bends = _without_spin(values, changes)
        fitted = np.hstack([series, chebyshev.chebfit(nodes, bends, _DEGREE)])
        return np.pad(fitted, ((0, 0), (0, _WIDTH - fitted.shape[1])))


@compiled
def _write(
    table: IntArray,
    ranges: FloatArray,
    series: FloatArray,
    q: FloatArray,
    v: FloatArray,
    full: FloatArray,
    embedding: FloatArray,
    drift: FloatArray,
    moving: bool,
) -> bool:
    """Write the followers of knees and toes; returns whether these are within the ranges."""
    basis, values = np.empty(series.shape[1]), np.empty(series.shape[2])
    for i in range(table.shape[0]):
        column, places, rates = table[i, 0], table[i, 2], table[i, 3]
        x = 2.0 * (q[table[i, 1]] - ranges[i, 0]) / ranges[i, 1] - 1.0
        if not -1.0 <= x <= 1.0:
            return False
        basis[0], basis[1] = 1.0, x
        for k in range(2, basis.size):
            basis[k] = 2.0 * x * basis[k - 1] - basis[k - 2]
        values[:] = 0.0
        for k in range(basis.size):
            for j in range(values.size):
                values[j] += basis[k] * series[i, k, j]
        for j in range(places):
            full[table[i, 4 + j]] = values[j]
        for j in range(rates):
            row = table[i, 4 + places + j]
            embedding[row, column] = values[places + j]
            if moving:
                drift[row] = values[places + rates + j] * v[column] ** 2
    return True


@cache
def _curves() -> _Curves:
    """The legs' curves, which do not depend on the pelvis; fitted once per process."""
    return _Curves(build_tree())


def _without_spin(values: FloatArray, changes: FloatArray) -> FloatArray:
    """Accelerations of rod and heel spring per squared rate of the knee. Shape (n, 3).

    Args:
        values: Heel angle, the rod's quaternion (x, y, z, w), and, per rate of the knee, the rod's
            two rates perpendicular to itself and the heel's rate. Shape (n, 8).
        changes: Derivatives of `values` with respect to the knee angle.

    The axes in which the rod's rates are given rotate about the rod by `spin`; the rod does not.
    """
    x, y, z, w = values[:, 1:5].T
    dx, dy, dz, dw = changes[:, 1:5].T
    spin = 2.0 * (w * dx - x * dw - y * dz + z * dy)
    bends = changes[:, 5:].copy()
    bends[:, 0] -= spin * values[:, 6]
    bends[:, 1] += spin * values[:, 5]
    return bends


def _followers(tree: Tree) -> tuple[list[list[int]], list[list[int]]]:
    """Indices in configuration and velocity of the followers of left knee, toe, right knee, toe."""
    places, follows = [], []
    for i in range(len(LEGS)):
        heel, ball, crank = tree.heels_q[i], tree.balls_q[i], tree.cranks_q[i]
        places += [[heel, *range(ball, ball + 4)], [crank, crank + 1]]
        achilles, plantar = tree.loops[2 * i], tree.loops[2 * i + 1]
        follows += [achilles.follows.tolist(), plantar.follows.tolist()]
    return places, follows
