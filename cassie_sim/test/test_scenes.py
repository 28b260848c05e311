"""Scenes: names, ground heights, friction that counts."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest

from cassie_msgs.tunables import ParameterError
from cassie_sim.errors import SimulationError
from cassie_sim.poses import lowest_sole, set_drives
from cassie_sim.scenes import scene_spec


def ground_height(model: mujoco.MjModel, x: float, y: float = 0.0) -> float:
    """Height of the ground above the world's origin, from a ray straight down. In m."""
    data = mujoco.MjData(model)
    data.qpos[:3] = (-20.0, -20.0, 2.0)  # the robot out of the way
    mujoco.mj_forward(model, data)
    hit = np.zeros(1, np.int32)
    start = np.array([x, y, 20.0])
    distance = mujoco.mj_ray(model, data, start, np.array([0.0, 0.0, -1.0]), None, 1, -1, hit)
    assert distance > 0.0
    return 20.0 - float(distance)


def test_unknown_scene_names_the_nearest():
    with pytest.raises(SimulationError, match="unknown scene slop: did you mean slope"):
        scene_spec("slop", {})


def test_unknown_parameter_names_the_nearest():
    with pytest.raises(ParameterError, match="unknown parameter angel: did you mean angle"):
        scene_spec("slope", {"angel": 5.0})


def test_parameter_out_of_range_names_value_and_range():
    with pytest.raises(ParameterError, match=r"angle = 45 deg is outside -30 .. 30 deg"):
        scene_spec("slope", {"angle": 45.0})


def test_flat_ground_is_at_zero():
    model = scene_spec("flat", {}).compile()
    for x, y in ((0.0, 0.0), (10.0, -3.0), (-5.0, 7.0)):
        assert ground_height(model, x, y) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("angle", [5.0, 12.0, -8.0])
@pytest.mark.parametrize("start", [1.0, 3.0])
def test_slope_is_level_first_and_then_rises_ahead(angle, start):
    model = scene_spec("slope", {"angle": angle, "start": start}).compile()
    rise = math.tan(math.radians(angle))
    for x in (-2.0, 0.0, start - 0.01):
        assert ground_height(model, x) == pytest.approx(0.0, abs=1e-6)
    for x in (start + 0.01, start + 1.0, start + 10.0):
        assert ground_height(model, x, 2.0) == pytest.approx(rise * (x - start), abs=1e-6)


@pytest.mark.parametrize(("angle", "side"), [(0.0, 6.0), (0.0, -4.0), (5.0, 6.0)])
def test_slope_to_the_side_rises_to_the_left(angle, side):
    model = scene_spec("slope", {"angle": angle, "side_angle": side}).compile()
    assert ground_height(model, 0.0) == pytest.approx(0.0, abs=1e-6)
    assert math.copysign(1.0, ground_height(model, 0.0, 1.0)) == math.copysign(1.0, side)
    across = ground_height(model, 0.0, 1.0) - ground_height(model, 0.0, -1.0)
    ahead = ground_height(model, 1.0) - ground_height(model, -1.0)
    assert across / 2.0 == pytest.approx(
        math.tan(math.radians(side)) / math.cos(math.radians(angle)), rel=0.01
    )
    assert ahead / 2.0 == pytest.approx(math.tan(math.radians(angle)), abs=1e-6)


@pytest.mark.parametrize("friction", [0.2, 0.7, 1.8])
@pytest.mark.parametrize("scene", ["flat", "slope"])
def test_friction_of_the_ground_counts_not_that_of_the_foot(scene, friction):
    model = scene_spec(scene, {"friction": friction}).compile()
    data = mujoco.MjData(model)
    set_drives(model, data, [0.0, 0.0, 0.5, -1.15, -1.6] * 2)
    mujoco.mj_kinematics(model, data)
    data.qpos[2] -= lowest_sole(model, data) + 0.002
    mujoco.mj_forward(model, data)
    assert data.ncon == 4
    for contact in data.contact:
        assert contact.friction[0] == pytest.approx(friction)
