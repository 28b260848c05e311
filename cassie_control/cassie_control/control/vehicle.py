"""Estimates on a vehicle that moves: the vertical, and the vehicle's speed and neutral lean."""

from __future__ import annotations

import math
from collections.abc import Sequence

from cassie_gaits.robot import GRAVITY
from cassie_msgs.layout import RobotState

_SMALL_ACCELERATION = 0.1  # m/s^2, above which the estimate of the vertical counts ever less


class VerticalFilter:
    """Roll and pitch from the gyro, corrected by the estimate with a long time constant.

    The estimator assumes that standing feet are at rest. On a vehicle with the acceleration a its
    vertical tilts towards that of a pendulum, by up to a / g. The gyro is not affected, and drifts
    by some milliradians in a minute. With w the torso's angular velocity and t the estimated angle:

        pitch' = w_y cos(roll) - w_z sin(roll)                      - (pitch - t) / T,
        roll'  = w_x + tan(pitch) (w_y sin(roll) + w_z cos(roll))   - (roll - t) / T,
        T      = time_constant (1 + |a|^2 / (0.1 m/s^2)^2).

    The estimated velocity is wrong, too: it includes the vehicle's acceleration. So the CoM's
    velocity relative to the feet is computed by the difference of its positions.

    Args:
        period: Control period. In s.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self._state = RobotState()
        self.start(self._state)

    def start(self, state: RobotState) -> None:
        """Begin with the estimated angles."""
        self._pitch, self._roll = state.q[4:6].tolist()
        self._last_com: list[float] | None = None

    def corrected(
        self, state: RobotState, time_constant: float, acceleration: Sequence[float]
    ) -> RobotState:
        """State with the corrected vertical and the CoM's velocity relative to the feet; reused.

        Args:
            state: The state estimate.
            time_constant: Time constant of the correction by the estimate. In s.
            acceleration: Acceleration of the ground, forward and to the left. In m/s^2.
        """
        pitch, roll = state.q[4:6].tolist()
        wx, wy, wz = state.angular_velocity.tolist()
        cos, sin = math.cos(self._roll), math.sin(self._roll)
        ratio = math.hypot(*acceleration) / _SMALL_ACCELERATION
        weight = self._period / (time_constant * (1.0 + ratio**2))
        pitch_rate = wy * cos - wz * sin
        roll_rate = wx + math.tan(self._pitch) * (wy * sin + wz * cos)
        self._pitch += self._period * pitch_rate + weight * (pitch - self._pitch)
        self._roll += self._period * roll_rate + weight * (roll - self._roll)
        self._state.copy_from(state)
        self._state.q[4], self._state.q[5] = self._pitch, self._roll
        self._state.v[4], self._state.v[5] = pitch_rate, roll_rate
        com = self._state.com_position
        com[0] += (self._pitch - pitch) * com[2]
        com[1] -= (self._roll - roll) * com[2]
        com_now = com.tolist()
        if self._last_com is not None:
            for k in (0, 1):
                velocity = (com_now[k] - self._last_com[k]) / self._period
                self._state.com_velocity[k] = velocity
        self._last_com = com_now
        return self._state


# Noise of the filter, from rides of robots 1 to 10; DECISIONS.md lists other attempts.
_INITIAL_VARIANCES = (0.02**2, 0.005**2, 0.02**2)  # (m/s)^2, (m/s^2)^2, m^2, of v, b, n
_COM_ERROR = 0.003  # m, standard deviation of e, the CoM's error when a ride begins
_RANDOM_WALK = (0.02**2, 0.003**2, 0.0005**2)  # per second, of v, b, n; b follows the vertical
_LEAN_NOISE = 0.15**2  # (m/s^2)^2 s: a differs from k (c - n) by 0.15 m/s^2, for half a second
_SIDE_NOISE = 0.1**2  # (m/s^2)^2 s, noise density of the acceleration to a side
_SPEED_NOISE = 0.1**2  # (m/s)^2 s, noise density of a known speed: followed within 5 s
_ROLLING_SPEED = 0.2  # m/s, speed from which there is rolling resistance
_ROLLING_RESISTANCE = 0.001  # m, f: CoM x that overcomes rolling resistance, besides its part in n
_BAR_SPEED = 0.4  # m/s, u: speed by which the bar's push makes a turn look faster
_COM_FROM_COP = 0.75  # (c - p) / (c - n): held on a Segway, c is 4 times as far from n as p is


class VehicleSpeedFilter:
    """Kalman filter of the vehicle's speed, which no sensor measures.

    With a the acceleration found from the feet, c the CoM and p the centre of pressure from the
    feet, h the CoM's height, r the yaw rate, a_y the acceleration to the left, f the CoM x that
    overcomes rolling resistance, and s = v / sqrt(v^2 + (0.2 m/s)^2) the direction of rolling:

        v' = a + b,   b' = 0,   n' = 0,

        a + b = k (c - n - f s)      where it rolls and c is near c*; k = 3/4 g / h, as c - p is
                                     3/4 (c - n) for a CoM held on a Segway,
        a_y   = r (v + u)            with u the bar's push, known to a factor of two,
        v     = vx                   if an operator leans it and vx has been the same for long,
        v     = 0                    if it shall stand, and the estimate is slow.

    It begins at rest, with n above the axle. An error e of the CoM looks like the acceleration
    g e / h, and shifts n by e: at first b and n have the covariance of -g e / h and e.

    Attributes:
        speed: v, forward. In m/s.
        bias: b, correction of the acceleration a. In m/s^2.
        neutral: n, CoM x at which the vehicle at rest does not accelerate. In m.

    Args:
        period: Control period. In s.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self.start(0.0, 1.0)

    def start(self, neutral: float, height: float) -> None:
        """Begin at rest, with the expected `neutral` and the CoM's height above the feet, in m."""
        self.speed = self.bias = 0.0
        self.neutral = neutral
        self._var_v, self._var_b, self._var_n = _INITIAL_VARIANCES
        self._cov_vb = self._cov_vn = 0.0
        variance, per_error = _COM_ERROR**2, GRAVITY / height
        self._var_b += per_error**2 * variance
        self._var_n += variance
        self._cov_bn = -per_error * variance

    def predict(self, speed_change: float) -> None:
        """Predict over one tick, by the change of speed (m/s) found from the feet."""
        dt = self._period
        walk_v, walk_b, walk_n = _RANDOM_WALK
        self.speed += speed_change + dt * self.bias
        self._var_v += dt * (2.0 * self._cov_vb + dt * self._var_b + walk_v)
        self._cov_vb += dt * self._var_b
        self._cov_vn += dt * self._cov_bn
        self._var_b += dt * walk_b
        self._var_n += dt * walk_n

    def correct_by_lean(self, acceleration: float, com_x: float, height: float) -> None:
        """Correct by the vehicle's acceleration, which a lean causes.

        Args:
            acceleration: Acceleration of the vehicle. In m/s^2.
            com_x: CoM ahead of the feet. In m.
            height: CoM above the feet. In m.
        """
        k = _COM_FROM_COP * GRAVITY / height
        square = self.speed**2
        if square == 0.0:
            return
        expected = k * (com_x - self.resistance)
        noise = _LEAN_NOISE * (1.0 + _ROLLING_SPEED**2 / square)
        self._correct(0.0, 1.0, k, expected - acceleration, noise)

    def correct_by_turn(self, rate: float, acceleration: float) -> None:
        """Correct by the acceleration to the left (m/s^2) at a turn rate (rad/s)."""
        noise = _SIDE_NOISE + (_BAR_SPEED * rate) ** 2
        self._correct(rate, 0.0, 0.0, acceleration - _BAR_SPEED * rate, noise)

    def correct_by_speed(self, speed: float) -> None:
        """Correct by a speed (m/s) that the vehicle is known to have."""
        self._correct(1.0, 0.0, 0.0, speed, _SPEED_NOISE)

    @property
    def deviation(self) -> float:
        """Standard deviation of the speed. In m/s."""
        return math.sqrt(max(0.0, self._var_v))

    @property
    def resistance(self) -> float:
        """f s: CoM x that overcomes the rolling resistance, smooth in the speed. In m."""
        return _ROLLING_RESISTANCE * (self.speed / math.hypot(self.speed, _ROLLING_SPEED))

    def _correct(self, h_v: float, h_b: float, h_n: float, measured: float, noise: float) -> None:
        """Correct by h_v speed + h_b bias + h_n neutral = measured, with the density `noise`."""
        g_v = self._var_v * h_v + self._cov_vb * h_b + self._cov_vn * h_n
        g_b = self._cov_vb * h_v + self._var_b * h_b + self._cov_bn * h_n
        g_n = self._cov_vn * h_v + self._cov_bn * h_b + self._var_n * h_n
        inverse = 1.0 / (g_v * h_v + g_b * h_b + g_n * h_n + noise / self._period)
        innovation = measured - h_v * self.speed - h_b * self.bias - h_n * self.neutral
        correction = inverse * innovation
        self.speed += g_v * correction
        self.bias += g_b * correction
        self.neutral += g_n * correction
        self._var_v -= inverse * g_v * g_v
        self._cov_vb -= inverse * g_v * g_b
        self._cov_vn -= inverse * g_v * g_n
        self._var_b -= inverse * g_b * g_b
        self._cov_bn -= inverse * g_b * g_n
        self._var_n -= inverse * g_n * g_n
