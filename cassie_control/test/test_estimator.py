"""The state estimate against the truth, and samples that it must refuse."""

from __future__ import annotations

import math

import numpy as np
import pytest
from closed_loop import PERIOD, Robot
from robot_states import leg_joints

from cassie_control.errors import SensorError
from cassie_control.estimator.choice import make_estimator, make_monitored
from cassie_control.estimator.config import ESTIMATORS, EstimatorConfig
from cassie_gaits.robot import WEIGHT
from cassie_msgs.experiment.scenario import Scenario
from cassie_msgs.layout import Sensors
from cassie_msgs.tunables import entries, replace_checked
from cassie_sim.plant import Plant, PlantConfig


def errors(robot, activity, kind):
    """Estimate minus truth of velocity (n, 3), height (n,), angles (n, 3) and forces (n, 2).

    The last is whether both feet have carried for 0.1 s: a landing shakes the springs. Shape (n,).
    """
    core, sample = make_estimator(EstimatorConfig(estimator=kind), PERIOD), Sensors()
    rows, landed = [], 0
    for m in robot.moments:
        sample.load(m.sample)
        state = core.step(sample)
        landed = landed + 1 if min(m.forces) > 20.0 else 0
        if m.activity == activity and m.time > 1.0:
            q = state.q
            velocity, forces = state.v[:3] - m.velocity, state.foot_force - m.forces
            rows.append(
                [
                    *velocity,
                    q[2] - m.position[2],
                    *(q[3:6] - m.angles),
                    *forces,
                    landed > 0.1 / PERIOD,
                ]
            )
    table = np.array(rows)
    return table[:, :3], table[:, 3], table[:, 4:7], table[:, 7:9], table[:, 9] > 0.0


def rms(values):
    return np.sqrt((values**2).mean(axis=0))


@pytest.mark.parametrize("activity", ["standing", "walking"])
@pytest.mark.parametrize(
    ("kind", "speed", "tilt"),
    [("kinematic", (0.03, 0.02, 0.01), 1e-9), ("invariant", (0.01, 0.01, 0.005), 2e-3)],
)
def test_truth_with_ideal_sensors(walked, activity, kind, speed, tilt):
    velocity, height, angles, forces, landed = errors(walked, activity, kind)
    assert (rms(velocity) < speed).all()
    assert np.abs(height).max() < 2e-3
    assert np.abs(angles).max() < tilt
    assert (rms(forces) < 40.0).all()
    if activity == "standing":
        assert (rms(forces[landed]) < 2.0).all()


@pytest.mark.parametrize("activity", ["standing", "walking"])
@pytest.mark.parametrize(
    ("kind", "speed"), [("kinematic", (0.08, 0.03, 0.03)), ("invariant", (0.01, 0.01, 0.005))]
)
def test_truth_with_faithful_sensors(walked_faithful, activity, kind, speed):
    velocity, height, angles, forces, _ = errors(walked_faithful, activity, kind)
    assert (rms(velocity) < speed).all()
    assert np.abs(height).max() < 3e-3
    assert np.abs(angles).max() < math.radians(0.5)
    assert (rms(forces) < (5.0 if activity == "standing" else 40.0)).all()


def test_load_and_contact_follow_the_foot_force(walked):
    carried = walked.moments[-1].foot_force.sum()
    assert carried == pytest.approx(WEIGHT, rel=0.03)
    assert (walked.state.contact_probability > 0.9).all()
    force = walked.state.foot_force
    assert walked.state.foot_load == pytest.approx(np.clip((force - 100.0) / 100.0, 0.0, 1.0))


def sample(yaw=0.0, pitch=0.0, roll=0.0, seq=0):
    """Cassie hanging still at these angles."""
    sensors = Sensors()
    c, s = np.cos(np.array([roll, pitch, yaw]) / 2), np.sin(np.array([roll, pitch, yaw]) / 2)
    sensors.orientation[:] = (
        s[0] * c[1] * c[2] - c[0] * s[1] * s[2],
        c[0] * s[1] * c[2] + s[0] * c[1] * s[2],
        c[0] * c[1] * s[2] - s[0] * s[1] * c[2],
        c[0] * c[1] * c[2] + s[0] * s[1] * s[2],
    )
    hip_roll, hip_yaw, hip_pitch, knee, shin, tarsus, toe = leg_joints(hip_roll=0.05)
    sensors.drive_position[:] = (hip_roll, hip_yaw, hip_pitch, knee, toe) * 2
    sensors.joint_position[:] = (shin, tarsus, toe) * 2
    up = (-math.sin(pitch), math.cos(pitch) * math.sin(roll), math.cos(pitch) * math.cos(roll))
    sensors.linear_acceleration[:] = 9.81 * np.array(up)
    sensors.power[...] = 1.0
    sensors.seq[...] = seq
    sensors.stamp_ns = seq * 2_000_000
    return sensors


@pytest.fixture(params=ESTIMATORS)
def estimator(request):
    return lambda: make_estimator(EstimatorConfig(estimator=request.param), PERIOD)


@pytest.mark.parametrize(
    "angles", [(0.0, 0.0, 0.0), (0.4, 0.2, -0.3), (-2.8, -0.5, 0.7), (3.1, 1.2, -1.3)]
)
def test_euler_angles_are_intrinsic_yaw_pitch_roll(angles, estimator):
    state = estimator().step(sample(*angles))
    assert state.q[3:6] == pytest.approx(angles, abs=1e-12)


def test_euler_rates_are_the_derivatives_of_the_angles():
    angles, rates, dt = np.array([0.4, 0.3, -0.5]), np.array([0.7, -0.4, 0.9]), 1e-6
    yaw, pitch, roll = angles
    sensors = sample(yaw, pitch, roll)
    sensors.angular_velocity[:] = (
        rates[2] - rates[0] * math.sin(pitch),
        rates[1] * math.cos(roll) + rates[0] * math.cos(pitch) * math.sin(roll),
        -rates[1] * math.sin(roll) + rates[0] * math.cos(pitch) * math.cos(roll),
    )
    core = make_estimator(EstimatorConfig(estimator="kinematic"), PERIOD)
    assert core.step(sensors).v[3:6] == pytest.approx(rates, abs=1e-9)
    # The same rates turn the orientation as the gyro says.
    before, after = sample(*angles), sample(*(angles + dt * rates))
    change = np.abs(before.orientation @ after.orientation)
    turned = 2.0 * math.acos(min(1.0, change)) / dt
    assert turned == pytest.approx(np.linalg.norm(sensors.angular_velocity), rel=1e-3)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_yaw_counts_on_beyond_half_a_turn(direction, estimator):
    core = estimator()
    for step in range(200):
        yaw = direction * 0.1 * step
        sensors = sample(math.remainder(yaw, 2.0 * math.pi))
        sensors.angular_velocity[2] = direction * 0.1 / PERIOD
        assert core.step(sensors).q[3] == pytest.approx(yaw, abs=0.11)  # the IMU is late by a tick


def test_height_is_that_of_the_soles_from_the_first_sample_on(estimator):
    plant = Plant(PlantConfig(sensors="ideal"), Scenario(start="standing"))
    state = estimator().step(plant.sense())
    assert state.q[2] == pytest.approx(plant.pelvis_pose[0][2], abs=2e-3)


def test_stamp_seq_and_episode_are_those_of_the_sample(estimator):
    sensors = sample(seq=7)
    sensors.episode[...] = 3
    state = estimator().step(sensors)
    assert (int(state.seq), int(state.episode), state.stamp_ns) == (7, 3, 14_000_000)


def spoiled(name, value):
    field, _, index = name.partition("[")
    sensors = sample(0.5)
    getattr(sensors, field)[int(index[:-1]) if index else ...] = value
    return sensors


@pytest.mark.parametrize("name", ["orientation[2]", "drive_velocity[9]", "joint_position[0]"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -1e300])
def test_a_value_that_is_no_number_is_refused_by_name(name, value, estimator):
    core = estimator()
    core.step(sample(0.1))
    before = core.step(sample(0.2)).to_bytes()
    with pytest.raises(SensorError, match=name.replace("[", r"\[").replace("]", r"\]")):
        core.step(spoiled(name, value))
    undisturbed = estimator()
    undisturbed.step(sample(0.1))
    assert undisturbed.step(sample(0.2)).to_bytes() == before
    assert core.step(sample(0.3)).to_bytes() == undisturbed.step(sample(0.3)).to_bytes()


@pytest.mark.parametrize("value", [math.nan, math.inf, -1e300])
def test_a_battery_gauge_that_fails_changes_nothing(value, estimator):
    state = estimator().step(spoiled("battery[0]", value)).to_bytes()
    assert state == estimator().step(sample(0.5)).to_bytes()


def test_an_orientation_of_no_length_is_refused(estimator):
    sensors = sample()
    sensors.orientation[:] = 0.0
    with pytest.raises(SensorError, match="orientation is a quaternion of length 0, must be 1"):
        estimator().step(sensors)


def test_reset_forgets_everything(estimator):
    core, fresh = estimator(), estimator()
    for yaw in (0.0, 1.5, 3.0, -1.8):
        core.step(sample(yaw))
    core.reset()
    assert core.step(sample(0.3)).to_bytes() == fresh.step(sample(0.3)).to_bytes()


@pytest.mark.parametrize(
    "model", [{"mass": 0.9, "spring": 1.2}, {"mass": 1.1, "spring": 0.8}], ids=["stiff", "soft"]
)
def test_feet_carry_the_weight_whatever_springs_and_mass_are(model, estimator):
    scenario = Scenario.from_mapping({"start": "standing", "model": model})
    robot = Robot(scenario, "faithful")
    robot.estimator = estimator()
    robot.run(8.0)
    assert robot.state.foot_force.sum() == pytest.approx(WEIGHT, rel=0.03)


def test_weight_that_the_gantry_carries_is_not_made_up_for(estimator):
    scenario = Scenario.from_mapping({"start": "gantry"})
    robot = Robot(scenario, "faithful")
    robot.estimator = estimator()
    robot.run(4.0)
    assert robot.state.foot_force.sum() < 0.1 * WEIGHT


@pytest.mark.parametrize("kind", ESTIMATORS)
@pytest.mark.parametrize(
    "entry", [e for e in entries(EstimatorConfig()) if e.spec.live], ids=lambda entry: entry.name
)
def test_a_live_parameter_takes_effect_in_a_running_estimator(kind, entry):
    """The sensor monitor kept the delay of the IMU's orientation with which it was made."""
    before = EstimatorConfig(estimator=kind)
    after = replace_checked(before, **{entry.name: entry.spec.high})
    running = make_monitored(before, PERIOD)
    running.config = after

    def numbers(estimator):
        limits, core = estimator._monitor._limits, estimator.core
        filters = [vars(core)[name] for name in ("_filter", "_noise") if name in vars(core)]
        return [record.records.tobytes() for record in (limits, core._body, *filters)]

    assert numbers(running) == numbers(make_monitored(after, PERIOD))
