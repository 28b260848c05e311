"""Gantry: holds, lowers, lets go, goes slack, keeps upright. On a point mass."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cassie_gaits import robot
from cassie_sim.gantry import SPEED, STIFFNESS, Gantry

PERIOD = 0.0005
MASS = robot.MASS
UPRIGHT = np.eye(3).ravel()
SAG = MASS * 9.81 / STIFFNESS


class Load:
    """A point mass on the straps."""

    def __init__(self, height: float = 1.0) -> None:
        self.position = np.array([0.0, 0.0, height])
        self.twist = np.zeros(6)

    def hang(self, gantry: Gantry, seconds: float) -> None:
        for _ in range(round(seconds / PERIOD)):
            force = np.zeros(3)
            if gantry.attached:
                force = gantry.step(PERIOD, self.position, UPRIGHT, self.twist)[:3]
            self.twist[:3] += PERIOD * (force / MASS - [0.0, 0.0, 9.81])
            self.position += PERIOD * self.twist[:3]


def holding(height: float = 1.0) -> tuple[Gantry, Load]:
    gantry, load = Gantry(), Load(height)
    gantry.hold(load.position, height)
    load.hang(gantry, 2.0)
    return gantry, load


def test_holds_the_weight_where_the_straps_stretch_to():
    gantry, load = holding()
    np.testing.assert_allclose(load.position, [0.0, 0.0, 1.0 - SAG], atol=1e-3)
    np.testing.assert_allclose(load.twist, 0.0, atol=1e-3)
    assert gantry.wrench[2] == pytest.approx(MASS * 9.81, rel=1e-3)


def test_moves_at_the_speed_of_the_winch():
    gantry, load = holding()
    gantry.hold(load.position, 1.2, speed=0.05)
    load.hang(gantry, 2.0)
    assert gantry.height == pytest.approx(1.1, abs=1e-3)
    load.hang(gantry, 4.0)
    assert load.position[2] == pytest.approx(1.2 - SAG, abs=1e-3)
    assert gantry.attached


def test_lowers_and_lets_go_there():
    gantry, load = holding()
    gantry.lower(0.9)
    load.hang(gantry, 0.5)
    assert gantry.attached
    assert load.position[2] == pytest.approx(1.0 - 0.5 * SPEED - SAG, abs=1e-2)
    load.hang(gantry, 0.6)
    assert not gantry.attached
    np.testing.assert_array_equal(gantry.wrench, 0.0)


def test_release_lets_go_at_once():
    gantry, _ = holding()
    gantry.release()
    assert not gantry.attached
    np.testing.assert_array_equal(gantry.wrench, 0.0)


def test_slack_straps_do_nothing():
    gantry = Gantry()
    gantry.hold(np.array([0.0, 0.0, 1.0]), 1.0)
    above = np.array([0.3, -0.2, 1.05])
    twist = np.array([0.5, 0.5, -1.0, 1.0, 1.0, 1.0])
    np.testing.assert_array_equal(gantry.step(PERIOD, above, UPRIGHT, twist), 0.0)


def test_straps_never_push_down():
    gantry = Gantry()
    gantry.hold(np.array([0.0, 0.0, 1.0]), 1.0)
    rising = np.array([0.0, 0.0, 5.0, 0.0, 0.0, 0.0])
    wrench = gantry.step(PERIOD, np.array([0.0, 0.0, 0.99]), UPRIGHT, rising)
    assert wrench[2] == 0.0


def test_holding_again_takes_the_pelvis_where_it_is():
    gantry, load = Gantry(), Load(0.7)
    gantry.hold(load.position, 1.0)
    first = gantry.step(PERIOD, load.position, UPRIGHT, load.twist)
    assert first[2] < 10.0
    assert gantry.height == pytest.approx(0.7, abs=1e-3)
    load.hang(gantry, 5.0)
    assert load.position[2] == pytest.approx(1.0 - SAG, abs=2e-3)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("angle", [0.2, -0.2])
def test_loaded_straps_right_a_tilt(axis, angle):
    gantry, load = holding()
    turn = np.eye(3)
    i, j = ((1, 2), (2, 0))[axis]
    turn[i, i] = turn[j, j] = math.cos(angle)
    turn[i, j], turn[j, i] = -math.sin(angle), math.sin(angle)
    torque = gantry.step(PERIOD, load.position, turn.ravel(), np.zeros(6))[3:]
    assert torque[axis] * angle < -0.5
    np.testing.assert_allclose(np.delete(torque, axis), 0.0, atol=1e-9)


def test_loaded_straps_centre_and_damp():
    gantry, load = holding()
    aside = load.position + np.array([0.1, -0.1, 0.0])
    wrench = gantry.step(PERIOD, aside, UPRIGHT, np.zeros(6)).copy()
    assert wrench[0] < 0.0 < wrench[1]
    spinning = np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0])
    torque = gantry.step(PERIOD, load.position, UPRIGHT, spinning)[3:]
    assert (torque < 0.0).all()
