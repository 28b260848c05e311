"""The sensor monitor: no false alarms, the name of a failing channel, and its substitute."""

from __future__ import annotations

import numpy as np
import pytest
from closed_loop import Robot
from faulty_samples import IN_TIME, LIMITS, monitored, reports, samples, spoil
from supervised import STAND, WALK

from cassie_control.errors import SensorError
from cassie_control.estimator.channels import CHANNELS, names
from cassie_gaits import robot
from cassie_gaits.names import LEG_DRIVES
from cassie_msgs.experiment.scenario import Scenario
from cassie_msgs.layout import Sensors

STEP = 150
TURN = (0, 1, 1, 0, -1, -1, 0)

FIELDS = [
    *("angular_velocity.1", "linear_acceleration.2", "drive_position.2", "drive_position.8"),
    *("drive_velocity.3", "drive_velocity.7", "drive_velocity.9", "joint_position.1"),
    *("joint_position.5", "joint_velocity.3"),
]


def test_healthy_sensors_raise_no_alarm(walked_faithful, walked):
    assert reports(samples(walked_faithful, 0)) == {}
    assert reports(samples(walked, 0)) == {}


@pytest.mark.parametrize("missing", [1, 3, 10])
def test_missing_samples_are_no_failure(walked_faithful, missing):
    rows = samples(walked_faithful, 1250)
    come = np.arange(len(rows)) % (17 + missing) < 17
    assert reports(rows, come) == {}


def test_what_fails_is_named_although_samples_are_missing(walked_faithful):
    rows = samples(walked_faithful, 1250)
    bad = spoil(rows, "drive_position.8", "nan", 200)
    come = np.arange(len(rows)) % 20 < 17
    first = reports(rows, come)
    assert first["drive_position.8"] <= bad[0] + IN_TIME
    assert set(first) == {"drive_position.8"}


@pytest.mark.parametrize("kind", ["off", "stuck", "nan", "spike"])
@pytest.mark.parametrize("channel", FIELDS)
def test_a_failing_channel_is_named_in_time(walked_faithful, channel, kind):
    rows = samples(walked_faithful, 1250)
    bad = spoil(rows, channel, kind, 200)
    first = reports(rows)
    assert len(bad)
    assert first.get(channel, 10**6) <= bad[0] + IN_TIME
    assert set(first) <= {channel}


# Between two steps it hardly accelerates; what falls into that is seen at the next touchdown.
@pytest.mark.parametrize(("ticks", "in_time"), [(10, IN_TIME), (20, STEP)], ids=["20ms", "40ms"])
@pytest.mark.parametrize("axis", range(3))
def test_a_late_accelerometer_is_named_in_time(walked_faithful, axis, ticks, in_time):
    channel, errors = f"linear_acceleration.{axis}", 0
    for start in (210, 420, 530):
        rows = samples(walked_faithful, 1250)
        values = rows["linear_acceleration"][:, axis]
        true = values.copy()
        values[start:] = true[start - ticks : -ticks]
        bad = np.flatnonzero(np.abs(values - true) > LIMITS["acceleration"])
        errors += len(bad)
        first = reports(rows)
        assert set(first) <= {channel}
        if len(bad):
            assert first.get(channel, 10**6) <= bad[0] + in_time
    assert errors > 0 or axis == 0  # fore and aft it hardly accelerates in place


@pytest.mark.parametrize("start", range(200, 500, 60))
def test_an_accelerometer_that_gets_late_is_named_while_it_waits(walked_faithful, start):
    rows = samples(walked_faithful, 1250)
    values = rows["linear_acceleration"][:, 1]
    true = values.copy()
    values[start : start + 10] = true[start]
    values[start + 10 :] = true[start:-10]
    assert start < reports(rows)["linear_acceleration.1"] < start + 10


@pytest.mark.parametrize("drive", range(10))
def test_a_torque_that_the_drive_cannot_give_is_named(walked_faithful, drive):
    limit = robot.DRIVES[LEG_DRIVES[drive % 5]].torque_limit
    rows = samples(walked_faithful, 1250)
    rows["drive_torque"][50, drive] = 1.4 * limit
    assert reports(rows) == {}
    rows["drive_torque"][60, drive] = -1.6 * limit
    assert reports(rows) == {f"drive_torque.{drive}": 60}


@pytest.fixture(scope="module")
def pushed():
    """Steps in place with springs and mass that are not the nominal ones, pushed three times."""
    pushes = [(4.0, (180.0, 0.0)), (5.6, (-90.0, 90.0)), (7.2, (0.0, -120.0))]
    scenario = {
        "start": "standing",
        "model": {"mass": 0.9, "spring": 1.2},
        "pushes": [{"t": t, "duration": 0.1, "force": (x, y, 0.0)} for t, (x, y) in pushes],
    }
    robot = Robot(Scenario.from_mapping(scenario), "faithful", record=True)
    robot.ask(height=0.98)
    robot.run(1.8)
    robot.ask(mode=int(WALK))
    robot.run(7.2)
    assert not robot.fallen
    return robot


def test_pushes_and_a_body_unlike_the_nominal_one_raise_no_alarm(pushed):
    assert reports(samples(pushed, 0)) == {}


def test_the_response_to_an_impact_is_no_late_accelerometer():
    push = {"t": 5.23, "duration": 0.04, "force": (-212.0, 212.0, 0.0)}
    robot = Robot(
        Scenario.from_mapping({"start": "standing", "pushes": [push]}), "faithful", record=True
    )
    robot.ask(height=0.98)
    robot.run(1.8)
    robot.ask(mode=int(WALK))
    robot.run(3.8)
    assert not robot.fallen
    assert reports(samples(robot, 0)) == {}


def landing(rate):
    """A joint that is turned this fast (rad/s) by a landing, and back: positions and velocities.

    The velocities are those of the joints' filter, see the facts about Cassie's sensors.
    """
    physics = np.interp(np.arange(120), [0, 14, 20, 34, 48, 54, 68], rate * np.array(TURN)) * 0.0005
    position, velocity = np.cumsum(physics), np.zeros(len(physics))
    before = np.concatenate([np.zeros(3), position])
    for k in range(len(velocity)):
        p, past = before[k : k + 4], velocity[max(0, k - 2) : k]
        velocity[k] = 12.348 * (p[3] + p[2] - p[1] - p[0])
        velocity[k] += past @ [-0.79045, 1.7658][-len(past) :] if k else 0.0
    return position[::4], velocity[::4]


@pytest.mark.parametrize("joint", range(6))
def test_a_hard_landing_is_no_failing_sensor(walked_faithful, joint):
    position, velocity = landing(17.0)
    for start in (300, 345):
        rows = samples(walked_faithful, 1250)
        place = slice(start, start + len(position))
        rows["joint_position"][place, joint] += position
        rows["joint_velocity"][place, joint] += velocity
        assert not any(name.startswith("joint") for name in reports(rows))


@pytest.mark.parametrize("axis", range(3))
def test_the_edges_of_a_push_are_no_spikes(walked_faithful, axis):
    rows = samples(walked_faithful, 1250)
    for start in (300, 320, 340):
        rows["linear_acceleration"][start : start + 10, axis] += 15.0
    named = reports(rows)
    assert set(named) <= {f"linear_acceleration.{axis}"}
    assert min(named.values(), default=10**6) > 320


@pytest.mark.parametrize("kind", ["off", "nan"])
def test_orientation_goes_on_with_the_gyro(walked_faithful, kind):
    rows = samples(walked_faithful, 1250)
    rows["orientation"][200:] = 0.0 if kind == "off" else np.nan
    core, sample = monitored(), Sensors()
    for k, moment in enumerate(walked_faithful.moments[1250:]):
        sample.load(rows[k].tobytes())
        state = core.step(sample)
        assert np.abs(state.q[4:6] - moment.angles[1:]).max() < 0.01
        if k > 150:  # the filter begins at rest, and this in the middle of a step
            assert np.abs(state.v[:3] - moment.velocity).max() < 0.05
    assert core.faults == ("orientation (IMU)",)
    assert int(state.sensor_faults) == 1


@pytest.mark.parametrize("channel", ["drive_position.3", "joint_position.1"])
def test_a_lost_position_goes_on_as_its_velocitys_integral(walked_faithful, channel):
    rows = samples(walked_faithful, 1250)
    field, _, index = channel.partition(".")
    true = rows[field][:, int(index)].copy()
    rows[field][200:, int(index)] = np.nan
    core, sample = monitored(), Sensors()
    joint = {"drive_position.3": 3, "joint_position.1": 5}[channel]
    for k in range(len(rows)):
        sample.load(rows[k].tobytes())
        state = core.step(sample)
        assert abs(state.q[6 + joint] - true[k]) < 0.04  # its filter is 4.5 ms late


def test_a_channel_that_recovers_is_accepted_again(walked_faithful):
    rows = samples(walked_faithful, 800)
    rows["drive_position"][300:310, 2] = np.nan
    core, sample, masks = monitored(), Sensors(), []
    for k in range(len(rows)):
        sample.load(rows[k].tobytes())
        masks.append(int(core.step(sample).sensor_faults))
    bit = 1 << [name for name, _ in CHANNELS].index("drive_position.2")
    assert masks[:300] == [0] * 300
    assert masks[300:800] == [bit] * 500
    assert masks[-1] == 0


def test_without_position_and_velocity_of_a_joint_there_is_no_estimate(walked_faithful):
    core, sample = monitored(), Sensors()
    sample.load(walked_faithful.moments[1250].sample)
    core.step(sample)
    sample.drive_position[3] = sample.drive_velocity[3] = np.nan
    with pytest.raises(SensorError, match=r"drive_position.3 \(left_knee\), drive_velocity.3"):
        core.step(sample)


@pytest.mark.parametrize("axis", range(3))
def test_without_orientation_and_an_axis_of_the_gyro_both_are_named(walked_faithful, axis):
    core, sample = monitored(), Sensors()
    sample.load(walked_faithful.moments[1250].sample)
    core.step(sample)
    sample.orientation[:] = sample.angular_velocity[axis] = np.nan
    with pytest.raises(SensorError, match=rf"orientation \(IMU\), angular_velocity.{axis}"):
        core.step(sample)


def test_a_toe_has_two_encoders(walked_faithful):
    core, sample = monitored(), Sensors()
    for moment in walked_faithful.moments[1250:1400]:
        sample.load(moment.sample)
        sample.drive_position[4] = sample.drive_velocity[4] = np.nan
        state = core.step(sample)
        assert abs(state.q[12] - moment.q[12]) < 0.005


def test_the_supervisor_stops_and_stands(walking):
    walking.state.sensor_faults[...] = 1 << 10
    walking.run(0.1)
    status = walking.core.status
    assert status.requested is STAND
    assert "stopping and standing without drive_position.3 (left_knee)" in status.faults
    walking.state.sensor_faults[...] = 0
    walking.run(0.1)
    assert walking.core.status.requested is WALK


def test_every_channel_has_a_bit_and_a_name():
    fields = ("orientation", "angular_velocity", "linear_acceleration", "drive_position")
    fields += ("drive_velocity", "joint_position", "joint_velocity", "drive_torque")
    sizes = {name: count for name, _, count in Sensors.LAYOUT}
    assert len(CHANNELS) == 1 + sum(sizes[field] for field in fields[1:])
    assert names(1 << 10 | 1) == ("orientation (IMU)", "drive_position.3 (left_knee)")
