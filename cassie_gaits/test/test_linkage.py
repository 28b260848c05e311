"""Rods of a leg: known answers, slopes by finite differences, refusals."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cassie_gaits import robot
from cassie_gaits.errors import KinematicsError
from cassie_gaits.linkage import (
    achilles_direction,
    crank_angles,
    heel_angle,
    heel_angle_and_slopes,
)

ANGLES = [(-0.7, 0.0, 0.93), (-1.2, -0.05, 1.5), (-2.1, 0.02, 2.3), (-2.8, 0.0, 3.02)]


def test_relaxed_where_the_pin_is_defined():
    assert heel_angle(math.radians(-45.0), 0.0, math.radians(58.0)) == pytest.approx(0.0, abs=1e-12)
    rod = next(link for link in robot.LEFT_LEG if link.name == "achilles_rod")
    direction = achilles_direction(math.radians(-45.0), 0.0, math.radians(58.0))
    np.testing.assert_allclose(direction, rod.x_axis, atol=1e-5)


@pytest.mark.parametrize("knee", np.radians([-37.0, -60.0, -100.0, -157.0]))
def test_relaxed_springs_leave_the_heel_spring_nearly_relaxed(knee):
    assert abs(heel_angle(knee, 0.0, robot.NEUTRAL_TARSUS - knee)) < 0.018


@pytest.mark.parametrize("angles", ANGLES)
def test_slopes_match_finite_differences(angles):
    heel, *slopes = heel_angle_and_slopes(*angles)
    assert heel == heel_angle(*angles)
    step = 1e-6
    for i, slope in enumerate(slopes):
        moved = [
            heel_angle(*(angle + sign * step * (i == j) for j, angle in enumerate(angles)))
            for sign in (1.0, -1.0)
        ]
        assert slope == pytest.approx((moved[0] - moved[1]) / (2 * step), abs=1e-6)


def test_folding_the_tarsus_turns_the_heel_spring_back():
    relaxed = robot.NEUTRAL_TARSUS + 1.2
    assert heel_angle(-1.2, 0.0, relaxed + 0.05) < heel_angle(-1.2, 0.0, relaxed)


@pytest.mark.parametrize("toe", np.radians([-140.0, -90.0, -30.0]))
def test_crank_turns_nearly_with_the_toe_and_the_rod_keeps_its_attitude(toe):
    crank, rod = crank_angles(toe)
    assert crank == pytest.approx(toe, abs=math.radians(8.0))
    assert crank + rod == pytest.approx(0.0, abs=math.radians(2.0))


def test_heel_spring_out_of_reach_is_refused():
    with pytest.raises(KinematicsError, match="achilles rod does not reach at knee"):
        heel_angle(-0.6, 0.0, 1.8)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_angle_that_is_not_finite_is_refused(bad):
    with pytest.raises(KinematicsError):
        heel_angle(-1.0, bad, 1.2)
    with pytest.raises(KinematicsError):
        crank_angles(bad)
