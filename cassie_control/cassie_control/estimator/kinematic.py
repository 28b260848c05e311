"""State estimation from the loaded leg's kinematics, the IMU and spring deflection."""

from __future__ import annotations

import math

import numpy as np

from cassie_control.estimator.base import LegEstimator, finish_state
from cassie_control.estimator.config import EstimatorConfig
from cassie_control.estimator.fusion import fuse_velocity
from cassie_msgs.layout import Sensors

_ORIENTATION_VARIANCE = (0.01, math.radians(0.35) ** 2, math.radians(0.35) ** 2)
_RATE_VARIANCE = math.radians(0.1) ** 2


class KinematicEstimator(LegEstimator):
    """Pelvis velocity from the leg that carries load, corrected at the rate of the IMU.

    The velocity is predicted with the accelerometer and pulled towards the velocity at which a
    loaded foot stands still, with a gain that follows the load on the feet. Position is the
    integral, with the height pulled towards the loaded foot's. Orientation is the IMU's own.

    Source:
        Velocity from the stance foot weighted by its load: paper-cited gait-library method (Da
        et al. 2016) as run on Cassie. The prediction with the accelerometer is an addition: it
        removes the lag of a low-pass.
    """

    def __init__(self, config: EstimatorConfig, period: float) -> None:
        super().__init__(config, period)
        self._foot_velocities = self._legs.records["states"]["foot_velocity"][0]
        self._imu_velocity = np.zeros(3)
        self._variance = np.zeros(2)
        self.reset()

    def reset(self) -> None:
        """Forget everything: at rest, at the origin, height from the next sample's legs."""
        super().reset()
        self._imu_velocity[:] = 0.0
        self._variance[:] = (1.0, 0.0)
        self._started = False

    def _move(self, sensors: Sensors) -> None:
        config, state = self._config, self._state
        self._rotation[:] = self._attitude
        state.angular_velocity[:] = sensors.angular_velocity
        if not self._started:
            state.q[2] = self._first_height()
            self._started = True
        fuse_velocity(
            self._rotation,
            state.angular_velocity,
            sensors.linear_acceleration,
            self._body[0]["imu"],
            self._feet,
            self._foot_velocities,
            state.foot_load,
            self._period,
            config.velocity_bandwidth,
            config.height_bandwidth,
            config.velocity_noise,
            self._imu_velocity,
            state.v[:3],
            state.q[:3],
            self._variance,
        )
        state.covariance[:3] = self._variance[1]
        state.covariance[3:6] = _ORIENTATION_VARIANCE
        state.covariance[6:9] = self._variance[0]
        state.covariance[9:] = _RATE_VARIANCE
        finish_state(state.record, self._legs.records, self._body, self._rotation)
