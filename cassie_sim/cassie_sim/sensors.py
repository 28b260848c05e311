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
from cassie_sim.kernels import count_drives, count_joints

FloatArray = npt.NDArray[np.float64]

# Velocity filter of the drives: taps on encoder counts, newest first, at 2 kHz.
_FIR = np.array([2727.0, 534.0, -2658.0, -795.0, 72.0, 110.0, 19.0, -6.0, -3.0]) / math.pi
# Velocity filter of the joints at 2 kHz: y = b x - a y.
_IIR_B = 12.348 * np.array([1.0, 1.0, -1.0, -1.0])
_IIR_A = np.array([-1.7658, 0.79045])
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
    """The truth, with the IMU's rates as means since the last sample."""

    def __init__(self) -> None:
        self.position = np.zeros(10)
        self.velocity = np.zeros(10)
        self._joints = np.zeros(6)
        self._joint_rates = np.zeros(6)
        self._quaternion = np.array([1.0, 0.0, 0.0, 0.0])
        self._imu = np.zeros(6)
        self._count = 0

    def reset(self, *measured: FloatArray) -> None:
        """Begin at rest with the arguments of `observe`."""
        self._count = 0
        self._imu[:] = 0.0
        self.observe(*measured)

    def observe(
        self,
        position: FloatArray,
        velocity: FloatArray,
        joints: FloatArray,
        joint_rates: FloatArray,
        quaternion: FloatArray,
        imu: FloatArray,
    ) -> None:
        """Take in one physics step.

        Args:
            position: Of the drives. Shape (10,), in rad.
            velocity: Of the drives. Shape (10,), in rad/s.
            joints: Shin, tarsus, toe of both legs. Shape (6,), in rad.
            joint_rates: Shape (6,), in rad/s.
            quaternion: Pelvis to world, w x y z. Shape (4,).
            imu: Angular velocity and specific force, pelvis frame. Shape (6,), rad/s and m/s^2.
        """
        self.position[:] = position
        self.velocity[:] = velocity
        self._joints[:] = joints
        self._joint_rates[:] = joint_rates
        self._quaternion[:] = quaternion
        self._imu += imu
        self._count += 1

    def write(self, sample: Sensors) -> None:
        """Fill in the measured fields of a sample and begin the next interval."""
        sample.drive_position[:] = self.position
        sample.drive_velocity[:] = self.velocity
        sample.joint_position[:] = self._joints
        sample.joint_velocity[:] = self._joint_rates
        w, x, y, z = self._quaternion.tolist()
        sample.orientation[:] = (x, y, z, w)
        self._write_imu(sample)

    def _write_imu(self, sample: Sensors) -> None:
        self._imu *= 1.0 / max(self._count, 1)
        sample.angular_velocity[:] = self._imu[:3]
        sample.linear_acceleration[:] = self._imu[3:]
        self._imu[:] = 0.0
        self._count = 0


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
        self._period = control_period
        self._errors = errors
        self._rng = rng
        drives = [robot.DRIVES[name] for name in LEG_DRIVES] * 2
        self._counts_per_rad = np.array(
            [2.0**d.encoder_bits * d.gear / (2.0 * math.pi) for d in drives]
        )
        bits = [robot.JOINT_ENCODER_BITS[name] for name in LEG_SENSED_JOINTS] * 2
        self._joint_counts_per_rad = 2.0 ** np.array(bits) / (2.0 * math.pi)
        self._joint_sigma = np.tile([JOINT_NOISE, JOINT_NOISE, 0.0], 2)
        self._joint_noise = np.zeros((_NOISE_BLOCK, 6))
        self._noise_row = _NOISE_BLOCK
        self._counts = np.zeros((len(_FIR), 10))
        self._row = 0
        self._joint_x = np.zeros((4, 6))
        self._joint_y = np.zeros((2, 6))
        self._delay_steps = round(errors.delay / physics_period)
        self._attitudes = np.zeros((self._delay_steps + 1, 4))
        self._attitude_row = 0
        self._wander = np.zeros(2)
        self._time = 0.0
        self._noise = np.zeros(8)
        rate = math.sqrt(0.5 / control_period)
        self._imu_sigma = rate * np.repeat([errors.gyro_noise, errors.accelerometer_noise], 3)
        self._imu_bias = np.array([*errors.gyro_bias, *errors.accelerometer_bias])
        self._wander_decay = math.exp(-control_period / errors.wander_time)
        self._wander_sigma = errors.wander * math.sqrt(1.0 - self._wander_decay**2)

    def reset(self, *measured: FloatArray) -> None:
        """Begin at rest: the filters are as after a long stillness."""
        position, _, joints, _, quaternion, _ = measured
        self._counts[:] = np.trunc(position * self._counts_per_rad)
        self._joint_x[:] = joints
        self._joint_y[:] = 0.0
        self._attitudes[:] = quaternion
        self._wander = self._rng.standard_normal(2) * self._errors.wander
        self._time = 0.0
        super().reset(*measured)

    def observe(
        self,
        position: FloatArray,
        velocity: FloatArray,
        joints: FloatArray,
        joint_rates: FloatArray,
        quaternion: FloatArray,
        imu: FloatArray,
    ) -> None:
        """Count, truncate and filter one physics step; see `IdealSensors.observe`."""
        self._row = count_drives(
            position,
            self._counts_per_rad,
            _FIR,
            self._counts,
            self._row,
            self.position,
            self.velocity,
        )
        if self._noise_row == len(self._joint_noise):
            self._rng.standard_normal(out=self._joint_noise)
            self._joint_noise *= self._joint_sigma
            self._noise_row = 0
        count_joints(
            joints,
            self._joint_noise[self._noise_row],
            self._joint_counts_per_rad,
            _IIR_B,
            _IIR_A,
            self._joint_x,
            self._joint_y,
        )
        self._noise_row += 1
        self._attitude_row = (self._attitude_row + 1) % (self._delay_steps + 1)
        self._attitudes[self._attitude_row] = quaternion
        self._imu += imu
        self._count += 1

    def write(self, sample: Sensors) -> None:
        """Fill in the measured fields of a sample and begin the next interval."""
        sample.drive_position[:] = self.position
        sample.drive_velocity[:] = self.velocity
        sample.joint_position[:] = self._joint_x[0]
        sample.joint_velocity[:] = self._joint_y[0]
        self._time += self._period
        noise = self._noise
        self._rng.standard_normal(out=noise)
        oldest = self._attitudes[(self._attitude_row + 1) % (self._delay_steps + 1)]
        self._write_attitude(sample, oldest, noise[6:])
        self._write_imu(sample)
        noise[:6] *= self._imu_sigma
        noise[:6] += self._imu_bias
        sample.angular_velocity[:] += noise[:3]
        sample.linear_acceleration[:] += noise[3:6]

    def _write_attitude(self, sample: Sensors, quaternion: FloatArray, noise: FloatArray) -> None:
        self._wander *= self._wander_decay
        self._wander += self._wander_sigma * noise
        roll = 0.5 * (self._errors.attitude_bias[0] + float(self._wander[0]))
        pitch = 0.5 * (self._errors.attitude_bias[1] + float(self._wander[1]))
        yaw = 0.5 * self._errors.yaw_drift * self._time
        w, x, y, z = quaternion.tolist()
        # Tilt errors act in the pelvis frame (right), the yaw error in the world (left).
        w, x, y, z = (
            w - x * roll - y * pitch,
            x + w * roll - z * pitch,
            y + w * pitch + z * roll,
            z + x * pitch - y * roll,
        )
        w, x, y, z = w - yaw * z, x - yaw * y, y + yaw * x, z + yaw * w
        norm = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
        sample.orientation[:] = (x * norm, y * norm, z * norm, w * norm)
