"""The Segway alone, with a rider who does not move."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from cassie_gaits import robot
from cassie_gaits.robot import GRAVITY
from cassie_sim.ground import Surface, add_plane, add_texture
from cassie_sim.scene_parameters import Segway
from cassie_sim.segway import MASS, WHEEL_RADIUS, add_segway
from cassie_sim.segway_drive import PITCH_GAIN, SegwayDrive, strongest
from cassie_sim.segway_ground import WAYS, heights

PERIOD = 0.0005


def ridden(ahead, duration, *, held=False, softness=1.0, surface="floor"):
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
    settings = Segway(softness=softness, surface=surface, let_go=1e9 if held else 0.0)
    data, drive = mujoco.MjData(model), SegwayDrive(settings)
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


def test_it_weighs_what_its_maker_says():
    model = ridden(0.0, PERIOD)[3]
    assert model.body("segway").subtreemass[0] - 33.0 == pytest.approx(MASS)


def test_it_accelerates_as_the_linear_model_says():
    """a (m h + M r - m g h M r / kp) = m g c + b - F (m h / M + r) to first order.

    The rider is rigid and presses on no pads; M counts the wheels' inertia, b is the bar's moment,
    0.8 kg 0.08 m ahead of the axle. Rolling resistance F r balances part of the motors' torque.
    """
    rider, above, ahead = 33.0, 0.5, 0.02
    speed, earlier = ridden(ahead, 4.0)[0], ridden(ahead, 3.0)[0]
    gain, mass = PITCH_GAIN * 0.2**0.5, rider + MASS + 2.3
    rolling = 0.015 * (robot.MASS + MASS) * GRAVITY * WHEEL_RADIUS
    lean = rider * GRAVITY * ahead + 0.8 * GRAVITY * 0.08
    give = 1.0 - rider * GRAVITY * above / gain
    driven = rider * above + mass * WHEEL_RADIUS * give
    assert speed - earlier == pytest.approx((lean - rolling * give) / driven, rel=0.05)


def test_it_turns_to_the_side_to_which_its_bar_is_pushed():
    spec = mujoco.MjSpec()
    spec.option.timestep = PERIOD
    add_texture(spec)
    add_plane(spec, Surface(1.0), "ground")
    add_segway(spec)
    model = spec.compile()
    data, drive = mujoco.MjData(model), SegwayDrive(Segway(let_go=0.0))
    pad = model.body("segway_bar").id
    for step in range(1000):
        if step % 4 == 0:
            drive.apply(model, data, step * PERIOD + 1e-9)
        data.xfrc_applied[pad, 1] = 20.0  # to the left
        mujoco.mj_step(model, data)
    matrix = data.xmat[model.body("segway").id]
    assert np.arctan2(matrix[3], matrix[0]) > 0.05


def test_grass_slows_it_more_than_a_floor():
    change = {s: ridden(0.01, 3.0, surface=s)[0] - ridden(0.01, 2.0, surface=s)[0] for s in WAYS}
    assert change["grass"] < change["floor"] - 0.03


def test_the_motors_have_no_more_torque_than_their_power_and_their_speed_allow():
    speeds = np.linspace(0.0, 60.0, 121)
    torques = np.array([strongest(speed) for speed in speeds])
    assert (torques * speeds <= 400.0 + 1e-9).all()
    assert (np.diff(torques) <= 0.0).all()
    assert torques[0] == 30.0
    assert strongest(60.0) == 0.0


def test_grass_comes_out_of_level_ground_and_is_rougher_than_a_sidewalk():
    settings = Segway(length=40.0)
    sidewalk, grass = (heights(settings, WAYS[name]) for name in ("sidewalk", "grass"))
    assert np.abs(grass[:, [0, -1]]).max() == 0.0
    assert np.abs(grass[[0, -1]]).max() == 0.0
    assert grass[20:-20, 100:-100].std() > 2.0 * sidewalk[20:-20, 100:-100].std()
