"""Dynamics with closed loops: consistent with energy, derivatives and the robot table.

That they agree with the MuJoCo model is held by cassie_sim/test/test_model_agreement.py.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from cassie_gaits import robot
from cassie_gaits.dynamics import INPUT, RIGID, Dynamics, rigid_pose
from cassie_gaits.errors import KinematicsError
from cassie_gaits.linkage import heel_angle
from cassie_gaits.names import COORDINATES, LEGS

DYNAMICS = Dynamics()
BASE = [0.1, 0.2, 0.9, 0.3, 0.1, -0.2]
DRIVES = [0.05, 0.1, 0.5, -1.2, -1.6, -0.1, 0.05, 0.6, -1.4, -1.2]
V = np.random.default_rng(5).normal(size=20)


def deflected_pose() -> np.ndarray:
    q = rigid_pose(BASE, DRIVES)
    q[COORDINATES.index("left_shin")] = -0.03
    q[COORDINATES.index("left_tarsus")] += 0.02
    return q


Q = deflected_pose()


def gradient(function, step=1e-5):
    columns = [(function(Q + step * e) - function(Q - step * e)) / (2 * step) for e in np.eye(20)]
    return np.moveaxis(np.array(columns), 0, -1)


def test_mass_is_that_of_the_table():
    assert DYNAMICS.mass == pytest.approx(robot.MASS, abs=1e-9)


def test_mass_matrix_is_symmetric_and_positive():
    matrix = DYNAMICS.mass_matrix(Q)
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-12)
    assert np.linalg.eigvalsh(matrix).min() > 0.0
    np.testing.assert_allclose(matrix[:3, :3], DYNAMICS.mass * np.eye(3), atol=1e-9)


def test_gravity_is_the_gradient_of_potential_energy():
    potential = DYNAMICS.mass * 9.81 * gradient(lambda q: DYNAMICS.com(q)[2])
    np.testing.assert_allclose(DYNAMICS.gravity(Q), potential, atol=1e-6)


def test_bias_follows_from_the_mass_matrix():
    """Lagrange: H = D' v - d(1/2 v D v)/dq + g."""
    change = gradient(DYNAMICS.mass_matrix)
    expected = change @ V @ V - 0.5 * np.einsum("i,ijk,j", V, change, V) + DYNAMICS.gravity(Q)
    np.testing.assert_allclose(DYNAMICS.bias(Q, V), expected, atol=1e-5)


def test_bias_at_rest_is_gravity():
    np.testing.assert_allclose(DYNAMICS.bias(Q, np.zeros(20)), DYNAMICS.gravity(Q), atol=1e-10)


@pytest.mark.parametrize("leg", LEGS)
def test_sole_jacobian_matches_finite_differences(leg):
    jacobian = DYNAMICS.sole_jacobian(Q, leg)
    positions = gradient(lambda q: DYNAMICS.sole(q, leg)[0])
    np.testing.assert_allclose(jacobian[:3], positions, atol=1e-8)
    R_WF = DYNAMICS.sole(Q, leg)[1]
    spin = gradient(lambda q: DYNAMICS.sole(q, leg)[1] @ R_WF.T)
    angular = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
    np.testing.assert_allclose(jacobian[3:], angular, atol=1e-8)


def test_spring_torque_is_the_gradient_of_spring_energy():
    def energy(q):
        total = 0.0
        for leg in LEGS:
            angles = [q[COORDINATES.index(f"{leg}_{name}")] for name in ("knee", "shin", "tarsus")]
            total += 0.5 * 1500.0 * angles[1] ** 2 + 0.5 * 1250.0 * heel_angle(*angles) ** 2
        return total

    np.testing.assert_allclose(DYNAMICS.spring_torque(Q), -gradient(energy), atol=1e-6)


def test_level_foot_points_ahead():
    for leg in LEGS:
        drives = [0.0, 0.0, 0.5, -1.2, -0.5 - math.radians(63.0)] * 2
        _, R_WF = DYNAMICS.sole(rigid_pose([0.0] * 6, drives), leg)
        np.testing.assert_allclose(R_WF, np.eye(3), atol=3e-4)


def test_rigid_projection_keeps_the_springs_relaxed():
    moved = rigid_pose(BASE, np.array(DRIVES) + 0.1)
    step = np.concatenate([np.zeros(6), np.full(10, 0.1)])
    np.testing.assert_allclose(rigid_pose(BASE, DRIVES) + RIGID @ step, moved, atol=1e-12)
    np.testing.assert_array_equal(INPUT.T @ RIGID[:, 6:], np.eye(10))


def test_bad_coordinates_are_refused_by_name():
    with pytest.raises(KinematicsError, match=r"q has shape \(3,\), expected \(20,\)"):
        DYNAMICS.com(np.zeros(3))
    q = Q.copy()
    q[COORDINATES.index("right_knee")] = math.nan
    with pytest.raises(KinematicsError, match="q is not finite at right_knee"):
        DYNAMICS.mass_matrix(q)
    with pytest.raises(KinematicsError, match="v is not finite at x"):
        DYNAMICS.bias(Q, np.full(20, math.inf))
