"""State estimation from the loaded leg's kinematics, the IMU and spring deflection."""

from __future__ import annotations

import math

from cassie_control.estimator.base import Body, LegEstimator, finish
from cassie_control.estimator.config import EstimatorConfig
from cassie_gaits import robot
from cassie_gaits.compiled import compiled
from cassie_gaits.leg import LegPair
from cassie_gaits.records import FloatArray, Record, RecordArray, Records, array
from cassie_gaits.vectors import Vector, cross, minus, plus, times, turned
from cassie_msgs.layout import RobotState, Sensors

_YAW_VARIANCE, _TILT_VARIANCE = 0.01, math.radians(0.35) ** 2  # rad^2
_RATE_VARIANCE = math.radians(0.1) ** 2  # (rad/s)^2
_HANGING_LEAK = 1.0  # 1/s: without load the velocity decays, as there is nothing to correct it
_ACCELERATION_VARIANCE = 0.05**2  # (m/s^2)^2 s, from the IMU's tilt error


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
def move(
    samples: RecordArray,
    states: RecordArray,
    pairs: Records[LegPair],
    bodies: Records[Body],
    filters: Records[VelocityFilter],
) -> None:
    """Propagate the state over one period.

    Args:
        samples: `Sensors.record`. Shape (1,).
        states: Result, `RobotState.record`. Shape (1,).
        pairs: Legs as `read_legs` left them. Shape (1,).
        bodies: Data of the robot. Shape (1,).
        filters: Changed in place. Shape (1,).
    """
    sample, state, pair, body = samples[0], states[0], pairs[0], bodies[0]
    estimate = filters[0]
    state.angular_velocity[:] = sample.angular_velocity
    _fuse_velocity(sample.linear_acceleration, state, pair, body, estimate)
    for k in range(3):
        state.covariance[k] = estimate.position_variance
        state.covariance[3 + k] = _YAW_VARIANCE if k == 0 else _TILT_VARIANCE
        state.covariance[6 + k] = estimate.velocity_variance
        state.covariance[9 + k] = _RATE_VARIANCE
    finish(state, pair, body, body.attitude)


@compiled
def _fuse_velocity(
    specific_force: FloatArray,
    state: RobotState,
    pair: LegPair,
    body: Body,
    estimate: VelocityFilter,
) -> None:
    """Predict the pelvis's velocity with the accelerometer, correct it with the loaded feet.

    Args:
        specific_force: At the IMU, pelvis frame. Shape (3,), in m/s^2.
        state: Has angular velocity and loads; gets velocity and position.
        pair, body, estimate: See `move`.
    """
    R, omega, load, period = body.attitude, state.angular_velocity, state.foot_load, body.period
    total = load[0] + load[1]
    share = min(1.0, total)
    gain = 1.0 - math.exp(-estimate.bandwidth * share * period)
    arm, force = turned(R, cross(omega, body.imu)), turned(R, specific_force)
    for k in range(3):
        estimate.velocity[k] += period * force[k]
    estimate.velocity[2] -= period * robot.GRAVITY
    if total > 0.0:
        measured = plus(turned(R, _still_velocity(omega, load, total, pair)), arm)
        for k in range(3):
            estimate.velocity[k] += gain * (measured[k] - estimate.velocity[k])
    else:
        for k in range(3):
            estimate.velocity[k] *= 1.0 - _HANGING_LEAK * period
    for k in range(3):
        state.v[k] = estimate.velocity[k] - arm[k]
        state.q[k] += period * state.v[k]
    if total > 0.0:
        follow = 1.0 - math.exp(-body.height_bandwidth * share * period)
        state.q[2] += follow * (_standing_height(R, load, total, pair) - state.q[2])
    noise = estimate.noise * estimate.noise
    variance = (1.0 - gain) ** 2 * (estimate.velocity_variance + _ACCELERATION_VARIANCE * period)
    estimate.velocity_variance = variance + (gain * gain * noise + gain * 0.1 * noise)
    estimate.position_variance += estimate.velocity_variance * period * 0.1


@compiled
def _still_velocity(omega: FloatArray, load: FloatArray, total: float, pair: LegPair) -> Vector:
    """Pelvis velocity, in the pelvis frame, at which the loaded feet stand still."""
    velocity = (0.0, 0.0, 0.0)
    for i in range(2):
        leg = pair.states[i]
        moved = plus(leg.foot_velocity, cross(omega, leg.foot))
        velocity = minus(velocity, times(load[i] / total, moved))
    return velocity


@compiled
def _standing_height(rotation: FloatArray, load: FloatArray, total: float, pair: LegPair) -> float:
    """Pelvis height at which the loaded feet are on the ground."""
    height = 0.0
    for i in range(2):
        below = turned(rotation, pair.states[i].foot)[2]
        height += load[i] / total * (robot.SOLE_RADIUS - below)
    return height


class KinematicEstimator(LegEstimator):
    """Pelvis velocity from the leg that carries load, corrected at the rate of the IMU.

    The velocity is predicted with the accelerometer. It is corrected by the velocity at which a
    loaded foot stands still, with a gain that follows the load on the feet. Position is the
    integral, with the height corrected by the loaded foot's. Orientation is the IMU's own.

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

    def _move(self, sensors: Sensors) -> None:
        state, legs = self._state, self._legs.records
        if not self._started:
            state.q[2] = self._first_height()
            self._started = True
        move(sensors.record, state.record, legs, self._body.records, self._filter.records)
