"""The invariant filter: its covariance, slipping feet, flight, gravity."""

from __future__ import annotations

import math

import numpy as np
import pytest
from closed_loop import PERIOD, Robot
from kinematic_gaits import kinematic_library
from robot_states import leg_joints

from cassie_control.config import ControllerConfig, WalkConfig
from cassie_control.estimator.choice import make_estimator
from cassie_control.estimator.config import EstimatorConfig, FilterConfig
from cassie_control.estimator.invariant import move_origin
from cassie_msgs.experiment.scenario import Draw, Scenario
from cassie_msgs.layout import RobotMode, RobotState, Sensors


def replay(moments, **parameters):
    """States that a filter with these parameters gives for recorded samples."""
    core = make_estimator(EstimatorConfig(filter=FilterConfig(**parameters)), PERIOD)
    sample = Sensors()
    for moment in moments:
        sample.load(moment.sample)
        state = RobotState()
        state.copy_from(core.step(sample))
        yield moment, state


@pytest.fixture(scope="module")
def on_ice():
    """Steps in place on smooth ground, pushed so that the feet slide; the law lets them."""
    walk = WalkConfig(friction=2.0)
    scenario = Scenario.from_mapping(
        {
            "start": "standing",
            "scene_parameters": {"friction": 0.28},
            "pushes": [{"t": 5.1, "duration": 0.2, "force": [0.0, -80.0, 0.0]}],
        }
    )
    robot = Robot(
        scenario, "faithful", ControllerConfig(walk=walk), library=kinematic_library(), record=True
    )
    robot.ask(height=0.98)
    robot.run(1.8)
    robot.ask(mode=int(RobotMode.WALK))
    robot.run(4.0)
    return robot


def test_errors_are_as_large_as_the_covariance_says(walked_faithful):
    rows = []
    for moment, state in replay(walked_faithful.moments):
        if moment.time > 1.0:
            errors = [*(state.q[4:6] - moment.angles[1:]), *(state.v[:3] - moment.velocity)]
            rows.append(np.array(errors) / np.sqrt(state.covariance[4:9]))
    ratio = np.sqrt((np.array(rows) ** 2).mean(axis=0))
    assert (ratio < 2.0).all()
    assert (ratio > 0.05).all()


@pytest.mark.parametrize("metres", [30.0, 3e3, 3e5])
def test_far_from_the_start_the_estimate_is_as_accurate(walked_faithful, metres):
    here, there = (make_estimator(EstimatorConfig(), PERIOD) for _ in range(2))
    there._state.q[:2] = metres, -metres
    sample = Sensors()
    for moment in walked_faithful.moments:
        sample.load(moment.sample)
        near, far = here.step(sample), there.step(sample)
        assert far.v == pytest.approx(near.v, abs=1e-7)
        assert far.q[2:6] == pytest.approx(near.q[2:6], abs=1e-7)
        assert far.q[:2] - (metres, -metres) == pytest.approx(near.q[:2], abs=1e-6)
        assert far.covariance == pytest.approx(near.covariance, rel=1e-3)


def test_a_moved_origin_does_not_change_the_estimate(walked_faithful):
    still, moved = (make_estimator(EstimatorConfig(), PERIOD) for _ in range(2))
    sample = Sensors()
    for moment in walked_faithful.moments:
        sample.load(moment.sample)
        one, other = still.step(sample), moved.step(sample)
        for field in ("q", "v", "covariance"):
            assert getattr(other, field) == pytest.approx(getattr(one, field), rel=1e-6, abs=1e-9)
        move_origin(moved._filter.records, 1e-3)
    assert np.any(moved._filter.origin)


def test_an_asymmetry_of_the_covariance_does_not_stay(walked_faithful):
    """It added up: after 22 minutes on level ground the filter diverged, and the robot fell."""
    core = make_estimator(EstimatorConfig(), PERIOD)
    sample = Sensors()
    sample.load(walked_faithful.moments[0].sample)
    core.step(sample)
    covariance = core._filter.covariance
    covariance[3, 6] += 1e-6
    core.step(sample)
    assert np.abs(covariance - covariance.T).max() < 1e-15


def test_a_foot_that_slips_is_rejected(on_ice):
    def speed_errors(gate):
        return np.array(
            [
                np.linalg.norm(state.v[:2] - moment.velocity[:2])
                for moment, state in replay(on_ice.moments, slip_gate=gate)
                if moment.time > 3.0
            ]
        )

    assert not on_ice.fallen
    ungated, gated = speed_errors(100.0), speed_errors(3.0)
    assert gated.max() < 0.06
    assert ungated.max() > 10.0 * gated.max()  # a filter that holds on to sliding feet diverges
    assert math.sqrt((gated**2).mean()) < 0.025


def test_flight_is_carried_by_the_imu(walked_faithful):
    core = make_estimator(EstimatorConfig(), PERIOD)
    sample = Sensors()
    standing = [m for m in walked_faithful.moments if m.activity == "standing"][300:]
    for moment in standing:
        sample.load(moment.sample)
        before = core.step(sample).v[:3].copy()
    joints = leg_joints()
    sample.joint_position[:] = [*joints[4:6], joints[6]] * 2
    sample.drive_position[:] = [*joints[:4], joints[6]] * 2
    sample.angular_velocity[:] = 0.0
    sample.linear_acceleration[:] = 0.0
    for _ in range(150):
        state = core.step(sample)
    assert state.contact_probability.max() < 0.1
    assert state.v[:3] - before == pytest.approx([0.0, 0.0, -9.81 * 150 * PERIOD], abs=0.02)


def test_gravity_under_the_feet_corrects_the_imus_tilt():
    bias = (0.012, -0.01)
    scenario = Scenario(start="standing", draw=Draw(attitude_bias=bias, sensor_seed=4))
    robot = Robot(scenario, "faithful", record=True)
    robot.run(8.0)
    last = robot.moments[-1]
    error = last.q[4:6] - last.angles[1:]
    assert np.abs(error).max() < 0.0025  # roll and pitch of the IMU are off by four times that
    assert np.hypot(*(last.q[:2] - last.position[:2])) < 0.05


def test_a_vehicles_acceleration_is_not_taken_for_the_gyros_bias(walked_faithful):
    """For a minute it speeds up and slows down under feet that stand still on it."""
    core, sample = make_estimator(EstimatorConfig(), PERIOD), Sensors()
    sample.load(next(m for m in walked_faithful.moments if m.activity == "standing").sample)
    measured = sample.angular_velocity.copy()
    force = float(sample.linear_acceleration[0])
    errors = []
    for tick in range(round(60.0 / PERIOD)):
        seconds = tick * PERIOD
        sample.linear_acceleration[0] = force + (0.5 if seconds % 20.0 < 10.0 else -0.5)
        found = core.step(sample).angular_velocity
        errors.append(float(np.abs(found - measured).max()))
    assert max(errors) < 2e-4


def test_noise_may_change_while_it_runs(walked_faithful):
    core = make_estimator(EstimatorConfig(), PERIOD)
    sample = Sensors()
    sample.load(walked_faithful.moments[1000].sample)
    core.step(sample)
    certain = core.step(sample).covariance[9]
    core.config = EstimatorConfig(filter=FilterConfig(gyro_noise=0.1))
    assert core.step(sample).covariance[9] > 100.0 * certain
