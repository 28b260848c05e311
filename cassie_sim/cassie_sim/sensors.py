"""What the robot measures: drive and joint encoders with their velocity filters, and the IMU.

Two grades. `IdealSensors` reports the truth; `FaithfulSensors` counts, truncates, filters,
delays and adds noise like the parts on the robot. Both are told every physics step what the
model does (`observe`), and write a `Sensors` sample at each control tick (`write`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cassie_gaits import robot
from cassie_gaits.names import LEG_DRIVES, LEG_SENSED_JOINTS
from cassie_msgs.layout import Sensors
from cassie_sim.kernels import observe, write_sample
from cassie_sim.plant_records import SENSORS_TYPE
from cassie_sim.scenario import Draw

FloatArray = npt.NDArray[np.float64]

# Velocity filter of the drives, on encoder counts; of the joints: y = b x - a y.
_FIR = np.array(robot.DRIVE_VELOCITY_FILTER)
_IIR_B, _IIR_A = (np.array(taps) for taps in robot.JOINT_VELOCITY_FILTER)
# Noise is drawn for so many physics steps at a time.
_NOISE_BLOCK = 64

JOINT_NOISE = 2e-4
"""Standard deviation of the shin and tarsus encoders. In rad."""


@dataclass(frozen=True)
class ImuErrors:
    """Errors of a VectorNav VN-100 and of the attitude filter in it.

    Attributes:
        attitude_bias: Constant roll and pitch error. In rad.
        gyro_bias: Constant. Shape (3,), in rad/s.
        accelerometer_bias: Constant. Shape (3,), in m/s^2.
        yaw_drift: In rad/s.
        wander: Standard deviation of the slow roll and pitch error. In rad.
        wander_time: Its correlation time. In s.
        gyro_noise: Density. In rad/s/sqrt(Hz).
        accelerometer_noise: Density. In m/s^2/sqrt(Hz).
        delay: Of the attitude. In s.
    """

    attitude_bias: tuple[float, float] = (0.0, 0.0)
    gyro_bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    accelerometer_bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw_drift: float = 0.0
    wander: float = math.radians(0.1)
    wander_time: float = 10.0
    gyro_noise: float = math.radians(0.0035)
    accelerometer_noise: float = 0.14e-3 * 9.81
    delay: float = 0.002


class IdealSensors:
    """The truth, with the IMU's rates as means since the last sample.

    Attributes:
        records: All its numbers, of `SENSORS_TYPE`. Shape (1,).
        attitudes: Ring of the last orientations. Shape (delay + 1, 4).
        noise: Of the joints in the next physics steps. Shape (n, 6), in rad.
        position: Of the drives as measured. Shape (10,), in rad.
        velocity: Theirs as measured. Shape (10,), in rad/s.
    """

    def __init__(self) -> None:
        self.records = np.zeros(1, SENSORS_TYPE)
        self._record = record = self.records[0]
        self.attitudes = np.zeros((1, 4))
        self.noise = np.zeros((1, 6))
        self._sample_noise = np.zeros(8)
        self.position: FloatArray = record["position"]
        self.velocity: FloatArray = record["velocity"]

    def reset(
        self, angles: FloatArray, rates: FloatArray, quaternion: FloatArray, imu: FloatArray
    ) -> None:
        """Begin at rest with the arguments of `observe`."""
        self._record["count"] = 0
        self._record["imu"] = 0.0
        self.observe(angles, rates, quaternion, imu)

    def observe(
        self, angles: FloatArray, rates: FloatArray, quaternion: FloatArray, imu: FloatArray
    ) -> None:
        """Take in one physics step.

        Args:
            angles: Of the drives, then of shin, tarsus, toe of both legs. Shape (16,), in rad.
            rates: Theirs. Shape (16,), in rad/s.
            quaternion: Pelvis to world, w x y z. Shape (4,).
            imu: Angular velocity and specific force, pelvis frame. Shape (6,), rad/s and m/s^2.
        """
        self.prepare(1)
        observe(self.records, self.attitudes, self.noise, angles, rates, quaternion, imu)

    def prepare(self, steps: int) -> None:
        """Have the noise of the next physics steps ready, 64 at most."""

    def write(self, sample: Sensors, *, again: bool = False) -> None:
        """Fill in the measured fields of a sample and begin the next interval.

        Args:
            sample: Result.
            again: With the same noise as last time.
        """
        write_sample(self.records, self.attitudes, self._sample_noise, sample.record)


class FaithfulSensors(IdealSensors):
    """Encoders that count and truncate, their velocity filters, and a VN-100.

    The velocity filters are defined at 2 kHz and the physics must run at that rate.

    Args:
        control_period: Time between samples. In s.
        physics_period: In s.
        errors: Of the IMU.
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
        self._noise_row = self.records["noise_row"]
        self._joint_sigma = np.tile([JOINT_NOISE, JOINT_NOISE, 0.0], 2)
        self.noise = np.zeros((2 * _NOISE_BLOCK, 6))
        self._noise_end = 0
        self.attitudes = np.zeros((round(errors.delay / physics_period) + 1, 4))
        record = self._record
        record["faithful"] = True
        record["taps"], record["b"], record["a"] = _FIR, _IIR_B, _IIR_A
        drives = [robot.DRIVES[name] for name in LEG_DRIVES] * 2
        record["counts_per_rad"] = [2.0**d.encoder_bits * d.gear / (2.0 * math.pi) for d in drives]
        bits = [robot.JOINT_ENCODER_BITS[name] for name in LEG_SENSED_JOINTS] * 2
        record["joint_counts_per_rad"] = 2.0 ** np.array(bits) / (2.0 * math.pi)
        self._set_imu(control_period)

    def _set_imu(self, period: float) -> None:
        record, errors = self._record, self._errors
        record["period"] = period
        rate = math.sqrt(0.5 / period)
        record["imu_sigma"] = rate * np.repeat([errors.gyro_noise, errors.accelerometer_noise], 3)
        record["imu_bias"] = (*errors.gyro_bias, *errors.accelerometer_bias)
        record["attitude_bias"] = errors.attitude_bias
        record["yaw_drift"] = errors.yaw_drift
        decay = math.exp(-period / errors.wander_time)
        record["wander_decay"] = decay
        record["wander_sigma"] = errors.wander * math.sqrt(1.0 - decay**2)

    def reset(
        self, angles: FloatArray, rates: FloatArray, quaternion: FloatArray, imu: FloatArray
    ) -> None:
        """Begin at rest: the filters are as after a long stillness."""
        record = self._record
        record["counts"] = np.trunc(angles[:10] * record["counts_per_rad"])
        record["joint_x"] = angles[10:]
        record["joint_y"] = 0.0
        self.attitudes[:] = quaternion
        record["wander"] = self._rng.standard_normal(2) * self._errors.wander
        record["time"] = 0.0
        super().reset(angles, rates, quaternion, imu)

    def prepare(self, steps: int) -> None:
        """See `IdealSensors.prepare`."""
        row = int(self._noise_row[0])
        left = self._noise_end - row
        if left < steps:
            self.noise[:left] = self.noise[row : self._noise_end]
            drawn = self.noise[left : left + _NOISE_BLOCK]
            self._rng.standard_normal(out=drawn)
            drawn *= self._joint_sigma
            self._noise_end = left + _NOISE_BLOCK
            self._noise_row[0] = 0

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
        physics_period: In s.
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
