"""The rigid tree of the certificate: the same robot as the 20-DoF model with closed loops."""

from __future__ import annotations

import numpy as np
import pytest

from cassie_gaits import robot
from cassie_gaits.certificate.rigid_tree import RigidTree
from cassie_gaits.dynamics import RIGID, Dynamics, rigid_pose
from cassie_gaits.errors import KinematicsError

RNG = np.random.default_rng(5)


def pose(knee=-1.4, toe=-1.7):
    base = RNG.normal(size=6) * 0.2
    drives = [0.1, -0.1, 0.6, knee, toe, -0.05, 0.2, 0.3, -1.9, -1.2]
    return rigid_pose(base, drives)


@pytest.mark.parametrize("leg", ["left", "right"])
@pytest.mark.parametrize(("knee", "toe"), [(-0.7, -0.6), (-1.4, -1.7), (-2.6, -2.4)])
def test_terms_are_those_of_the_model_with_closed_loops(leg, knee, toe):
    model, tree = Dynamics(), RigidTree(robot.PELVIS)
    q, v = pose(knee, toe), RNG.normal(size=16) * 3.0
    expected = model.terms(q, RIGID @ v)
    found = tree.terms(q, v, leg)
    index = 0 if leg == "left" else 1
    np.testing.assert_allclose(found.mass, RIGID.T @ expected.mass @ RIGID, atol=1e-8)
    np.testing.assert_allclose(found.bias, RIGID.T @ expected.bias, atol=1e-6)
    np.testing.assert_allclose(found.sole, expected.soles[index] @ RIGID, atol=1e-9)
    np.testing.assert_allclose(found.drift, expected.sole_drifts[index], atol=1e-8)
    np.testing.assert_allclose(tree.sole(q, leg)[0], model.sole(q, leg)[0], atol=1e-12)
    np.testing.assert_allclose(tree.sole(q, leg)[1], model.sole(q, leg)[1], atol=1e-12)


def test_a_knee_far_beyond_its_stops_is_refused():
    with pytest.raises(KinematicsError, match="beyond their stops"):
        RigidTree(robot.PELVIS).soles(pose(knee=-0.2))
