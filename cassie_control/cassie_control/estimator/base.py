"""What both estimators do alike: joints, leg kinematics, foot loads, Euler angles, CoM."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from cassie_control.errors import SensorError
from cassie_control.estimator.body_records import BODY_TYPE
from cassie_control.estimator.config import EstimatorConfig
from cassie_control.estimator.sample_kernels import FIRST_TIME, read_legs
from cassie_control.finite import check
from cassie_gaits import robot
from cassie_gaits.leg_chain import LegPair
from cassie_msgs.layout import RobotState, Sensors

FloatArray = npt.NDArray[np.float64]

_CONFIGURED = ("load_from", "load_span", "contact_force", "contact_width", "height_bandwidth")


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
        self._state = RobotState()
        self._legs = LegPair()
        self._feet: FloatArray = self._legs.states["foot"]
        self._body = np.zeros(1, BODY_TYPE)
        body = self._body[0]
        body["period"], body["mass"] = period, robot.total_mass()
        body["pelvis_moment"] = robot.PELVIS.mass * np.array(robot.PELVIS.com)
        body["imu"] = robot.IMU_POSITION
        self._attitude: FloatArray = body["attitude"]
        self._rotation = np.eye(3)
        self._configure(config)

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
        self._configure(config)

    def _configure(self, config: EstimatorConfig) -> None:
        self._config = config
        for name in _CONFIGURED:
            self._body[name] = getattr(config, name)

    def reset(self) -> None:
        """Forget everything: at rest, at the origin, height from the next sample's legs."""
        self._state.floats[:] = 0.0
        self._body["scale"] = 0.0, 1.0, FIRST_TIME
        self._body["ground"] = 0.0

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
        read_legs(sensors.record, self._state.record, self._legs.record, self._body)
        self._move(sensors)
        return self._state

    def _move(self, sensors: Sensors) -> None:
        """Estimate the pelvis, with its covariance, and the CoM."""
        raise NotImplementedError

    def _first_height(self) -> float:
        """Pelvis height when the lower foot touches level ground. In m."""
        return robot.SOLE_RADIUS - float((self._feet @ self._attitude[2]).min())


def _check(sensors: Sensors) -> None:
    check(sensors, "sensor", SensorError, unused=("battery",))  # a gauge that fails fells nobody
    orientation = sensors.orientation
    square = float(orientation.dot(orientation))
    if not 0.8 < square < 1.2:
        norm = math.sqrt(square)
        raise SensorError(f"sensor orientation is a quaternion of length {norm:.3g}, must be 1")
