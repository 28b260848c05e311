"""Plant: reproducible to the last bit, its rates, its drives and gantry from outside."""

from __future__ import annotations

import copy
import math

import mujoco
import numpy as np
import pytest

from cassie_msgs.experiment.scenario import (
    Delays,
    Draw,
    GantryMove,
    ModelScale,
    Payload,
    Push,
    Scenario,
)
from cassie_msgs.layout import MotorCommand, Sensors
from cassie_msgs.tunables import ParameterError
from cassie_sim.errors import CommandError, SimulationError
from cassie_sim.plant import STANDING_DRIVES, Plant
from cassie_sim.plant_config import PlantConfig
from cassie_sim.poses import lowest_sole

IDEAL = PlantConfig(sensors="ideal")


def holding() -> MotorCommand:
    """Hold the start pose."""
    command = MotorCommand()
    command.position[:] = STANDING_DRIVES * 2
    command.kp[:], command.kd[:] = 200.0, 8.0
    return command


def trajectory(plant: Plant, ticks: int) -> np.ndarray:
    """True state and sensor sample at each tick, the drives holding the start pose."""
    command, rows = holding(), []
    plant.power(True)
    for _ in range(ticks):
        sample = plant.sense()
        raw = np.frombuffer(sample.to_bytes(), np.uint8).astype(float)
        rows.append(np.concatenate([plant.data.qpos, plant.data.qvel, raw]))
        plant.step(command)
    return np.array(rows)


def scenario(seed: int) -> Scenario:
    return Scenario(
        draw=Draw.from_seed(seed),
        gantry=(GantryMove(t=0.1, height=1.0, speed=0.5),),
        pushes=(Push(t=0.3, duration=0.05, force=(50.0, 20.0, 0.0)),),
    )


def test_same_seed_is_the_same_to_the_last_bit_and_reset_repeats_it():
    plant = Plant(PlantConfig(), scenario(3))
    first = trajectory(plant, 500)
    np.testing.assert_array_equal(trajectory(Plant(PlantConfig(), scenario(3)), 500), first)
    plant.reset()
    np.testing.assert_array_equal(trajectory(plant, 500), first)


def test_another_seed_is_another_robot():
    first, second = (trajectory(Plant(PlantConfig(), scenario(seed)), 50) for seed in (3, 4))
    assert (first[0] != second[0]).any()
    assert np.abs(first[-1] - second[-1])[:3].max() > 1e-6


def test_reset_after_a_refusal_and_a_late_push_is_clean():
    plant, fresh = Plant(PlantConfig(), scenario(3)), Plant(PlantConfig(), scenario(3))
    plant.power(True)
    bad = holding()
    bad.torque[0] = math.nan
    with pytest.raises(CommandError):
        plant.step(bad)
    plant.events.push(Push(t=0.0, duration=10.0, force=(500.0, 0.0, 0.0)), 0)
    for _ in range(20):
        plant.step(None)
    plant.reset()
    np.testing.assert_array_equal(trajectory(plant, 200), trajectory(fresh, 200))


@pytest.mark.parametrize("rate", [500, 1000, 2000])
def test_control_rates(rate):
    plant = Plant(PlantConfig(control_rate=rate))
    plant.power(True)
    for tick in range(rate // 10):
        sample = plant.sense()
        assert int(sample.seq) == tick
        assert sample.stamp_ns == tick * 1_000_000_000 // rate
        plant.step(holding())
    assert plant.time == pytest.approx(0.1)
    assert plant.data.time == pytest.approx(0.1)


EVENTFUL = Scenario(
    delays=Delays(torque=0.001, set_point=0.0035),
    gantry=(GantryMove(t=0.0205, height=1.1, speed=0.5), GantryMove(t=0.0315, action="release")),
    pushes=(
        Push(t=0.0115, duration=0.0225, force=(80.0, 40.0, 0.0)),
        Push(t=0.0605, duration=0.003, force=(0.0, 40.0, 0.0), body="left_shin"),
    ),
)


@pytest.mark.parametrize("sensors", ["ideal", "faithful"])
@pytest.mark.parametrize("events", [Scenario(), EVENTFUL], ids=["quiet", "eventful"])
def test_physics_does_not_depend_on_the_control_rate(sensors, events):
    ends = []
    for rate in (500, 1000, 2000):
        plant = Plant(PlantConfig(control_rate=rate, sensors=sensors), events)
        plant.power(True)
        command = holding()
        for _ in range(rate // 10):
            plant.step(command)
        ends.append(plant.data.qpos.copy())
    np.testing.assert_array_equal(ends[1:], ends[:1] * 2)


def test_physics_is_that_of_mujoco():
    plant = Plant(IDEAL)
    plant.gantry.release()
    plant.data.qvel[6:] = np.linspace(-0.5, 0.5, plant.model.nv - 6)
    other = copy.copy(plant.data)
    for _ in range(25):
        plant.step(None)
    mujoco.mj_step(plant.model, other, nstep=100)
    np.testing.assert_array_equal(plant.data.qpos, other.qpos)
    np.testing.assert_array_equal(plant.data.sensordata, other.sensordata)


@pytest.mark.parametrize(
    ("config", "error", "message"),
    [
        (
            PlantConfig(control_rate=300),
            SimulationError,
            "control_rate = 300 Hz does not divide physics_rate = 2000 Hz",
        ),
        (
            PlantConfig(control_rate=500, physics_rate=1000),
            SimulationError,
            "physics_rate = 1000 Hz: faithful sensors are defined at 2000 Hz",
        ),
        (
            PlantConfig(control_rate=1500, physics_rate=3000, sensors="ideal"),
            SimulationError,
            "control_rate = 1500 Hz: its period is no whole number of ns",
        ),
        (PlantConfig(control_rate=0), ParameterError, "control_rate = 0 Hz is outside 50 .. 4000"),
        (PlantConfig(sensors="perfect"), ParameterError, "sensors = 'perfect' is not one of"),
    ],
)
def test_settings_that_do_not_go_together_are_refused(config, error, message):
    with pytest.raises(error, match=message):
        Plant(config)


def test_other_physics_rates_go_with_ideal_sensors():
    plant = Plant(PlantConfig(physics_rate=4000, control_rate=1000, sensors="ideal"))
    plant.step(None)
    assert (plant.substeps, plant.time) == (4, pytest.approx(0.001))


def test_an_unknown_scene_is_refused():
    with pytest.raises(SimulationError, match="unknown scene flt: did you mean flat"):
        Plant(IDEAL, Scenario(scene="flt"))


def test_ideal_sample_is_the_true_state():
    plant = Plant(IDEAL)
    trajectory(plant, 30)
    sample = plant.sense()
    for index, name in enumerate(("left_hip_roll", "left_hip_yaw", "left_hip_pitch", "left_knee")):
        assert sample.drive_position[index] == plant.data.joint(name).qpos[0]
        assert sample.drive_velocity[index] == plant.data.joint(name).qvel[0]
    assert sample.joint_position[4] == plant.data.joint("right_tarsus").qpos[0]
    np.testing.assert_array_equal(sample.orientation, plant.pelvis_pose[1][[1, 2, 3, 0]])


def test_faithful_sample_is_near_the_true_state():
    plant = Plant(PlantConfig())
    trajectory(plant, 300)
    sample, data = plant.sense(), plant.data
    assert sample.drive_position[3] == pytest.approx(data.joint("left_knee").qpos[0], abs=1e-4)
    assert sample.joint_position[0] == pytest.approx(data.joint("left_shin").qpos[0], abs=2e-3)
    np.testing.assert_allclose(sample.linear_acceleration[2], 9.81, atol=0.5)


@pytest.mark.parametrize("by", ["scenario", "hand"])
def test_released_robot_falls_freely(by):
    moves = (GantryMove(t=0.1, action="release"),) if by == "scenario" else ()
    plant = Plant(IDEAL, Scenario(gantry=moves))
    for _ in range(51):
        plant.step(None)
    if by == "hand":
        plant.gantry.release()
    before = rise(plant)
    for _ in range(50):
        plant.step(None)
    assert rise(plant) - before == pytest.approx(-9.81 * 0.1, abs=1e-3)


def rise(plant: Plant) -> float:
    """Upward velocity of the centre of mass. In m/s."""
    mujoco.mj_forward(plant.model, plant.data)
    mujoco.mj_subtreeVel(plant.model, plant.data)
    return float(plant.data.subtree_linvel[0, 2])


def test_hanging_robot_stays_hanging():
    plant = Plant(PlantConfig())
    trajectory(plant, 500)
    position, quaternion = plant.pelvis_pose
    assert position[2] == pytest.approx(1.12, abs=0.02)
    assert np.abs(position[:2]).max() < 0.02
    assert abs(quaternion[0]) > 0.999


def test_standing_start_has_its_soles_on_the_ground():
    plant = Plant(IDEAL, Scenario(start="standing"))
    assert lowest_sole(plant.model, plant.data) == pytest.approx(0.0, abs=1e-6)
    height = plant.pelvis_pose[0][2]
    assert height == pytest.approx(1.0, abs=0.03)
    trajectory(plant, 300)
    assert not plant.gantry.attached
    assert plant.pelvis_pose[0][2] == pytest.approx(height - 0.03, abs=0.03)


def test_drawn_robot_and_factors_are_in_the_model():
    plain = Plant(IDEAL).model
    draw = Draw(mass=1.02, friction=0.9, initial_yaw=0.03, joint_offset=(0.01,) * 10)
    scale = ModelScale(mass=1.1, spring=0.8, friction=0.5, damping=2.0, armature=1.5, torque=1.2)
    plant = Plant(IDEAL, Scenario(draw=draw, model=scale))
    model = plant.model
    assert model.body_mass.sum() == pytest.approx(33.312 * 1.02 * 1.1)
    np.testing.assert_allclose(model.body_inertia, plain.body_inertia * 1.02 * 1.1)
    np.testing.assert_allclose(model.jnt_stiffness, plain.jnt_stiffness * 0.8)
    np.testing.assert_allclose(model.dof_damping, plain.dof_damping * 2.0)
    np.testing.assert_allclose(model.dof_armature, plain.dof_armature * 1.5)
    ground = model.geom("ground").id
    assert model.geom_friction[ground, 0] == pytest.approx(0.9 * 0.5)
    assert 2.0 * math.asin(plant.pelvis_pose[1][3]) == pytest.approx(0.03)
    expected = np.tile(STANDING_DRIVES, 2) + 0.01
    np.testing.assert_allclose(plant.sense().drive_position, expected)


def test_a_payload_moves_the_mass_of_the_pelvis_as_far_as_it_weighs():
    plain = Plant(IDEAL).model
    draw = Draw(mass=1.02)
    loaded = Plant(IDEAL, Scenario(draw=draw, payload=Payload(mass=8.0, y=0.05))).model
    pelvis = plain.body("pelvis").id
    assert loaded.body_mass.sum() == pytest.approx(33.312 * 1.02 + 8.0)
    assert loaded.body_subtreemass[pelvis] == pytest.approx(33.312 * 1.02 + 8.0)
    place = loaded.body("payload").pos
    np.testing.assert_allclose(place - plain.body_ipos[pelvis], [0.0, 0.05, 0.1], atol=1e-12)
    np.testing.assert_allclose(loaded.body("payload").inertia, 0.4 * 8.0 * 0.08**2)
    assert Plant(IDEAL, Scenario(payload=Payload())).model.nbody == plain.nbody


def test_sample_is_written_in_place():
    plant = Plant(IDEAL)
    assert plant.sense() is plant.sense()
    assert isinstance(plant.sense(), Sensors)
