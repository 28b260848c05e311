"""The robot's sensors: drive and joint encoders with their velocity filters, and the IMU.

There are two grades. `IdealSensors` reports the true values; `FaithfulSensors` counts, truncates,
filters, delays and adds noise like the parts on the robot. Both get the true state at every physics
step (`observe`), and write a `Sensors` sample at each control tick (`write`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cassie_gaits import robot
from cassie_gaits.compiled import compiled
from cassie_gaits.names import LEG_DRIVES, LEG_SENSED_JOINTS
from cassie_gaits.records import FloatArray, Record, RecordArray, Records, array, whole
from cassie_msgs.experiment.scenario import Draw
from cassie_msgs.layout import Sensors

TAPS = 9
"""Length of the drives' velocity filter, in physics steps."""


class SensorNumbers(Record):
    """Encoders, their filters and the IMU, see `IdealSensors`.

    Attributes:
        position, velocity: Measurements of the drives. In rad and rad/s.
        joints, joint_rates: Measurements of shin, tarsus and toe of both legs. In rad and rad/s.
        imu: Sums of the IMU's readings since the last sample. In rad/s and m/s^2.
        count: Number of readings in these sums.
        faithful: 1: encoders count; 0: the true values.
        counts_per_rad, joint_counts_per_rad: Resolutions of the encoders.
        taps: Velocity filter of the drives, newest first. In 1/s.
        counts: Ring buffer of the last counts, of which `newest` is the newest row.
        b, a: Velocity filter of the joints: feed-forward in 1/s, feedback after the leading 1.
        joint_x, joint_y: Last readings and velocities, newest first. In rad and rad/s.
        noise_row: Row of the joints' noise to add next.
        attitude_row: Row of the newest attitude.
        attitude_bias, wander: Roll and pitch error: constant part, and slow part. In rad.
        wander_decay, wander_sigma: Decay of the slow part from sample to sample, and standard
            deviation of the noise added to it.
        yaw_drift: Drift of the yaw. In rad/s.
        time: Time since the start. In s.
        period: Time between samples. In s.
        imu_sigma, imu_bias: Noise and bias of a sample. In rad/s and m/s^2.
    """

    position: FloatArray = array(10)
    velocity: FloatArray = array(10)
    joints: FloatArray = array(6)
    joint_rates: FloatArray = array(6)
    imu: FloatArray = array(6)
    count: int = whole()
    faithful: int = whole()
    counts_per_rad: FloatArray = array(10)
    joint_counts_per_rad: FloatArray = array(6)
    taps: FloatArray = array(TAPS)
    counts: FloatArray = array(TAPS, 10)
    newest: int = whole()
    b: FloatArray = array(4)
    a: FloatArray = array(2)
    joint_x: FloatArray = array(4, 6)
    joint_y: FloatArray = array(2, 6)
    noise_row: int = whole()
    attitude_row: int = whole()
    attitude_bias: FloatArray = array(2)
    wander: FloatArray = array(2)
    wander_decay: float
    wander_sigma: float
    yaw_drift: float
    time: float
    period: float
    imu_sigma: FloatArray = array(6)
    imu_bias: FloatArray = array(6)


@compiled
def _count_drives(sensor: SensorNumbers, position: FloatArray) -> None:
    """Read the drives' encoders: count, truncate toward zero, filter the velocity."""
    newest = sensor.newest + 1 if sensor.newest + 1 < sensor.taps.shape[0] else 0
    for i in range(10):
        per_rad = sensor.counts_per_rad[i]
        count = math.trunc(position[i] * per_rad)
        sensor.counts[newest, i] = count
        sensor.position[i] = count / per_rad
        total, row = 0.0, newest
        for k in range(sensor.taps.shape[0]):
            total += sensor.taps[k] * sensor.counts[row, i]
            row = row - 1 if row > 0 else sensor.taps.shape[0] - 1
        sensor.velocity[i] = total / per_rad
    sensor.newest = newest


@compiled
def _count_joints(sensor: SensorNumbers, joints: FloatArray, noise: FloatArray) -> None:
    """Read the encoders of shin, tarsus and toe: noise, counts, truncation, velocity filter."""
    x, y, a, b = sensor.joint_x, sensor.joint_y, sensor.a, sensor.b
    for i in range(6):
        per_rad = sensor.joint_counts_per_rad[i]
        x[3, i] = x[2, i]
        x[2, i] = x[1, i]
        x[1, i] = x[0, i]
        x[0, i] = math.trunc((joints[i] + noise[i]) * per_rad) / per_rad
        new = b[0] * x[0, i] + b[1] * x[1, i] + b[2] * x[2, i] + b[3] * x[3, i]
        new -= a[0] * y[0, i] + a[1] * y[1, i]
        y[1, i] = y[0, i]
        y[0, i] = new
        sensor.joints[i] = x[0, i]
        sensor.joint_rates[i] = new


@compiled
def observe(
    sensors: Records[SensorNumbers],
    attitudes: FloatArray,
    noise: FloatArray,
    angles: FloatArray,
    rates: FloatArray,
    quaternion: FloatArray,
    imu: FloatArray,
) -> None:
    """Take in one physics step.

    Args:
        sensors: Sensors, changed in place. Shape (1,).
        attitudes: Ring buffer of the last orientations, w x y z. Shape (delay + 1, 4).
        noise: Noise to add to the joints, one row per physics step. Shape (n, 6), in rad.
        angles: Angles of drives, then of shin, tarsus and toe. Shape (16,), in rad.
        rates: Rates of these angles. Shape (16,), in rad/s.
        quaternion: Pelvis to world, w x y z. Shape (4,).
        imu: Angular velocity and specific force, pelvis frame. Shape (6,), rad/s and m/s^2.
    """
    sensor = sensors[0]
    if sensor.faithful:
        _count_drives(sensor, angles[:10])
        _count_joints(sensor, angles[10:], noise[sensor.noise_row])
        sensor.noise_row += 1
    else:
        sensor.position[:] = angles[:10]
        sensor.velocity[:] = rates[:10]
        sensor.joints[:] = angles[10:]
        sensor.joint_rates[:] = rates[10:]
    row = sensor.attitude_row + 1 if sensor.attitude_row + 1 < attitudes.shape[0] else 0
    sensor.attitude_row = row
    attitudes[row] = quaternion
    for i in range(6):
        sensor.imu[i] += imu[i]
    sensor.count += 1


@compiled
def write_sample(
    sensors: Records[SensorNumbers], attitudes: FloatArray, noise: FloatArray, samples: RecordArray
) -> None:
    """Write the measured fields of a sample, and begin the next interval of the IMU's means.

    Args:
        sensors, attitudes: See `observe`.
        noise: Standard normal noise: angular velocity, acceleration, roll, pitch. Shape (8,).
        samples: Result, `Sensors.record`. Shape (1,).
    """
    sensor, sample = sensors[0], samples[0]
    sample.drive_position[:] = sensor.position
    sample.drive_velocity[:] = sensor.velocity
    sample.joint_position[:] = sensor.joints
    sample.joint_velocity[:] = sensor.joint_rates
    oldest = sensor.attitude_row + 1 if sensor.attitude_row + 1 < attitudes.shape[0] else 0
    _write_attitude(sensor, attitudes[oldest], noise[6:], sample.orientation)
    share = 1.0 / max(sensor.count, 1)
    for i in range(3):
        for k, out in ((i, sample.angular_velocity), (3 + i, sample.linear_acceleration)):
            error = noise[k] * sensor.imu_sigma[k] + sensor.imu_bias[k]
            out[i] = sensor.imu[k] * share + error
    sensor.imu[:] = 0.0
    sensor.count = 0


@compiled
def _write_attitude(
    sensor: SensorNumbers, quaternion: FloatArray, noise: FloatArray, orientation: FloatArray
) -> None:
    """Write the orientation x y z w, with the errors of the attitude filter if `faithful`."""
    w, x, y, z = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    if sensor.faithful:
        sensor.time += sensor.period
        for i in range(2):
            sensor.wander[i] *= sensor.wander_decay
            sensor.wander[i] += sensor.wander_sigma * noise[i]
        roll = 0.5 * (sensor.attitude_bias[0] + sensor.wander[0])
        pitch = 0.5 * (sensor.attitude_bias[1] + sensor.wander[1])
        yaw = 0.5 * sensor.yaw_drift * sensor.time
        # Tilt errors act in the pelvis frame (right product), the yaw error in the world (left).
        w, x, y, z = (
            w - x * roll - y * pitch,
            x + w * roll - z * pitch,
            y + w * pitch + z * roll,
            z + x * pitch - y * roll,
        )
        w, x, y, z = w - yaw * z, x - yaw * y, y + yaw * x, z + yaw * w
        scale = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
        w, x, y, z = w * scale, x * scale, y * scale, z * scale
    orientation[0], orientation[1], orientation[2], orientation[3] = x, y, z, w


# Velocity filter of the drives, on encoder counts, and of the joints: y = b x - a y.
_FIR = np.array(robot.DRIVE_VELOCITY_FILTER)
_IIR_B, _IIR_A = (np.array(taps) for taps in robot.JOINT_VELOCITY_FILTER)
# Number of physics steps for which noise is drawn at once.
_NOISE_BLOCK = 64

JOINT_NOISE = 2e-4
"""Standard deviation of the noise of shin and tarsus encoders. In rad."""


@dataclass(frozen=True)
class ImuErrors:
    """Errors of a VectorNav VN-100 and of the attitude filter in it.

    Attributes:
        attitude_bias: Constant roll and pitch error. In rad.
        gyro_bias: Constant gyro error. Shape (3,), in rad/s.
        accelerometer_bias: Constant accelerometer error. Shape (3,), in m/s^2.
        yaw_drift: Drift of the yaw. In rad/s.
        wander: Standard deviation of the slow roll and pitch error. In rad.
        wander_time: Correlation time of the slow roll and pitch error. In s.
        gyro_noise: Noise density of the gyro. In rad/s/sqrt(Hz).
        accelerometer_noise: Noise density of the accelerometer. In m/s^2/sqrt(Hz).
        delay: Latency of the attitude. In s.
    """

    attitude_bias: tuple[float, float] = (0.0, 0.0)
    gyro_bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    accelerometer_bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw_drift: float = 0.0
    wander: float = math.radians(0.1)
    wander_time: float = 10.0
    gyro_noise: float = math.radians(0.0035)
    accelerometer_noise: float = 0.14e-3 * robot.GRAVITY
    delay: float = 0.002


class IdealSensors:
    """The true values, with the IMU's readings as means since the last sample.

    Attributes:
        records: All numbers of the sensors, `SensorNumbers`. Shape (1,).
        attitudes: Ring buffer of the last orientations. Shape (delay + 1, 4).
        noise: Noise of the joints in the next physics steps. Shape (n, 6), in rad.
        position: Measured positions of the drives. Shape (10,), in rad.
        velocity: Measured velocities of the drives. Shape (10,), in rad/s.
    """

    def __init__(self) -> None:
        self._numbers = numbers = SensorNumbers()
        self.records = numbers.records
        self.attitudes = np.zeros((1, 4))
        self.noise = np.zeros((1, 6))
        self._sample_noise = np.zeros(8)
        self.position: FloatArray = numbers.position
        self.velocity: FloatArray = numbers.velocity

    def reset(
        self, angles: FloatArray, rates: FloatArray, quaternion: FloatArray, imu: FloatArray
    ) -> None:
        """Begin at rest with the arguments of `observe`."""
        self._numbers.count = 0
        self._numbers.imu[:] = 0.0
        self.observe(angles, rates, quaternion, imu)

    def observe(
        self, angles: FloatArray, rates: FloatArray, quaternion: FloatArray, imu: FloatArray
    ) -> None:
        """Take in one physics step.

        Args:
            angles: Angles of drives, then of shin, tarsus, toe of both legs. Shape (16,), in rad.
            rates: Rates of these angles. Shape (16,), in rad/s.
            quaternion: Pelvis to world, w x y z. Shape (4,).
            imu: Angular velocity and specific force, pelvis frame. Shape (6,), rad/s and m/s^2.
        """
        self.prepare(1)
        observe(self.records, self.attitudes, self.noise, angles, rates, quaternion, imu)

    def prepare(self, steps: int) -> None:
        """Draw the noise of the next physics steps, 64 at most."""

    def write(self, sample: Sensors, *, again: bool = False) -> None:
        """Fill in the measured fields of a sample and begin the next interval.

        Args:
            sample: Result.
            again: Whether to use the same noise as in the last call.
        """
        write_sample(self.records, self.attitudes, self._sample_noise, sample.record)


class FaithfulSensors(IdealSensors):
    """Encoders that count and truncate, their velocity filters, and a VN-100.

    The velocity filters are defined at 2 kHz and the physics must run at that rate.

    Args:
        control_period: Time between samples. In s.
        physics_period: Length of a physics step. In s.
        errors: Errors of the IMU.
        rng: Source of the noise.
    """

    def __init__(
        self,
        control_period: float,
        physics_period: float,
        errors: ImuErrors,
        rng: np.random.Generator,
    ) -> None:
        super().__init__()
        self._errors = errors
        self._rng = rng
        self._joint_sigma = np.tile([JOINT_NOISE, JOINT_NOISE, 0.0], 2)
        self.noise = np.zeros((2 * _NOISE_BLOCK, 6))
        self._noise_end = 0
        self.attitudes = np.zeros((round(errors.delay / physics_period) + 1, 4))
        numbers = self._numbers
        numbers.faithful = 1
        numbers.taps[:], numbers.b[:], numbers.a[:] = _FIR, _IIR_B, _IIR_A
        drives = [robot.DRIVES[name] for name in LEG_DRIVES] * 2
        numbers.counts_per_rad[:] = [2.0**d.encoder_bits * d.gear / (2.0 * math.pi) for d in drives]
        bits = [robot.JOINT_ENCODER_BITS[name] for name in LEG_SENSED_JOINTS] * 2
        numbers.joint_counts_per_rad[:] = 2.0 ** np.array(bits) / (2.0 * math.pi)
        self._set_imu(control_period)

    def _set_imu(self, period: float) -> None:
        numbers, errors = self._numbers, self._errors
        numbers.period = period
        rate = math.sqrt(0.5 / period)
        numbers.imu_sigma[:] = rate * np.repeat([errors.gyro_noise, errors.accelerometer_noise], 3)
        numbers.imu_bias[:] = (*errors.gyro_bias, *errors.accelerometer_bias)
        numbers.attitude_bias[:] = errors.attitude_bias
        numbers.yaw_drift = errors.yaw_drift
        decay = math.exp(-period / errors.wander_time)
        numbers.wander_decay = decay
        numbers.wander_sigma = errors.wander * math.sqrt(1.0 - decay**2)

    def reset(
        self, angles: FloatArray, rates: FloatArray, quaternion: FloatArray, imu: FloatArray
    ) -> None:
        """Begin at rest: the filters are in their steady state."""
        numbers = self._numbers
        numbers.counts[:] = np.trunc(angles[:10] * numbers.counts_per_rad)
        numbers.joint_x[:], numbers.joint_y[:] = angles[10:], 0.0
        self.attitudes[:] = quaternion
        numbers.wander[:] = self._rng.standard_normal(2) * self._errors.wander
        numbers.time = 0.0
        super().reset(angles, rates, quaternion, imu)

    def prepare(self, steps: int) -> None:
        """See `IdealSensors.prepare`."""
        row = self._numbers.noise_row
        left = self._noise_end - row
        if left < steps:
            self.noise[:left] = self.noise[row : self._noise_end]
            drawn = self.noise[left : left + _NOISE_BLOCK]
            self._rng.standard_normal(out=drawn)
            drawn *= self._joint_sigma
            self._noise_end = left + _NOISE_BLOCK
            self._numbers.noise_row = 0

    def write(self, sample: Sensors, *, again: bool = False) -> None:
        """See `IdealSensors.write`."""
        if not again:
            self._rng.standard_normal(out=self._sample_noise)
        super().write(sample)


def make_sensors(
    grade: str, draw: Draw, control_period: float, physics_period: float
) -> IdealSensors:
    """The sensors of a drawn robot.

    Args:
        grade: "ideal" or "faithful".
        draw: Errors of the IMU and the seed of the noise.
        control_period: Time between samples. In s.
        physics_period: Length of a physics step. In s.
    """
    if grade == "ideal":
        return IdealSensors()
    gyro_x, gyro_y, gyro_z = draw.gyro_bias
    x, y, z = draw.accelerometer_bias
    errors = ImuErrors(
        attitude_bias=(draw.attitude_bias[0], draw.attitude_bias[1]),
        gyro_bias=(gyro_x, gyro_y, gyro_z),
        accelerometer_bias=(x, y, z),
        yaw_drift=draw.yaw_drift,
    )
    rng = np.random.default_rng(draw.sensor_seed)
    return FaithfulSensors(control_period, physics_period, errors, rng)
