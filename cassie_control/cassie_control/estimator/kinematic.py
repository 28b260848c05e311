"""State estimation from the loaded leg's kinematics, the IMU and spring deflection."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cassie_control.errors import SensorError
from cassie_control.estimator.fusion import com_in_heading, euler_angles, fuse_velocity
from cassie_control.finite import check
from cassie_gaits import robot
from cassie_gaits.leg_chain import LegChain
from cassie_gaits.names import LEGS
from cassie_msgs.layout import RobotState, Sensors
from cassie_msgs.tunables import tunable

FloatArray = npt.NDArray[np.float64]

_ORIENTATION_VARIANCE = (0.01, math.radians(0.35) ** 2, math.radians(0.35) ** 2)
_RATE_VARIANCE = math.radians(0.1) ** 2


@dataclass(frozen=True, kw_only=True)
class EstimatorConfig:
    """Figures of the kinematic estimator."""

    velocity_bandwidth: float = tunable(
        60.0, "1/s", 1.0, 500.0, "How fast the velocity follows the loaded leg's kinematics"
    )
    height_bandwidth: float = tunable(
        30.0, "1/s", 1.0, 500.0, "How fast the height follows the loaded leg's kinematics"
    )
    load_from: float = tunable(100.0, "N", 0.0, 300.0, "Foot force at which its load is 0")
    load_span: float = tunable(100.0, "N", 1.0, 400.0, "Further force until its load is 1")
    contact_force: float = tunable(60.0, "N", 5.0, 300.0, "Foot force of even odds for contact")
    contact_width: float = tunable(12.0, "N", 1.0, 100.0, "Force over which the odds change e-fold")
    velocity_noise: float = tunable(
        0.03, "m/s", 0.001, 1.0, "Standard deviation of the leg's velocity under full load"
    )


class KinematicEstimator:
    """Pelvis velocity from the leg that carries load, corrected at the rate of the IMU.

    The velocity is predicted with the accelerometer and pulled towards the velocity at which a
    loaded foot stands still, with a gain that follows the load on the feet. Position is the
    integral, with the height pulled towards the loaded foot's. Orientation is the IMU's own.
    Foot force is what the deflected springs hold (`LegChain.force`).

    Args:
        config: Figures.
        period: Time between samples. In s.

    Source:
        Velocity from the stance foot weighted by its load: paper-cited gait-library method (Da
        et al. 2016) as run on Cassie. The prediction with the accelerometer is an addition: it
        removes the lag of a low-pass.
    """

    def __init__(self, config: EstimatorConfig, period: float) -> None:
        self.config = config
        self._period = period
        self._state = RobotState()
        self._legs = tuple(LegChain(leg) for leg in LEGS)
        self._mass = robot.total_mass()
        self._pelvis_moment = robot.PELVIS.mass * np.array(robot.PELVIS.com)
        self._imu = np.array(robot.IMU_POSITION)
        self._joints = np.zeros((2, 7))
        self._rates = np.zeros((2, 7))
        self._rotation = np.eye(3)
        self._feet = np.zeros((2, 3))
        self._foot_velocities = np.zeros((2, 3))
        self._moment = np.zeros(3)
        self._moment_rate = np.zeros(3)
        self._velocity = np.zeros(3)
        self._position = np.zeros(3)
        self._imu_velocity = np.zeros(3)
        self._variance = np.zeros(2)
        self.reset()

    def reset(self) -> None:
        """Forget everything: at rest, at the origin, height from the next sample's legs."""
        self._imu_velocity[:] = 0.0
        self._position[:] = 0.0
        self._variance[:] = (1.0, 0.0)
        self._turns = 0.0
        self._last_yaw: float | None = None
        self._started = False

    def step(self, sensors: Sensors) -> RobotState:
        """Estimate from one sample.

        Returns:
            The state; reused by the next step.

        Raises:
            SensorError: if a value is not finite or the orientation is no unit quaternion; the
                estimate then stays as it was.
        """
        _check(sensors)
        state = self._state
        state.seq[...] = sensors.seq
        state.episode[...] = sensors.episode
        state.stamp_ns = sensors.stamp_ns
        self._read_joints(sensors)
        self._update_orientation(sensors)
        self._update_legs(sensors)
        self._update_pelvis(sensors)
        com_in_heading(
            self._rotation,
            float(state.q[3]),
            sensors.angular_velocity,
            self._velocity,
            self._feet,
            self._moment,
            self._moment_rate,
            self._mass,
            state.com_position,
            state.com_velocity,
        )
        state.power[...] = sensors.power
        return state

    def _read_joints(self, sensors: Sensors) -> None:
        drive, joint = sensors.drive_position.reshape(2, 5), sensors.joint_position.reshape(2, 3)
        self._joints[:, :4] = drive[:, :4]
        self._joints[:, 4:6] = joint[:, :2]
        self._joints[:, 6] = drive[:, 4]
        drive, joint = sensors.drive_velocity.reshape(2, 5), sensors.joint_velocity.reshape(2, 3)
        self._rates[:, :4] = drive[:, :4]
        self._rates[:, 4:6] = joint[:, :2]
        self._rates[:, 6] = drive[:, 4]
        self._state.q[6:] = self._joints.reshape(14)
        self._state.v[6:] = self._rates.reshape(14)

    def _update_orientation(self, sensors: Sensors) -> None:
        q, v = self._state.q, self._state.v
        euler_angles(sensors.orientation, sensors.angular_velocity, self._rotation, q[3:6], v[3:6])
        yaw = float(q[3])
        if self._last_yaw is not None:
            # Heading counts on beyond a half turn, so that it can be followed and integrated.
            self._turns -= round((yaw - self._last_yaw) / (2.0 * math.pi))
        self._last_yaw = yaw
        q[3] = yaw + 2.0 * math.pi * self._turns
        self._state.angular_velocity[:] = sensors.angular_velocity

    def _update_legs(self, sensors: Sensors) -> None:
        config, state = self.config, self._state
        up = self._rotation[2]
        self._moment[:] = self._pelvis_moment
        self._moment_rate[:] = 0.0
        for i, leg in enumerate(self._legs):
            result = leg.update(self._joints[i], self._rates[i])
            self._feet[i] = result.foot
            self._foot_velocities[i] = result.foot_velocity
            self._moment += result.com_moment
            self._moment_rate += result.com_rate
            x, y, z = leg.force(float(sensors.drive_torque[5 * i + 4]), up)
            force = float(up[0]) * x + float(up[1]) * y + float(up[2]) * z
            state.foot_force[i] = force
            load = (force - config.load_from) / config.load_span
            state.foot_load[i] = max(0.0, min(1.0, load))
            odds = (config.contact_force - force) / config.contact_width
            state.contact_probability[i] = 1.0 / (1.0 + math.exp(max(-50.0, min(50.0, odds))))

    def _update_pelvis(self, sensors: Sensors) -> None:
        config, state = self.config, self._state
        if not self._started:
            self._started = True
            self._position[2] = robot.SOLE_RADIUS - float((self._feet @ self._rotation[2]).min())
        fuse_velocity(
            self._rotation,
            sensors.angular_velocity,
            sensors.linear_acceleration,
            self._imu,
            self._feet,
            self._foot_velocities,
            state.foot_load,
            self._period,
            config.velocity_bandwidth,
            config.height_bandwidth,
            config.velocity_noise,
            self._imu_velocity,
            self._velocity,
            self._position,
            self._variance,
        )
        state.q[:3] = self._position
        state.v[:3] = self._velocity
        state.covariance[:3] = self._variance[1]
        state.covariance[3:6] = _ORIENTATION_VARIANCE
        state.covariance[6:9] = self._variance[0]
        state.covariance[9:] = _RATE_VARIANCE


def _check(sensors: Sensors) -> None:
    check(sensors, "sensor", SensorError)
    orientation = sensors.orientation
    square = float(orientation.dot(orientation))
    if not 0.8 < square < 1.2:
        norm = math.sqrt(square)
        raise SensorError(f"sensor orientation is a quaternion of length {norm:.3g}, must be 1")
