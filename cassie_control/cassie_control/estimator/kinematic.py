"""State estimation from the loaded leg's kinematics, the IMU and spring deflection."""

from __future__ import annotations

import math

from cassie_control.estimator.base import Body, LegEstimator, complete_state
from cassie_control.estimator.config import EstimatorConfig
from cassie_gaits import robot
from cassie_gaits.compiled import compiled
from cassie_gaits.leg import LegPair
from cassie_gaits.records import FloatArray, Record, RecordArray, Records, array
from cassie_gaits.vectors import Vector, cross, minus, plus, times, turned
from cassie_msgs.layout import RobotState, Sensors

IMU_TILT_VARIANCE = math.radians(0.35) ** 2
"""Variance of the IMU's own roll and pitch. In rad^2."""

IMU_RATE_VARIANCE = math.radians(0.1) ** 2
"""Variance of the gyro: a VN-100's 0.08 deg/s at 500 Hz, rounded up. In (rad/s)^2."""

_YAW_VARIANCE = 0.01  # rad^2, of the IMU's heading, which drifts: 0.1 rad
_HANGING_DECAY = 1.0  # 1/s: without load the velocity decays, as there is nothing to correct it
_ACCELERATION_NOISE = 0.05**2  # (m/s^2)^2 s: g times 0.35 deg, a correlation time of 0.35 s
_CORRELATED_NOISE_RATIO = 0.1  # of the legs' velocity: its variance stays above half of this
_VELOCITY_CORRELATION_TIME = 0.1  # s, of the velocity's error


class VelocityFilter(Record):
    """The velocity, predicted by the accelerometer and corrected by the loaded feet.

    Attributes:
        bandwidth: Bandwidth of the correction. In 1/s.
        noise: Standard deviation of the feet's velocity. In m/s.
        velocity: Velocity of the IMU in the world. In m/s.
        velocity_variance: Variance of the velocity. In m^2/s^2.
        position_variance: Variance of the position. In m^2.
    """

    bandwidth: float
    noise: float
    velocity: FloatArray = array(3)
    velocity_variance: float
    position_variance: float


@compiled
def estimate_pelvis(
    samples: RecordArray,
    states: RecordArray,
    leg_pairs: Records[LegPair],
    bodies: Records[Body],
    filters: Records[VelocityFilter],
) -> None:
    """Propagate the state over one period.

    Args:
        samples: `Sensors.record`. Shape (1,).
        states: Result, `RobotState.record`. Shape (1,).
        leg_pairs: Legs as `update_legs` left them. Shape (1,).
        bodies: Data of the robot. Shape (1,).
        filters: Changed in place. Shape (1,).
    """
    sample, state, legs, body = samples[0], states[0], leg_pairs[0], bodies[0]
    velocity_filter = filters[0]
    state.angular_velocity[:] = sample.angular_velocity
    _fuse_velocity(sample.linear_acceleration, state, legs, body, velocity_filter)
    for k in range(3):
        state.covariance[k] = velocity_filter.position_variance
        state.covariance[3 + k] = _YAW_VARIANCE if k == 0 else IMU_TILT_VARIANCE
        state.covariance[6 + k] = velocity_filter.velocity_variance
        state.covariance[9 + k] = IMU_RATE_VARIANCE
    complete_state(state, legs, body, body.attitude)


@compiled
def _fuse_velocity(
    specific_force: FloatArray,
    state: RobotState,
    legs: LegPair,
    body: Body,
    velocity_filter: VelocityFilter,
) -> None:
    """Predict the pelvis's velocity with the accelerometer, correct it with the loaded feet.

    Args:
        specific_force: At the IMU, pelvis frame. Shape (3,), in m/s^2.
        state: Has angular velocity and loads; gets velocity and position.
        legs, body, velocity_filter: See `estimate_pelvis`.
    """
    R, omega, load, period = body.attitude, state.angular_velocity, state.foot_load, body.period
    total_load = load[0] + load[1]
    confidence = min(1.0, total_load)
    gain = 1.0 - math.exp(-velocity_filter.bandwidth * confidence * period)
    imu_velocity, force = turned(R, cross(omega, body.imu_position)), turned(R, specific_force)
    for k in range(3):
        velocity_filter.velocity[k] += period * force[k]
    velocity_filter.velocity[2] -= period * robot.GRAVITY
    if total_load > 0.0:
        by_legs = turned(R, _velocity_by_legs(omega, load, total_load, legs))
        measured = plus(by_legs, imu_velocity)
        for k in range(3):
            velocity_filter.velocity[k] += gain * (measured[k] - velocity_filter.velocity[k])
    else:
        for k in range(3):
            velocity_filter.velocity[k] *= 1.0 - _HANGING_DECAY * period
    for k in range(3):
        state.v[k] = velocity_filter.velocity[k] - imu_velocity[k]
        state.q[k] += period * state.v[k]
    if total_load > 0.0:
        height_gain = 1.0 - math.exp(-body.height_bandwidth * confidence * period)
        state.q[2] += height_gain * (_height_by_legs(R, load, total_load, legs) - state.q[2])
    _update_variances(velocity_filter, gain, period)


@compiled
def _update_variances(velocity_filter: VelocityFilter, gain: float, period: float) -> None:
    """Variances of velocity and position after one prediction and correction."""
    noise = velocity_filter.noise * velocity_filter.noise
    predicted = velocity_filter.velocity_variance + _ACCELERATION_NOISE * period
    variance = (1.0 - gain) ** 2 * predicted
    added = gain * gain * noise + gain * _CORRELATED_NOISE_RATIO * noise
    velocity_filter.velocity_variance = variance + added
    velocity_filter.position_variance += (
        velocity_filter.velocity_variance * period * _VELOCITY_CORRELATION_TIME
    )


@compiled
def _velocity_by_legs(
    omega: FloatArray, load: FloatArray, total_load: float, legs: LegPair
) -> Vector:
    """Pelvis velocity at which the loaded feet stand still.

    Args:
        omega: Angular velocity of the pelvis, pelvis frame. Shape (3,), in rad/s.
        load: Load of each foot, 0..1. Shape (2,).
        total_load: Sum of the loads, more than 0.
        legs: Kinematics of both legs.

    Returns:
        In the pelvis frame, in m/s.
    """
    velocity = (0.0, 0.0, 0.0)
    for i in range(2):
        leg = legs.states[i]
        foot_velocity = plus(leg.foot_velocity, cross(omega, leg.foot))
        velocity = minus(velocity, times(load[i] / total_load, foot_velocity))
    return velocity


@compiled
def _height_by_legs(
    rotation: FloatArray, load: FloatArray, total_load: float, legs: LegPair
) -> float:
    """Pelvis height at which the loaded feet are on level ground of height 0. In m.

    Args:
        rotation: Pelvis to world. Shape (3, 3).
        load: Load of each foot, 0..1. Shape (2,).
        total_load: Sum of the loads, more than 0.
        legs: Kinematics of both legs.
    """
    height = 0.0
    for i in range(2):
        foot_height = turned(rotation, legs.states[i].foot)[2]
        height += load[i] / total_load * (robot.SOLE_RADIUS - foot_height)
    return height


class KinematicEstimator(LegEstimator):
    """Pelvis velocity from the leg that carries load, corrected at the rate of the IMU.

    The velocity v of the IMU is predicted with the accelerometer a. It is corrected by the velocity
    at which the loaded feet h_i stand still, with a gain that follows their loads l_i, 0 to 1.
    Position is the integral, with the height corrected by the loaded feet's. Orientation R is the
    IMU's own. B is `velocity_bandwidth`, l the sum of the loads:

        v   <- v + (R a + g) dt
        v   <- v + (1 - exp(-B min(1, l) dt)) (v_l - v)      l > 0, else v <- v (1 - dt / 1 s)
        v_l  = R (sum of l_i (-h_i' - w x h_i) / l + w x imu)    w the gyro, imu its position

    Source:
        Velocity from the stance foot weighted by its load: paper-cited gait-library method (Da
        et al. 2016) as run on Cassie. The prediction with the accelerometer is an addition: it
        removes the lag of a low-pass.
    """

    def __init__(self, config: EstimatorConfig, period: float) -> None:
        self._filter = VelocityFilter()
        super().__init__(config, period)
        self.reset()

    def _configure(self, config: EstimatorConfig) -> None:
        super()._configure(config)
        self._filter.bandwidth = config.velocity_bandwidth
        self._filter.noise = config.velocity_noise

    def reset(self) -> None:
        """Begin anew: at rest, at the origin, with the height from the next sample's legs."""
        super().reset()
        self._filter.velocity[:] = 0.0
        self._filter.velocity_variance, self._filter.position_variance = 1.0, 0.0
        self._started = False

    def _estimate_pelvis(self, sensors: Sensors) -> None:
        state, legs = self._state, self._legs.records
        if not self._started:
            state.q[2] = self._first_height()
            self._started = True
        estimate_pelvis(
            sensors.record, state.record, legs, self._body.records, self._filter.records
        )
