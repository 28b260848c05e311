"""Gaits on a grid: multilinear, continuous, holes filled from their neighbours."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from cassie_gaits.errors import GaitLibraryError
from cassie_gaits.gait_library import Gait, GaitLibrary, Provenance
from cassie_gaits.model_hash import model_hash

RNG = np.random.default_rng(8)
AXES = ((-0.5, 0.0, 0.6, 1.0), (-0.2, 0.0, 0.2), (-0.6, 0.0, 0.6))


def library(without=()):
    gaits = [
        Gait(*point, 0.4, RNG.normal(size=(2, 9, 6)))
        for point in itertools.product(*AXES)
        if point not in without
    ]
    return GaitLibrary(tuple(gaits), "optimized", model_hash(), Provenance("test", "1", "-"))


FULL = library()


def read(from_library, vx, vy, yaw_rate):
    return np.array(from_library.interpolate(vx, vy, yaw_rate)[:2])


def test_every_gait_comes_back_at_its_own_speeds():
    for gait in FULL.gaits:
        found = read(FULL, gait.vx, gait.vy, gait.yaw_rate)
        np.testing.assert_array_equal(found, gait.coefficients)


def test_between_the_points_it_is_linear_in_each_speed():
    low, high = read(FULL, 0.6, 0.0, 0.0), read(FULL, 1.0, 0.0, 0.0)
    np.testing.assert_allclose(read(FULL, 0.7, 0.0, 0.0), 0.75 * low + 0.25 * high, atol=1e-14)
    corners = [read(FULL, *c) for c in itertools.product((0.0, 0.6), (0.0, 0.2), (-0.6, 0.0))]
    np.testing.assert_allclose(read(FULL, 0.3, 0.1, -0.3), np.mean(corners, axis=0), atol=1e-14)


def test_outside_it_is_the_nearest_point_of_the_grid():
    np.testing.assert_array_equal(read(FULL, 9.0, -9.0, 0.1), read(FULL, 1.0, -0.2, 0.1))


def test_speeds_to_the_side_and_turning_may_be_left_out():
    np.testing.assert_array_equal(FULL.interpolate(0.3)[0], FULL.interpolate(0.3, 0.0, 0.0)[0])


def test_a_hole_takes_the_gait_beside_it_nearer_to_rest():
    holed = library(without=[(0.6, 0.2, 0.6)])
    assert (FULL.holes, holed.holes) == (0, 1)
    beside = [read(holed, 0.6, 0.0, 0.6), read(holed, 0.6, 0.2, 0.0)]
    found = read(holed, 0.6, 0.2, 0.6)
    assert any(np.array_equal(found, gait) for gait in beside)


def test_around_a_hole_it_stays_continuous_and_between_given_gaits():
    holed = library(without=[(0.6, 0.2, 0.6), (1.0, 0.2, 0.6)])
    low = np.min([gait.coefficients for gait in holed.gaits], axis=0)
    high = np.max([gait.coefficients for gait in holed.gaits], axis=0)
    at, way = RNG.uniform(-1.0, 1.2, size=3), RNG.normal(size=3)
    before = read(holed, *at)
    for _ in range(2000):
        at = at + 1e-3 * way
        found = read(holed, *at)
        assert np.abs(found - before).max() < 0.2
        assert (low - 1e-12 <= found).all() and (found <= high + 1e-12).all()
        before = found


def test_a_number_that_is_not_finite_is_refused():
    with pytest.raises(GaitLibraryError, match="finite"):
        FULL.interpolate(0.0, float("nan"))
