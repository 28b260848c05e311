"""The Segway alone, with a rider who does not move."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from cassie_sim.ground import Surface, add_plane, add_texture
from cassie_sim.scene_parameters import Segway
from cassie_sim.segway import MASS, WHEEL_RADIUS, SegwayDrive, add_segway

PERIOD = 0.0005


def ridden(ahead: float, duration: float, *, held: bool = False, softness: float = 1.0):
    """Speed, pitch and position after a time, with 33 kg 0.5 m up and `ahead` of the axle."""
    spec = mujoco.MjSpec()
    spec.option.timestep = PERIOD
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    add_texture(spec)
    add_plane(spec, Surface(1.0), "ground")
    add_segway(spec)
    rider = spec.body("segway").add_body(name="rider", pos=[ahead, 0.0, 0.5])
    rider.add_geom(size=[0.1, 0.1, 0.1], mass=33.0, contype=0, conaffinity=0)
    model = spec.compile()
    data, drive = mujoco.MjData(model), SegwayDrive(Segway(softness=softness))
    if not held:
        drive.let_go()
    mujoco.mj_forward(model, data)
    for step in range(round(duration / PERIOD)):
        if step % 4 == 0:
            drive.apply(model, data, step * PERIOD + 1e-9)
        mujoco.mj_step(model, data)
    matrix = data.xmat[model.body("segway").id]
    return float(data.qvel[0]), float(np.arcsin(-matrix[6])), data.qpos[:3].copy(), model


@pytest.mark.parametrize("ahead", [-0.01, 0.01])
def test_it_goes_where_its_rider_leans(ahead):
    speed, pitch, position, _ = ridden(ahead, 3.0)
    assert speed * ahead > 0.0
    assert 0.3 < abs(speed) < 4.0
    assert abs(pitch) < 0.3
    assert position[2] == pytest.approx(WHEEL_RADIUS, abs=0.01)


def test_it_is_held_until_the_robot_stands_on_it():
    speed, pitch, position, _ = ridden(0.01, 3.0, held=True)
    assert abs(speed) < 0.01
    assert np.abs(position[:2]).max() < 0.02
    assert abs(pitch) < 0.02


def test_a_softer_platform_tilts_further():
    stiff, soft = (abs(ridden(0.01, 1.0, softness=softness)[1]) for softness in (0.5, 1.3))
    assert soft > 1.3 * stiff


def test_it_weighs_what_the_data_sheet_says():
    model = ridden(0.0, PERIOD)[3]
    assert model.body("segway").subtreemass[0] - 33.0 == pytest.approx(MASS)
