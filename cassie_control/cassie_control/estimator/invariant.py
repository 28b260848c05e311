"""State estimation by a contact-aided invariant extended Kalman filter."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from cassie_control.errors import SensorError
from cassie_control.estimator.base import LegEstimator
from cassie_control.estimator.config import EstimatorConfig
from cassie_control.estimator.filter_records import FILTER_TYPE, NOISE_TYPE
from cassie_control.estimator.invariant_kernels import move
from cassie_gaits import robot
from cassie_msgs.layout import Sensors

FloatArray = npt.NDArray[np.float64]

_HANGING_SPEED = 0.1  # m/s, of a robot in the harness
_HANGING_TIME = 0.5  # s, over which it keeps that speed
_WALKING_NOISE = 0.6  # m/s^2/sqrt(Hz), of walking: 2 m/s^2 that last 0.05 s
_SOLE_FLAT = 0.002  # m
_GROUND_TIME = 0.1  # s
_GROUND_STILL = 0.3  # rad/s
_START = (
    (0.015, 0.015, 1e-4),  # rad: the IMU's first tilt; heading and position begin by definition
    (0.1, 0.1, 0.1),  # m/s
    (1e-4, 1e-4, 1e-4),  # m
    (1.0, 1.0, 1.0),  # m
    (1.0, 1.0, 1.0),
    (1e-4, 1e-4, 1e-4),  # rad/s
    (0.01, 0.01, 0.01),  # m/s^2
)


class InvariantEstimator(LegEstimator):
    """Right-invariant filter on SE_4(3) with the IMU's biases and both feet's contacts.

    State X = (R, v, p, d_left, d_right) and biases b_g, b_a: orientation, velocity and position of
    the IMU in the world, and where the middle of each sole's centre line stands. Errors are
    eta = X^ X^-1 = exp(xi) and zeta = b^ - b; their covariance P is 21 x 21.

        predict   R+ = R exp(w dt),  w = gyro - b_g
                  v+ = v + (R J(w dt) a + g) dt,  a = accelerometer - b_a,  J the left Jacobian
                  p+ = p + v dt + (R J a + g) dt^2 / 2
                  d+ = d + turn of the foot x (radius up - end of the sole it stands on)
        xi'       xi_R' = -R zeta_g,  xi_v' = g x xi_R - v x R zeta_g - R zeta_a,
                  xi_p' = xi_v - p x R zeta_g,  xi_d' = -d x R zeta_g
        feet      z = R h(q) + p - d,  H = (0, 0, -1, 1) on (xi_R, xi_v, xi_p, xi_d)
        attitude  z = Log(R_imu exp(w delay) R^T),  H = 1 on xi_R
        correct   X+ = exp(K z) X,  b+ = b + K z

    A foot's contact is a probability c: its point wanders with the variance
    stance^(c) swing^(1-c), so that a foot in the air tells nothing and one that takes load tells
    ever more. A foot whose innovation lies beyond `slip_gate` slips: its point is
    learned anew, and the foot is trusted again within `slip_time`.
    In flight the IMU alone carries on; hanging for long, the velocity goes to zero.

    The attitude that the IMU itself gives errs by nearly the same angle for a long time. It
    counts as white noise that is as informative: error^2 * 2 error_time / period. Standing feet and
    the accelerometer hence decide roll and pitch, the IMU decides the heading in the long run.

    The height of the state is that above the ground under the loaded feet, as the controller and
    the kinematic estimator have it.

    Source:
        Hartley, Ghaffari, Eustice, Grizzle, "Contact-aided invariant extended Kalman filtering for
        robot state estimation", IJRR 2020. Added here: graded contact, gating, the rolling sole,
        the IMU's own attitude.
    """

    def __init__(self, config: EstimatorConfig, period: float) -> None:
        self._filter = np.zeros(1, FILTER_TYPE)
        self._noise = np.zeros(1, NOISE_TYPE)
        self._blind = False
        super().__init__(config, period)
        self._rotation = self._filter[0]["rotation"]
        self._soles: FloatArray = self._legs.states["foot_rotation"]
        self._arms: FloatArray = self._body[0]["arms"]
        self.reset()

    def _configure(self, config: EstimatorConfig) -> None:
        super()._configure(config)
        self._set_noise()

    def reset(self) -> None:
        """Forget everything: at rest, at the origin, height from the next sample's legs."""
        super().reset()
        self._filter[:] = np.zeros(1, FILTER_TYPE)
        self._started = False

    def coast(self, blind: bool) -> None:
        """Whether to go on without the accelerometer, which then only tells gravity."""
        if blind is not self._blind:
            self._blind = blind
            self._set_noise()

    def _move(self, sensors: Sensors) -> None:
        if not self._started:
            self._start()
        state, legs = self._state.record, self._legs.record
        if not move(sensors.record, state, legs, self._body, self._filter, self._noise):
            self.restart()
            raise SensorError("the filter has diverged: the estimate begins anew")

    def _start(self) -> None:
        """Begin at rest with the IMU's orientation, the lower sole on the ground."""
        self._started = True
        start = self._filter[0]
        start["rotation"] = self._attitude
        start["points"][1] = self._attitude @ self._body[0]["imu"]
        start["points"][1, 2] += self._first_height()
        start["points"][1, :2] += self._state.q[:2]
        for i in range(2):
            start["points"][2 + i] = start["points"][1] + self._attitude @ self._arms[i]
            start["soles"][i] = self._attitude @ self._soles[i]
        start["covariance"] = np.diag(np.square(np.ravel(_START)))

    def _set_noise(self) -> None:
        c, noise, period = self._config.filter, self._noise[0], self._period
        persistent = 2.0 * c.error_time / period
        noise["period"] = period
        noise["gyro"] = c.gyro_noise**2
        noise["accelerometer"] = (_WALKING_NOISE if self._blind else c.accelerometer_noise) ** 2
        noise["gyro_bias"] = c.gyro_drift**2
        noise["largest_gyro_bias"] = c.gyro_bias
        noise["accelerometer_bias"] = c.accelerometer_drift**2
        noise["stance"] = c.stance_noise**2
        noise["swing"] = c.swing_noise**2
        noise["kinematics"] = c.kinematics_noise**2
        noise["tilt"] = c.tilt_error**2 * persistent
        noise["heading"] = c.heading_error**2 * persistent
        noise["hanging"] = _HANGING_SPEED**2 * 2.0 * _HANGING_TIME / period
        noise["gate"] = c.slip_gate**2
        noise["slip_decay"] = math.exp(-period / c.slip_time)
        noise["attitude_delay"] = c.attitude_delay
        noise["sole_radius"] = robot.SOLE_RADIUS
        front, back = np.array(robot.FOOT_CONTACTS)
        noise["sole_line"] = 0.5 * (front - back)
        noise["sole_flat"] = _SOLE_FLAT
        noise["ground_time"] = _GROUND_TIME
        noise["ground_still"] = _GROUND_STILL
