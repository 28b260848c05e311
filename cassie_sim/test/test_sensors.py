"""Sensors: counts, filters with the delays of the real ones, noise, the VN-100's errors, truth."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cassie_gaits import robot
from cassie_gaits.names import LEG_DRIVES
from cassie_msgs.layout import Sensors
from cassie_sim.sensors import FaithfulSensors, IdealSensors, ImuErrors

PHYSICS, CONTROL = 0.0005, 0.002
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
EXACT = ImuErrors(wander=0.0, gyro_noise=0.0, accelerometer_noise=0.0)
COUNT = np.array(
    [2 * math.pi / (2 ** robot.DRIVES[n].encoder_bits * robot.DRIVES[n].gear) for n in LEG_DRIVES]
    * 2
)
TOE_COUNT = 2.0 * math.pi / 2**13
SHIN_COUNT = 2.0 * math.pi / 2**18


def faithful(errors: ImuErrors = EXACT, period: float = CONTROL, seed: int = 0) -> FaithfulSensors:
    sensors = FaithfulSensors(period, PHYSICS, errors, np.random.default_rng(seed))
    sensors.reset(*measured())
    return sensors


def measured(position=0.0, joints=0.0, quaternion=UPRIGHT, imu=0.0) -> tuple[np.ndarray, ...]:
    angles = np.concatenate([np.broadcast_to(position, 10), np.broadcast_to(joints, 6)])
    return angles.astype(float), np.zeros(16), np.array(quaternion, float), np.full(6, float(imu))


def written(sensors: IdealSensors) -> Sensors:
    sample = Sensors()
    sensors.write(sample)
    return sample


@pytest.mark.parametrize(
    ("turns", "counts"), [(0.9, 0), (1.9, 1), (-0.9, 0), (-1.9, -1), (-2.1, -2), (1000.5, 1000)]
)
def test_drive_encoders_truncate_toward_zero(turns, counts):
    sensors = faithful()
    sensors.observe(*measured(position=turns * COUNT))
    np.testing.assert_allclose(sensors.position, counts * COUNT, atol=1e-15)


@pytest.mark.parametrize(("turns", "counts"), [(1.9, 1), (-1.9, -1), (-0.9, 0)])
def test_toe_encoder_truncates_toward_zero_without_noise(turns, counts):
    sensors = faithful()
    sensors.observe(*measured(joints=turns * TOE_COUNT))
    toes = written(sensors).joint_position[[2, 5]]
    np.testing.assert_allclose(toes, counts * TOE_COUNT, atol=1e-15)


def gain_and_lag(velocity_of, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """A velocity filter under constant acceleration: gain, and how far it is behind in s."""
    acceleration, sensors = 2000.0, faithful()
    times, velocities = [], []
    for step in range(1, round(seconds / PHYSICS) + 1):
        time = step * PHYSICS
        angle = 0.5 * acceleration * time**2
        sensors.observe(*measured(position=angle, joints=angle))
        if time > 0.5 * seconds:
            times.append(time)
            velocities.append(velocity_of(sensors) / acceleration)
    slope, start = np.polyfit(times, velocities, 1)
    return slope, -start / slope


def test_drive_velocity_is_half_a_millisecond_behind():
    gain, lag = gain_and_lag(lambda sensors: sensors.velocity.copy(), 0.05)
    np.testing.assert_allclose(gain, 1.0, atol=2e-3)
    np.testing.assert_allclose(lag, 0.52e-3, atol=0.02e-3)


def test_joint_velocity_is_four_and_a_half_milliseconds_behind():
    gain, lag = gain_and_lag(lambda sensors: written(sensors).joint_velocity.copy(), 0.2)
    np.testing.assert_allclose(gain, 1.0, atol=3e-3)
    np.testing.assert_allclose(lag, 4.5e-3, atol=0.02e-3)


def test_joint_velocity_filter_halves_the_power_at_53_hz():
    frequency, sensors, answers = 53.0, faithful(), []
    for step in range(2000):
        time = step * PHYSICS
        angle = math.sin(2.0 * math.pi * frequency * time)
        sensors.observe(*measured(joints=angle))
        answers.append(float(written(sensors).joint_velocity[0]))
    swing = np.std(answers[1000:]) * math.sqrt(2.0) / (2.0 * math.pi * frequency)
    assert swing == pytest.approx(math.sqrt(0.5), rel=0.02)


@pytest.mark.parametrize("rate", [3.0, -0.7])
def test_constant_rate_is_measured_right(rate):
    sensors = faithful()
    velocity, joint_velocity = [], []
    for step in range(400):
        angle = rate * step * PHYSICS
        sensors.observe(*measured(position=angle, joints=angle))
        if step >= 200:
            velocity.append(sensors.velocity.copy())
            joint_velocity.append(written(sensors).joint_velocity.copy())
    np.testing.assert_allclose(np.mean(velocity, axis=0), rate, atol=0.02)
    np.testing.assert_allclose(np.mean(joint_velocity, axis=0), rate, atol=0.02)


def test_at_rest_after_reset():
    sensors = FaithfulSensors(CONTROL, PHYSICS, EXACT, np.random.default_rng(0))
    start = measured(position=0.7, joints=-0.4)
    sensors.reset(*start)
    np.testing.assert_allclose(sensors.position, 0.7, atol=COUNT.max())
    np.testing.assert_allclose(sensors.velocity, 0.0, atol=1e-9)


def test_joint_noise_is_2e_4_on_shin_and_tarsus_only():
    sensors, readings = faithful(), []
    for _ in range(4000):
        sensors.observe(*measured(joints=1.0))
        readings.append(written(sensors).joint_position.copy())
    spread = np.std(readings, axis=0)
    springs = spread[[0, 1, 3, 4]]
    np.testing.assert_allclose(springs, math.hypot(2e-4, SHIN_COUNT / math.sqrt(12)), rtol=0.05)
    np.testing.assert_allclose(spread[[2, 5]], 0.0, atol=1e-12)


def imu_samples(errors: ImuErrors, count: int, period: float = CONTROL) -> list[np.ndarray]:
    """Orientation x y z w, angular velocity and acceleration of a robot at rest."""
    sensors = faithful(errors, period)
    rows = []
    for _ in range(count):
        sensors.observe(*measured())
        sample = written(sensors)
        rows.append(
            np.concatenate(
                [sample.orientation, sample.angular_velocity, sample.linear_acceleration]
            )
        )
    return rows


def test_imu_noise_density_and_bias():
    errors = ImuErrors(gyro_bias=(1e-3, 0.0, -1e-3), accelerometer_bias=(0.0, 0.1, -0.1))
    rates = np.array(imu_samples(errors, 8000))[:, 4:]
    bandwidth = 0.5 / CONTROL
    gyro = math.radians(0.0035) * math.sqrt(bandwidth)
    accelerometer = 0.14e-3 * 9.81 * math.sqrt(bandwidth)
    np.testing.assert_allclose(rates.std(axis=0)[:3], gyro, rtol=0.05)
    np.testing.assert_allclose(rates.std(axis=0)[3:], accelerometer, rtol=0.05)
    mean = rates.mean(axis=0)
    np.testing.assert_allclose(mean[:3], errors.gyro_bias, atol=5.0 * gyro / math.sqrt(8000))
    np.testing.assert_allclose(
        mean[3:], errors.accelerometer_bias, atol=5.0 * accelerometer / math.sqrt(8000)
    )


def test_attitude_error_is_a_bias_and_a_slow_wander():
    errors = ImuErrors(attitude_bias=(0.005, -0.004))
    tilt = 2.0 * np.array(imu_samples(errors, 20000, period=1.0))[:, :2]
    np.testing.assert_allclose(tilt.mean(axis=0), errors.attitude_bias, atol=3e-4)
    wander = tilt - tilt.mean(axis=0)
    np.testing.assert_allclose(wander.std(axis=0), math.radians(0.1), rtol=0.1)
    correlation = (wander[10:] * wander[:-10]).mean(axis=0) / wander.var(axis=0)
    np.testing.assert_allclose(correlation, math.exp(-1.0), atol=0.1)


def test_tilt_error_stays_in_the_pelvis_and_drift_in_the_world():
    tilted = FaithfulSensors(
        CONTROL,
        PHYSICS,
        ImuErrors(attitude_bias=(0.01, 0.0), wander=0.0, yaw_drift=0.5),
        np.random.default_rng(0),
    )
    turn = math.radians(90.0)
    heading = np.array([math.cos(turn / 2), 0.0, 0.0, math.sin(turn / 2)])
    tilted.reset(*measured(quaternion=heading))
    sample = written(tilted)
    x, y, z, w = sample.orientation
    # Roll 0.01 after a quarter turn to the left: the tilt is about the world's y axis.
    np.testing.assert_allclose([2 * (w * x + y * z), 2 * (w * y - x * z)], [0.01, 0.0], atol=1e-4)
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    assert yaw == pytest.approx(turn + 0.5 * CONTROL, abs=1e-4)


def test_attitude_is_two_milliseconds_late():
    sensors, yaws = faithful(), []
    for step in range(1, 9):
        turn = 0.01 * step
        sensors.observe(*measured(quaternion=(math.cos(turn / 2), 0, 0, math.sin(turn / 2))))
        yaws.append(2.0 * math.asin(written(sensors).orientation[2]))
    np.testing.assert_allclose(yaws[4:], 0.01 * np.arange(1, 5), atol=1e-9)
    np.testing.assert_allclose(yaws[:4], 0.0, atol=1e-9)


@pytest.mark.parametrize("make", [IdealSensors, faithful])
def test_imu_reports_the_mean_since_the_last_sample(make):
    sensors = make()
    for value in (1.0, 2.0, 3.0, 6.0):
        sensors.observe(*measured(imu=value))
    if make is IdealSensors:
        np.testing.assert_allclose(written(sensors).angular_velocity, 3.0)
    else:  # the sample at rest that `reset` took is in it
        np.testing.assert_allclose(written(sensors).angular_velocity, 2.4)
    sensors.observe(*measured(imu=5.0))
    np.testing.assert_allclose(written(sensors).linear_acceleration, 5.0)


def test_ideal_sensors_report_the_truth():
    rng = np.random.default_rng(1)
    truth = [rng.normal(size=size) for size in (16, 16, 4, 6)]
    sensors = IdealSensors()
    sensors.observe(*truth)
    sample = written(sensors)
    for field, expected in (
        ("drive_position", truth[0][:10]),
        ("drive_velocity", truth[1][:10]),
        ("joint_position", truth[0][10:]),
        ("joint_velocity", truth[1][10:]),
        ("orientation", truth[2][[1, 2, 3, 0]]),
        ("angular_velocity", truth[3][:3]),
        ("linear_acceleration", truth[3][3:]),
    ):
        np.testing.assert_array_equal(getattr(sample, field), expected)


def test_same_seed_same_noise():
    first, second, other = (
        np.array([written(sensors).joint_position.copy() for _ in range(5) if feed(sensors)])
        for sensors in (faithful(seed=3), faithful(seed=3), faithful(seed=4))
    )
    np.testing.assert_array_equal(first, second)
    assert (first != other).any()


def feed(sensors: IdealSensors) -> bool:
    sensors.observe(*measured(joints=1.0))
    return True
