"""State estimation by a contact-aided invariant extended Kalman filter."""

from __future__ import annotations

import math

import numpy as np

from cassie_control.errors import SensorError
from cassie_control.estimator import config as estimator_config
from cassie_control.estimator.base import Body, LegEstimator, complete_state
from cassie_control.estimator.config import EstimatorConfig
from cassie_gaits import robot
from cassie_gaits.compiled import compiled
from cassie_gaits.leg import LegPair
from cassie_gaits.records import FloatArray, Record, RecordArray, Records, array
from cassie_gaits.vectors import Vector, cross, minus, times, turned
from cassie_msgs.layout import RobotState, Sensors

_R, _V, _P, _D, _, _BG, _BA, _SIZE = range(0, 24, 3)
"""Indices of the filter's errors, each of three coordinates: orientation, velocity, position, left
and right contact, gyro and accelerometer bias; and the number of all errors."""

_VELOCITY, _POSITION, _CONTACTS = 0, 1, 2
"""Rows of `FilterState.vectors`; from `_CONTACTS` on the left and the right contact."""


class FilterState(Record):
    """State of the filter.

    Attributes:
        rotation: IMU to world.
        vectors: Velocity of the IMU in the world; positions of IMU, left and right contact from
            `origin`. In m/s and m.
        origin: Origin of the filter in the world. Shape (2,), in m.
        gyro_bias: Bias of the gyro. In rad/s.
        accelerometer_bias: Bias of the accelerometer. In m/s^2.
        covariance: Covariance of the errors.
        sole_rotations: Orientation of each foot in the world at the last sample.
        ground_slope: Slope of the ground along the feet, positive if it rises ahead.
        slip: 1 for a foot whose contact slips, then decaying to 0.
        ground_height: Height of the ground under the loaded feet. In m.
        airborne_time: Time for which no foot has touched the ground. In s.
    """

    rotation: FloatArray = array(3, 3)
    vectors: FloatArray = array(4, 3)
    origin: FloatArray = array(2)
    gyro_bias: FloatArray = array(3)
    accelerometer_bias: FloatArray = array(3)
    covariance: FloatArray = array(_SIZE, _SIZE)
    sole_rotations: FloatArray = array(2, 3, 3)
    ground_slope: float
    slip: FloatArray = array(2)
    ground_height: float
    airborne_time: float


class FilterNoise(Record):
    """Noise and other parameters of the filter.

    Attributes:
        period: Time between samples. In s.
        gyro: Power density of the gyro's noise. In (rad/s)^2 s.
        accelerometer: Power density of the accelerometer's noise. In (m/s^2)^2 s.
        gyro_bias_walk: Variance per time of the gyro bias's random walk. In (rad/s)^2/s.
        gyro_bias_limit: Saturation of the gyro's bias. In rad/s.
        accelerometer_bias_walk: Variance per time of the accelerometer bias's random walk. In
            (m/s^2)^2/s.
        stance: Variance per time of a loaded contact's random walk. In m^2/s.
        swing: Variance per time of a random walk, for a foot in the air. In m^2/s.
        kinematics: Variance of a foot's position from the pelvis. In m^2.
        tilt: Variance of the IMU's own roll and pitch, as white noise. In rad^2.
        heading: Variance of the IMU's own yaw, as white noise. In rad^2.
        hanging_velocity: Variance of the velocity of a robot that does not touch the ground, as
            white noise. In (m/s)^2.
        slip_gate: Squared Mahalanobis distance beyond which a foot slips.
        slip_decay: Factor on `slip` over one period.
        attitude_delay: Delay of the IMU's orientation. In s.
    """

    period: float
    gyro: float
    accelerometer: float
    gyro_bias_walk: float
    gyro_bias_limit: float
    accelerometer_bias_walk: float
    stance: float
    swing: float
    kinematics: float
    tilt: float
    heading: float
    hanging_velocity: float
    slip_gate: float
    slip_decay: float
    attitude_delay: float


_MAX_ORIGIN_DISTANCE = 10.0  # m, of the IMU from the filter's origin


@compiled
def estimate_pelvis(
    samples: RecordArray,
    states: RecordArray,
    leg_pairs: Records[LegPair],
    bodies: Records[Body],
    filters: Records[FilterState],
    noises: Records[FilterNoise],
) -> bool:
    """Step the filter and compute the state from it; False where the filter has diverged.

    Args:
        samples: `Sensors.record`. Shape (1,).
        states: Result, `RobotState.record`. Shape (1,).
        leg_pairs: Legs as `update_legs` left them. Shape (1,).
        bodies: Data of the robot. Shape (1,).
        filters: Changed in place. Shape (1,).
        noises: Parameters of the filter. Shape (1,).
    """
    sample, state, legs, body = samples[0], states[0], leg_pairs[0], bodies[0]
    _step_filter(sample, state.contact_probability, legs, body, filters[0], noises[0])
    move_origin(filters, _MAX_ORIGIN_DISTANCE)
    if not _compute_pelvis(filters[0], noises[0], body, sample.angular_velocity, state):
        return False
    complete_state(state, legs, body, filters[0].rotation)
    return True


@compiled
def _step_filter(
    sample: Sensors,
    contact: FloatArray,
    legs: LegPair,
    body: Body,
    state: FilterState,
    noise: FilterNoise,
) -> None:
    """Predict over one period with the IMU, then correct.

    Args:
        sample: Means over the period, and the IMU's own orientation `attitude_delay` ago.
        contact: Probability of each foot's contact. Shape (2,).
        legs, body: See `estimate_pelvis`.
        state: Changed in place.
        noise: Parameters of the filter.
    """
    sole = np.empty((3, 3))
    _predict(state, noise, sample.angular_velocity, sample.linear_acceleration, contact)
    for i in range(2):
        _multiply(state.rotation, legs.states[i].foot_rotation, sole)
        _roll_contact(state, noise, i, sole, contact[i])
        state.sole_rotations[i] = sole
    _correct_by_feet(state, noise, body.imu_to_soles)
    correction = np.zeros(_SIZE)
    _correct_by_attitude(state, noise, body.attitude, sample.angular_velocity, correction)
    contact_probability = max(contact[0], contact[1])
    if contact_probability < estimator_config.ON_GROUND:
        _correct_hanging_velocity(
            state, noise.hanging_velocity / (1.0 - contact_probability) ** 2, correction
        )
    _correct_state(state, noise, correction)


_SMALL_ANGLE = 1e-4  # rad, below which sines and cosines are replaced by their series


@compiled
def _exponential(x: float, y: float, z: float, rotation: FloatArray, jacobian: FloatArray) -> None:
    """Rotation by a vector, and the left Jacobian of SO(3) there. In rad."""
    square = x * x + y * y + z * z
    angle = math.sqrt(square)
    if angle < _SMALL_ANGLE:  # first terms of the series
        a, b, c = 1.0 - square / 6.0, 0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0
    else:
        a, b = math.sin(angle) / angle, (1.0 - math.cos(angle)) / square
        c = (1.0 - a) / square
    w = (x, y, z)
    for i in range(3):
        for j in range(3):
            outer = w[i] * w[j]
            identity = 1.0 if i == j else 0.0
            rotation[i, j] = (1.0 - b * square) * identity + b * outer
            jacobian[i, j] = (1.0 - c * square) * identity + c * outer
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        rotation[k, j] += a * w[i]
        rotation[j, k] -= a * w[i]
        jacobian[k, j] += b * w[i]
        jacobian[j, k] -= b * w[i]


@compiled
def _small_rotation(before: FloatArray, after: FloatArray) -> Vector:
    """Rotation vector (rad) from one orientation to a near one, from their matrices (3, 3).

    It is the skew part of after before^T: the sine of the angle in place of the angle.
    """
    x = y = z = 0.0
    for c in range(3):
        x += 0.5 * (after[2, c] * before[1, c] - after[1, c] * before[2, c])
        y += 0.5 * (after[0, c] * before[2, c] - after[2, c] * before[0, c])
        z += 0.5 * (after[1, c] * before[0, c] - after[0, c] * before[1, c])
    return x, y, z


@compiled
def _multiply(left: FloatArray, right: FloatArray, out: FloatArray) -> None:
    """Product of two 3 x 3 matrices; `out` is neither of them."""
    for i in range(3):
        for j in range(3):
            out[i, j] = (
                left[i, 0] * right[0, j] + left[i, 1] * right[1, j] + left[i, 2] * right[2, j]
            )


@compiled
def _predict(
    state: FilterState,
    noise: FilterNoise,
    angular_velocity: FloatArray,
    specific_force: FloatArray,
    contact: FloatArray,
) -> None:
    """Predict X and P over one period, by the IMU's measurements less their biases.

    Args:
        state: Changed in place.
        noise: Parameters of the filter.
        angular_velocity: Measured mean. Shape (3,), in rad/s.
        specific_force: Measured mean. Shape (3,), in m/s^2.
        contact: Probability of each foot's contact. Shape (2,).
    """
    dt = noise.period
    w = times(dt, minus(angular_velocity, state.gyro_bias))
    _predict_covariance(state, noise, contact)
    rotation, jacobian, new = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    _exponential(w[0], w[1], w[2], rotation, jacobian)
    force = minus(specific_force, state.accelerometer_bias)
    force = turned(state.rotation, turned(jacobian, force))
    velocity, position = state.vectors[_VELOCITY], state.vectors[_POSITION]
    for k in range(3):
        a = force[k] - (robot.GRAVITY if k == 2 else 0.0)
        position[k] += dt * (velocity[k] + 0.5 * dt * a)
        velocity[k] += dt * a
    _multiply(state.rotation, rotation, new)
    state.rotation[:] = new


_TOE, _HEEL = robot.FOOT_CONTACTS
_HALF_SOLE = (0.5 * (_TOE[0] - _HEEL[0]), 0.5 * (_TOE[1] - _HEEL[1]), 0.5 * (_TOE[2] - _HEEL[2]))
"""From the middle of the sole's centre line to its toe end, in the toe link. In m."""

_FLAT_SOLE_HEIGHT = 0.002  # m, of a sole's end over its middle, below which both ends touch
_SLOPE_TIME = 0.1  # s, time constant with which a still, loaded foot shows the ground's slope
_STILL_RATE = 0.3  # rad/s, at which a turning foot shows the slope half as fast


@compiled
def _roll_contact(
    state: FilterState, noise: FilterNoise, i: int, sole: FloatArray, contact: float
) -> None:
    """Move the contact point of a foot that rolled on the ground without slipping.

    A sole that is not parallel to the ground stands on one end of its centre line, and on its round
    edge. The middle of the line, the contact point, moves by turn x (radius up - end).

    Args:
        state: Its contact, and the slope of the ground under a loaded foot, are changed.
        noise: Parameters of the filter.
        i: Left (0) or right (1) foot.
        sole: Orientation of the toe link in the world. Shape (3, 3).
        contact: Probability of the foot's contact.
    """
    rotation = _small_rotation(state.sole_rotations[i], sole)
    line = turned(sole, _HALF_SOLE)
    rise = line[2] - state.ground_slope * math.hypot(line[0], line[1])
    end = max(-1.0, min(1.0, -rise / _FLAT_SOLE_HEIGHT))
    arm = (-end * line[0], -end * line[1], robot.SOLE_RADIUS - end * line[2])
    moved = cross(rotation, arm)
    for k in range(3):
        state.vectors[_CONTACTS + i, k] += moved[k]
    relative_rate = math.hypot(rotation[0], rotation[1]) / (noise.period * _STILL_RATE)
    gain = contact**4 * noise.period / _SLOPE_TIME / (1.0 + relative_rate * relative_rate)
    state.ground_slope += gain * (rise / math.hypot(line[0], line[1]))


@compiled
def _predict_covariance(state: FilterState, noise: FilterNoise, contact: FloatArray) -> None:
    """Covariance over one period: P = F P F^T + Q with F = 1 + A dt.

    No correction removes the asymmetry P - P^T by rounding, and F integrates it three times.
    """
    P = state.covariance
    _apply_transition(state, noise.period, P)
    _apply_transition(state, noise.period, P.T)
    _add_noise(state, noise, contact)
    for i in range(_SIZE):
        for j in range(i):
            P[i, j] = P[j, i] = 0.5 * (P[i, j] + P[j, i])


@compiled
def _apply_transition(state: FilterState, dt: float, P: FloatArray) -> None:
    """P <- F P; the order of the rows is such that each one uses old values of the others."""
    R = state.rotation
    for j in range(_SIZE):
        gyro = turned(R, (dt * P[_BG, j], dt * P[_BG + 1, j], dt * P[_BG + 2, j]))
        force = turned(R, (dt * P[_BA, j], dt * P[_BA + 1, j], dt * P[_BA + 2, j]))
        for k in range(3):
            P[_P + k, j] += dt * P[_V + k, j]
        P[_V, j] += dt * robot.GRAVITY * P[_R + 1, j]
        P[_V + 1, j] -= dt * robot.GRAVITY * P[_R, j]
        for i in range(4):
            shift = cross(state.vectors[i], gyro)
            for k in range(3):
                P[_V + 3 * i + k, j] -= shift[k]
        for k in range(3):
            P[_V + k, j] -= force[k]
            P[_R + k, j] -= gyro[k]


@compiled
def _add_noise(state: FilterState, noise: FilterNoise, contact: FloatArray) -> None:
    """Q of one period: the gyro's noise turns all vectors about the filter's origin.

    The noise of a contact is that of its random walk: stance where it holds, swing where it does
    not, and between them the geometric mean weighted by the probability.
    """
    P, dt = state.covariance, noise.period
    sweep = np.zeros((_BG, 3))
    for k in range(3):
        sweep[k, k] = 1.0
    for i in range(4):
        x, y, z = state.vectors[i, 0], state.vectors[i, 1], state.vectors[i, 2]
        first = _V + 3 * i
        sweep[first, 1], sweep[first, 2] = -z, y
        sweep[first + 1, 0], sweep[first + 1, 2] = z, -x
        sweep[first + 2, 0], sweep[first + 2, 1] = -y, x
    gyro = dt * noise.gyro
    for i in range(_BG):
        for j in range(_BG):
            P[i, j] += gyro * (
                sweep[i, 0] * sweep[j, 0] + sweep[i, 1] * sweep[j, 1] + sweep[i, 2] * sweep[j, 2]
            )
    for i in range(2):
        stance = contact[i] * (1.0 - state.slip[i])
        variance = dt * noise.stance**stance * noise.swing ** (1.0 - stance)
        for k in range(3):
            P[_D + 3 * i + k, _D + 3 * i + k] += variance
    for k in range(3):
        P[_V + k, _V + k] += dt * noise.accelerometer
        P[_BG + k, _BG + k] += dt * noise.gyro_bias_walk
        P[_BA + k, _BA + k] += dt * noise.accelerometer_bias_walk


@compiled
def _correct_by_feet(state: FilterState, noise: FilterNoise, feet: FloatArray) -> None:
    """Correct by each foot's position from the legs: z = R h + p - d.

    Args:
        state: Changed in place.
        noise: Parameters of the filter.
        feet: Middle of each sole from the IMU, pelvis frame. Shape (2, 3), in m.
    """
    P = state.covariance
    correction, HP, z = np.zeros(_SIZE), np.empty(_SIZE), np.empty((2, 3))
    for i in range(2):
        arm = turned(state.rotation, feet[i])
        for k in range(3):
            z[i, k] = arm[k] + state.vectors[_POSITION, k] - state.vectors[_CONTACTS + i, k]
        _detect_slip(state, noise, i, z[i])
    for i in range(2):
        for k in range(3):
            p, d = _P + k, _D + 3 * i + k
            for j in range(_SIZE):
                HP[j] = P[d, j] - P[p, j]
            innovation = z[i, k] - correction[d] + correction[p]
            _update(P, HP, HP[d] - HP[p] + noise.kinematics, innovation, correction)
    _correct_state(state, noise, correction)


@compiled
def _update(
    P: FloatArray, HP: FloatArray, variance: float, innovation: float, correction: FloatArray
) -> None:
    """Update covariance and correction with one scalar measurement.

    Args:
        P: Covariance; changed in place.
        HP: Product of the measurement's row H and P. Shape (21,).
        variance: Variance of the innovation, H P H^T plus noise.
        innovation: Innovation less the part that `correction` explains already.
        correction: Correction by the measurements so far; changed in place. Shape (21,).
    """
    scale = 1.0 / variance
    for i in range(_SIZE):
        gain = scale * HP[i]
        correction[i] += gain * innovation
        for j in range(_SIZE):
            P[i, j] -= gain * HP[j]


@compiled
def _detect_slip(state: FilterState, noise: FilterNoise, i: int, z: FloatArray) -> None:
    """Raise the contact's covariance where the innovation is an outlier for a still foot.

    Args:
        state: Its slip, and the covariance of this contact, are changed.
        noise: Parameters of the filter.
        i: Left (0) or right (1) foot.
        z: Innovation. Shape (3,), in m.
    """
    P, d = state.covariance, _D + 3 * i
    S = np.empty((3, 3))
    for a in range(3):
        for b in range(3):
            S[a, b] = P[d + a, d + b] + P[_P + a, _P + b] - P[d + a, _P + b] - P[_P + a, d + b]
        S[a, a] += noise.kinematics
    x, y, w = cross(S[1], S[2]), cross(S[2], S[0]), cross(S[0], S[1])
    determinant = S[0, 0] * x[0] + S[0, 1] * x[1] + S[0, 2] * x[2]
    squared_distance = 0.0
    for k in range(3):
        squared_distance += z[k] * (x[k] * z[0] + y[k] * z[1] + w[k] * z[2])
    squared_distance /= determinant
    state.slip[i] *= noise.slip_decay
    if squared_distance > noise.slip_gate:
        state.slip[i] = 1.0
        for k in range(3):
            P[d + k, d + k] += noise.period * noise.swing


@compiled
def _correct_state(state: FilterState, noise: FilterNoise, correction: FloatArray) -> None:
    """X <- exp(correction) X, biases added.

    The gyro's bias saturates: on a vehicle that accelerates it would absorb the contradiction of
    IMU and resting feet.
    """
    rotation, jacobian, new = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    _exponential(correction[0], correction[1], correction[2], rotation, jacobian)
    _multiply(rotation, state.rotation, new)
    state.rotation[:] = new
    for i in range(4):
        moved = turned(rotation, state.vectors[i])
        shift = turned(jacobian, correction[_V + 3 * i : _V + 3 * i + 3])
        for k in range(3):
            state.vectors[i, k] = moved[k] + shift[k]
    for k in range(3):
        limit, bias = noise.gyro_bias_limit, state.gyro_bias[k] + correction[_BG + k]
        state.gyro_bias[k] = max(-limit, min(limit, bias))
        state.accelerometer_bias[k] += correction[_BA + k]


@compiled
def move_origin(filters: Records[FilterState], farthest: float) -> None:
    """Move the filter's origin o to the IMU, once the IMU is far from it.

    The distance of foot and pelvis is a small difference of large numbers where both are far from
    the point about which the heading errs. About another origin, xi_p' = xi_p + xi_R x o, and
    likewise for the contacts.

    Args:
        filters: Changed in place. Shape (1,).
        farthest: Distance from the origin at which it moves. In m.
    """
    state = filters[0]
    position, P = state.vectors[_POSITION], state.covariance
    if abs(position[0]) + abs(position[1]) < farthest:
        return
    x, y = position[0], position[1]
    for i in range(_POSITION, len(state.vectors)):
        state.vectors[i, 0] -= x
        state.vectors[i, 1] -= y
    state.origin[0] += x
    state.origin[1] += y
    _shift_rows(P, x, y)
    _shift_rows(P.T, x, y)


@compiled
def _shift_rows(P: FloatArray, x: float, y: float) -> None:
    """Move rows of the covariance, or of its transpose, to a new origin: position and contacts."""
    for j in range(_SIZE):
        shift = (-P[_R + 2, j] * y, P[_R + 2, j] * x, P[_R, j] * y - P[_R + 1, j] * x)
        for i in range(3):
            for k in range(3):
                P[_P + 3 * i + k, j] += shift[k]


@compiled
def _correct_by_attitude(
    state: FilterState,
    noise: FilterNoise,
    measured: FloatArray,
    rate: FloatArray,
    correction: FloatArray,
) -> None:
    """Correct by the IMU's own orientation: z = Log(R_imu exp(delay gyro) R^T), to first order.

    Args:
        state: Its covariance is changed.
        noise: Parameters of the filter.
        measured: Orientation by the IMU, `attitude_delay` ago. Shape (3, 3).
        rate: Angular velocity as measured. Shape (3,), in rad/s.
        correction: Correction so far; changed in place. Shape (21,).
    """
    P, R = state.covariance, state.rotation
    rotation, rate_W, HP = _small_rotation(R, measured), turned(R, rate), np.empty(_SIZE)
    for k in range(3):
        z = rotation[k] + noise.attitude_delay * rate_W[k]
        for j in range(_SIZE):
            HP[j] = P[k, j]
        variance = noise.heading if k == 2 else noise.tilt
        _update(P, HP, HP[k] + variance, z - correction[k], correction)


@compiled
def _correct_hanging_velocity(state: FilterState, variance: float, correction: FloatArray) -> None:
    """Correct by z = -v: a robot that hangs for long is at rest.

    The correction is too weak to matter between two steps.

    Args:
        state: Its covariance is changed.
        variance: Variance of the velocity. In (m/s)^2.
        correction: Correction so far; changed in place. Shape (21,).
    """
    P, HP = state.covariance, np.empty(_SIZE)
    for k in range(3):
        for j in range(_SIZE):
            HP[j] = P[_V + k, j]
        innovation = -state.vectors[_VELOCITY, k] - correction[_V + k]
        _update(P, HP, HP[_V + k] + variance, innovation, correction)


@compiled
def _compute_pelvis(
    estimate: FilterState,
    noise: FilterNoise,
    body: Body,
    angular_velocity: FloatArray,
    state: RobotState,
) -> bool:
    """Compute the pelvis from the filter's IMU; False where the filter has diverged.

    Args:
        estimate: The filter; its ground's height follows the loaded feet.
        noise: Parameters of the filter.
        body: Data of the robot.
        angular_velocity: Measured. Shape (3,), in rad/s.
        state: Gets angular velocity less its bias, position with the height above
            `estimate.ground_height`, velocity, covariance.
    """
    P, R, vectors = estimate.covariance, estimate.rotation, estimate.vectors
    rate, covariance = state.angular_velocity, state.covariance
    for k in range(3):
        rate[k] = angular_velocity[k] - estimate.gyro_bias[k]
    imu_velocity = turned(R, cross(rate, body.imu_position))  # relative to the pelvis
    imu_position = turned(R, body.imu_position)
    _update_ground_height(estimate, noise, body, state)
    for k in range(3):
        origin = estimate.origin[k] if k < 2 else -estimate.ground_height
        state.v[k] = vectors[_VELOCITY, k] - imu_velocity[k]
        state.q[k] = vectors[_POSITION, k] - imu_position[k] + origin
        covariance[k] = _vector_variance(P, vectors[_POSITION], _P, k)
        covariance[6 + k] = _vector_variance(P, vectors[_VELOCITY], _V, k)
        covariance[9 + k] = P[_BG + k, _BG + k] + noise.gyro / noise.period
    heading = math.hypot(R[0, 0], R[1, 0])
    c, s = (R[0, 0] / heading, R[1, 0] / heading) if heading > 0.0 else (1.0, 0.0)
    covariance[3] = P[2, 2]
    covariance[4] = s * s * P[0, 0] + c * c * P[1, 1] - 2.0 * s * c * P[0, 1]
    covariance[5] = c * c * P[0, 0] + s * s * P[1, 1] + 2.0 * s * c * P[0, 1]
    return _is_finite(estimate)


_NEW_GROUND_TIME = 1.0  # s without contact, after which the robot may stand on other ground


@compiled
def _update_ground_height(
    estimate: FilterState, noise: FilterNoise, body: Body, state: RobotState
) -> None:
    """Let the ground's height follow the loaded feet, or the first touch after a time in the air.

    Args:
        estimate: The filter; `ground_height` and `airborne_time` are updated.
        noise: Parameters of the filter.
        body: Data of the robot.
        state: Has the feet's loads and contact probabilities.
    """
    vectors, load, contact = estimate.vectors, state.foot_load, state.contact_probability
    total_load = load[0] + load[1]
    touching = 0 if contact[0] > contact[1] else 1
    if contact[touching] < estimator_config.ON_GROUND:
        estimate.airborne_time += noise.period
    elif estimate.airborne_time < _NEW_GROUND_TIME or total_load >= 1.0:
        estimate.airborne_time = 0.0
    else:  # put down on other ground, until the feet carry the robot
        estimate.ground_height = vectors[_CONTACTS + touching, 2] - robot.SOLE_RADIUS
    if total_load > 0.0:
        left, right = vectors[_CONTACTS, 2], vectors[_CONTACTS + 1, 2]
        sole = (load[0] * left + load[1] * right) / total_load
        gain = 1.0 - math.exp(-body.height_bandwidth * min(1.0, total_load) * noise.period)
        estimate.ground_height += gain * (sole - robot.SOLE_RADIUS - estimate.ground_height)


@compiled
def _is_finite(estimate: FilterState) -> bool:
    """Whether the filter's state is finite and its variances are positive."""
    total = estimate.rotation.sum() + estimate.vectors.sum() + estimate.accelerometer_bias.sum()
    finite = math.isfinite(total + estimate.ground_slope)
    for k in range(_SIZE):
        finite = finite and 0.0 < estimate.covariance[k, k] < math.inf  # NaN compares false
    return finite


@compiled
def _vector_variance(P: FloatArray, vector: FloatArray, first: int, k: int) -> float:
    """Variance of coordinate k of one of `FilterState.vectors`.

    The vector's error is that of the filter plus xi_R x vector.

    Args:
        P: Covariance of the filter's errors.
        vector: Velocity or position.
        first: Index of its first error.
        k: Coordinate.
    """
    i, j = (k + 1) % 3, (k + 2) % 3
    a, b = vector[j], -vector[i]
    variance: float = P[first + k, first + k] + 2.0 * (a * P[first + k, i] + b * P[first + k, j])
    variance += a * a * P[i, i] + b * b * P[j, j] + 2.0 * a * b * P[i, j]
    return variance


_HANGING_NOISE = 0.1**2  # (m/s)^2 s: 0.1 m/s in the harness, a correlation time of 0.5 s
_REJECTED_ACCELEROMETER_NOISE = 0.6  # m/s^2/sqrt(Hz), of walking: 2 m/s^2 that last 0.05 s
_REST_RATE = 0.3  # rad/s, of the fastest joint of a robot at rest
_WALKING_DEVIATION = 1.0  # m/s, of the velocity by the legs at one sample, as after a touchdown
_MIN_BIAS_DEVIATION = 1e-9  # rad/s, so that also a bias that is limited to 0 has a variance


def _first_deviations(gyro_bias_limit: float) -> FloatArray:
    """Standard deviations of the errors at the start.

    Args:
        gyro_bias_limit: Saturation of the gyro's bias. In rad/s.

    Returns:
        For orientation, velocity, position, left and right contact, gyro and accelerometer bias.
        Shape (7, 3).
    """
    gyro_bias = max(_MIN_BIAS_DEVIATION, gyro_bias_limit)
    return np.array(
        [
            (0.015, 0.015, 1e-4),  # rad: the IMU's first tilt; the heading begins by definition
            (0.1, 0.1, 0.1),  # m/s: the robot is put down, or hangs
            (1e-4, 1e-4, 1e-4),  # m: the position begins by definition
            (1.0, 1.0, 1.0),  # m: the first correction by the feet finds the contacts
            (1.0, 1.0, 1.0),
            (gyro_bias, gyro_bias, gyro_bias),
            (0.01, 0.01, 0.01),  # m/s^2: 1 mg
        ]
    )


class InvariantEstimator(LegEstimator):
    """Right-invariant filter on SE_4(3) with the IMU's biases and both feet's contacts.

    State X = (R, v, p, d_left, d_right) and biases b_g, b_a: orientation, velocity and position of
    the IMU in the world, and where the middle of each sole's centre line stands. Errors are
    X^ X^-1 = exp(xi) and zeta = b^ - b; their covariance P is 21 x 21.

        predict   R+ = R exp(w dt),  w = gyro - b_g
                  v+ = v + (R J(w dt) a + g) dt,  a = accelerometer - b_a,  J the left Jacobian
                  p+ = p + v dt + (R J a + g) dt^2 / 2
                  d+ = d + turn of the foot x (radius up - end of the sole it stands on)
                  P+ = F P F^T + Q,  F = 1 + A dt,  A by the rows
                  xi_R' = -R zeta_g,  xi_v' = g x xi_R - v x R zeta_g - R zeta_a,
                  xi_p' = xi_v - p x R zeta_g,  xi_d' = -d x R zeta_g
        feet      z = R h(q) + p - d,  H = (-1, 1) on (xi_p, xi_d)
        attitude  z = Log(R_imu exp(gyro delay) R^T),  H = 1 on xi_R
        hanging   z = -v,  H = 1 on xi_v,  while no foot touches the ground
        correct   X+ = exp(K z) X,  b+ = b + K z;  z = -H (xi, zeta) + noise

    The three coordinates of a measurement have independent noise, and correct one after the other.

    A foot's contact is a probability c: its contact point is a random walk with the variance
    stance^(c) swing^(1-c) per time. So a foot in the air gives no information, and a foot that
    takes load gives more and more. A foot whose innovation is beyond `slip_gate` slips: its contact
    point is estimated anew, and c (1 - slip) takes the place of c, with a slip that decays with the
    time constant `slip_time`.
    In flight the filter integrates the IMU alone; while the robot hangs for long, the velocity goes
    to zero.

    Errors that last count as white noise of the same information: error^2 * 2 error_time / period.
    This holds for the IMU's own attitude, and for the speed of a robot that hangs. Hence standing
    feet and the accelerometer decide roll and pitch, and the IMU decides the heading in the long
    run.

    The state's height is that above the ground under the loaded feet, as in the controller and in
    the kinematic estimator.

    Source:
        Hartley, Ghaffari, Eustice, Grizzle, "Contact-aided invariant extended Kalman filtering for
        robot state estimation", IJRR 2020. Added here: graded contact, gating, the rolling sole,
        the IMU's own attitude, the hanging robot.
    """

    def __init__(self, config: EstimatorConfig, period: float) -> None:
        self._filter = FilterState()
        self._noise = FilterNoise()
        self._accelerometer_rejected = False
        super().__init__(config, period)
        self._rotation = self._filter.rotation
        self.reset()

    def _configure(self, config: EstimatorConfig) -> None:
        super()._configure(config)
        self._set_noise()

    def reset(self) -> None:
        """Begin anew: at rest, at the origin, with the height from the next sample's legs."""
        super().reset()
        self._filter.clear()
        self._started = False

    def set_accelerometer_rejected(self, rejected: bool) -> None:
        """Set whether the accelerometer is rejected, so that samples have gravity in its place."""
        if rejected is not self._accelerometer_rejected:
            self._accelerometer_rejected = rejected
            self._set_noise()

    def _estimate_pelvis(self, sensors: Sensors) -> None:
        if not self._started:
            self._start(sensors)
        state, legs = self._state.record, self._legs.records
        body, noise = self._body.records, self._noise.records
        if not estimate_pelvis(sensors.record, state, legs, body, self._filter.records, noise):
            self.restart()
            raise SensorError("the filter has diverged: the estimate begins anew")

    def _start(self, sensors: Sensors) -> None:
        """Begin with the IMU's orientation and the lower sole on the ground, at rest.

        Where the robot walks, it begins with the velocity by the legs, which the next samples of
        the feet soon correct.
        """
        self._started = True
        start, body = self._filter, self._body
        R, vectors = body.attitude, start.vectors
        start.rotation = R
        vectors[_POSITION] = R @ body.imu_position
        vectors[_POSITION, 2] += self._first_height()
        start.origin[:] = self._state.q[:2]
        for i in range(2):
            vectors[_CONTACTS + i] = vectors[_POSITION] + R @ body.imu_to_soles[i]
            start.sole_rotations[i] = R @ self._legs.states[i].foot_rotation
        deviation = _first_deviations(self._noise.gyro_bias_limit)
        if self._walks():
            deviation[_V // 3] = _WALKING_DEVIATION
            vectors[_VELOCITY] = R @ self._velocity_by_legs(sensors.angular_velocity)
        start.covariance = np.diag(np.square(np.ravel(deviation)))

    def _walks(self) -> bool:
        """Whether the robot moves on loaded feet: this node has begun anew while it walks."""
        state = self._state
        return bool(state.foot_load.any() and np.abs(state.v[6:]).max() > _REST_RATE)

    def _velocity_by_legs(self, omega: FloatArray) -> FloatArray:
        """Velocity of the IMU at which the loaded feet stand still.

        Args:
            omega: Angular velocity. Shape (3,), in rad/s.

        Returns:
            In the pelvis frame. Shape (3,), in m/s.
        """
        velocity, load = np.zeros(3), self._state.foot_load
        for i in range(2):
            foot = self._legs.states[i].foot_velocity + np.cross(omega, self._body.imu_to_soles[i])
            velocity -= load[i] / load.sum() * foot
        return velocity

    def _set_noise(self) -> None:
        """Variances and power densities from the configured standard deviations."""
        c, noise, period = self._config.filter, self._noise, self._period
        persistent = 2.0 * c.error_time / period
        noise.period = period
        noise.gyro = c.gyro_noise**2
        if self._accelerometer_rejected:
            noise.accelerometer = _REJECTED_ACCELEROMETER_NOISE**2
        else:
            noise.accelerometer = c.accelerometer_noise**2
        noise.gyro_bias_walk = c.gyro_drift**2
        noise.gyro_bias_limit = c.gyro_bias
        noise.accelerometer_bias_walk = c.accelerometer_drift**2
        noise.stance = c.stance_noise**2
        noise.swing = c.swing_noise**2
        noise.kinematics = c.kinematics_noise**2
        noise.tilt = c.tilt_error**2 * persistent
        noise.heading = c.heading_error**2 * persistent
        noise.hanging_velocity = _HANGING_NOISE / period
        noise.slip_gate = c.slip_gate**2
        noise.slip_decay = math.exp(-period / c.slip_time)
        noise.attitude_delay = c.attitude_delay
