"""What both estimators do alike: joints, leg kinematics, foot loads, Euler angles, CoM."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from cassie_control.errors import SensorError
from cassie_control.estimator.config import EstimatorConfig
from cassie_control.estimator.fusion import com_in_heading
from cassie_control.estimator.sample_kernels import (
    FIRST_TIME,
    arrange_joints,
    euler_angles,
    scale_forces,
    weigh_feet,
)
from cassie_control.finite import check
from cassie_control.float_records import floats_type
from cassie_gaits import robot
from cassie_gaits.leg_chain import LegPair
from cassie_msgs.layout import RobotState, Sensors

FloatArray = npt.NDArray[np.float64]

SAMPLE_TYPE = floats_type(Sensors)


class LegEstimator:
    """An estimator whose pelvis is left to its children.

    Foot force is what the deflected springs hold (`LegChain.force`), scaled so that on average
    both carry the weight of the nominal robot (`scale_forces`); load and contact probability follow
    from it.

    Args:
        config: Figures.
        period: Time between samples. In s.
    """

    def __init__(self, config: EstimatorConfig, period: float) -> None:
        self._period = period
        self._config = config
        self._state = RobotState()
        self._sensors: Sensors | None = None  # the last sample, which is usually the next as well
        self._legs = LegPair()
        self._feet: FloatArray = self._legs.states["foot"]
        self._mass = robot.total_mass()
        self._scale = np.empty(3)
        self._pelvis_moment = robot.PELVIS.mass * np.array(robot.PELVIS.com)
        self._imu = np.array(robot.IMU_POSITION)
        state = self._state
        self._q, self._v = state.q[6:].reshape(2, 7), state.v[6:].reshape(2, 7)
        self._angles, self._angle_rates = state.q[3:6], state.v[3:6]
        self._position, self._velocity = state.q[:3], state.v[:3]
        self._rate = state.angular_velocity
        self._toe_torques = np.zeros(2)
        self._attitude = np.eye(3)
        self._rotation = np.eye(3)

    @property
    def feet(self) -> FloatArray:
        """Middle of each sole in the pelvis at the last sample. Shape (2, 3), in m."""
        return self._feet

    @property
    def rotation(self) -> FloatArray:
        """Pelvis to world at the last sample. Shape (3, 3)."""
        return self._rotation

    @property
    def config(self) -> EstimatorConfig:
        """Figures in force; may be set while it runs."""
        return self._config

    @config.setter
    def config(self, config: EstimatorConfig) -> None:
        self._config = config

    def reset(self) -> None:
        """Forget everything: at rest, at the origin, height from the next sample's legs."""
        self._state.floats[:] = 0.0
        self._scale[:] = (0.0, 1.0, FIRST_TIME)

    def restart(self) -> None:
        """Begin anew with the next sample, at rest; place and counted turns are kept."""
        x, y, yaw = self._state.q[[0, 1, 3]]
        self.reset()
        if math.isfinite(x + y + yaw):
            self._state.q[[0, 1, 3]] = x, y, yaw

    def coast(self, blind: bool) -> None:
        """Whether to go on without the accelerometer, which then only tells gravity."""

    def step(self, sensors: Sensors) -> RobotState:
        """Estimate from one sample.

        Returns:
            The state; reused by the next step.

        Raises:
            SensorError: if a value is not finite or the orientation is no unit quaternion; the
                estimate then stays as it was.
        """
        _check(sensors)
        config, state = self._config, self._state
        _pass_on(sensors, state)
        if sensors is not self._sensors:
            self._sensors, self._sample = sensors, sensors.floats.view(SAMPLE_TYPE)
        arrange_joints(self._sample, self._q, self._v, self._toe_torques, self._attitude)
        self._legs.update(self._q, self._v, self._toe_torques, self._attitude[2])
        scale_forces(
            self._legs.forces,
            sensors.linear_acceleration,
            self._attitude[2],
            self._period,
            self._mass,
            self._scale,
            state.foot_force,
        )
        weigh_feet(
            state.foot_force,
            config.load_from,
            config.load_span,
            config.contact_force,
            config.contact_width,
            state.foot_load,
            state.contact_probability,
        )
        self._move(sensors)
        euler_angles(self._rotation, self._rate, self._angles, self._angle_rates)
        com_in_heading(
            self._rotation,
            state.q[3],
            self._rate,
            self._velocity,
            self._legs.states,
            self._pelvis_moment,
            self._mass,
            state.com_position,
            state.com_velocity,
        )
        return state

    def _move(self, sensors: Sensors) -> None:
        """Estimate the pelvis: rotation, angular velocity, position, velocity, covariance."""
        raise NotImplementedError

    def _first_height(self) -> float:
        """Pelvis height when the lower foot touches level ground. In m."""
        return robot.SOLE_RADIUS - float((self._feet @ self._attitude[2]).min())


def _pass_on(sensors: Sensors, state: RobotState) -> None:
    """What the state repeats of the sample."""
    state.answer(sensors)
    state.power[...] = sensors.power
    state.drive_torque[:] = sensors.drive_torque
    charge = sensors.battery[1]
    state.battery_charge[...] = charge if 0.0 <= charge <= 1.0 else -1.0
    state.longest_delay[...] = sensors.longest_delay
    state.copy_tail(sensors, "missed_ticks")


def _check(sensors: Sensors) -> None:
    check(sensors, "sensor", SensorError, unused=("battery",))  # a gauge that fails fells nobody
    orientation = sensors.orientation
    square = float(orientation.dot(orientation))
    if not 0.8 < square < 1.2:
        norm = math.sqrt(square)
        raise SensorError(f"sensor orientation is a quaternion of length {norm:.3g}, must be 1")
