"""State estimation by a contact-aided invariant extended Kalman filter."""

from __future__ import annotations

import math

import numpy as np

from cassie_control.errors import SensorError
from cassie_control.estimator.base import Body, LegEstimator, finish
from cassie_control.estimator.config import EstimatorConfig
from cassie_gaits import robot
from cassie_gaits.compiled import compiled
from cassie_gaits.leg import LegPair
from cassie_gaits.records import FloatArray, Record, RecordArray, Records, array
from cassie_gaits.vectors import Vector, cross, turned
from cassie_msgs.layout import RobotState, Sensors

SIZE = 21
"""Dimension of the filter's error: orientation, velocity, position, left and right contact, gyro
and accelerometer bias, three of each."""

_R, _V, _P, _D, _BG, _BA = 0, 3, 6, 9, 15, 18


class FilterState(Record):
    """State of the filter.

    Attributes:
        rotation: IMU to world.
        points: Velocity of the IMU in the world; positions of IMU, left and right contact from
            `origin`. In m/s and m.
        origin: Origin of the filter in the world. Shape (2,), in m.
        gyro_bias: Bias of the gyro. In rad/s.
        accelerometer_bias: Bias of the accelerometer. In m/s^2.
        covariance: Covariance of the errors.
        soles: Orientation of each foot in the world at the last sample.
        ground: Slope of the ground along the feet, positive if it rises ahead.
        doubt: Doubt in each foot's contact, 0..1: 1 when it slips, then decaying.
    """

    rotation: FloatArray = array(3, 3)
    points: FloatArray = array(4, 3)
    origin: FloatArray = array(2)
    gyro_bias: FloatArray = array(3)
    accelerometer_bias: FloatArray = array(3)
    covariance: FloatArray = array(SIZE, SIZE)
    soles: FloatArray = array(2, 3, 3)
    ground: float
    doubt: FloatArray = array(2)


class FilterNoise(Record):
    """Noise and other parameters of the filter.

    Attributes:
        period: Time between samples. In s.
        gyro: Power density of the gyro's noise. In (rad/s)^2 s.
        accelerometer: Power density of the accelerometer's noise. In (m/s^2)^2 s.
        gyro_bias: Variance per time of the gyro bias's random walk. In (rad/s)^2/s.
        largest_gyro_bias: Saturation of the gyro's bias. In rad/s.
        accelerometer_bias: Variance per time of the accelerometer bias's random walk. In
            (m/s^2)^2/s.
        stance: Variance per time of a loaded contact's random walk. In m^2/s.
        swing: Variance per time of a random walk, for a foot in the air. In m^2/s.
        kinematics: Variance of a foot's position from the pelvis. In m^2.
        tilt: Variance of the IMU's own roll and pitch, as white noise. In rad^2.
        heading: Variance of the IMU's own yaw, as white noise. In rad^2.
        hanging: Velocity variance of a robot that does not touch the ground. In (m/s)^2.
        gate: Squared Mahalanobis distance beyond which a foot slips.
        slip_decay: Factor on the doubt over one period.
        attitude_delay: Delay of the IMU's orientation. In s.
        sole_radius: Radius of the sole's round edge. In m.
        sole_line: From the middle of the sole's centre line to its front, toe link. In m.
        sole_flat: Height of a sole's end over the ground below which both ends touch. In m.
        ground_time: Time constant with which a still foot shows the ground's slope. In s.
        ground_still: Turn rate up to about which a foot counts as still. In rad/s.
    """

    period: float
    gyro: float
    accelerometer: float
    gyro_bias: float
    largest_gyro_bias: float
    accelerometer_bias: float
    stance: float
    swing: float
    kinematics: float
    tilt: float
    heading: float
    hanging: float
    gate: float
    slip_decay: float
    attitude_delay: float
    sole_radius: float
    sole_line: FloatArray = array(3)
    sole_flat: float
    ground_time: float
    ground_still: float


@compiled
def move(
    samples: RecordArray,
    states: RecordArray,
    pairs: Records[LegPair],
    bodies: Records[Body],
    filters: Records[FilterState],
    noises: Records[FilterNoise],
) -> bool:
    """Step the filter and compute the state from it; False where the filter has diverged.

    Args:
        samples: `Sensors.record`. Shape (1,).
        states: Result, `RobotState.record`. Shape (1,).
        pairs: Legs as `read_legs` left them. Shape (1,).
        bodies: Data of the robot; the ground's height follows the loaded feet. Shape (1,).
        filters: Changed in place. Shape (1,).
        noises: Parameters of the filter. Shape (1,).
    """
    sample, state, pair, body = samples[0], states[0], pairs[0], bodies[0]
    _step_filter(sample, state.contact_probability, pair, body, filters[0], noises[0])
    take_origin_along(filters, _FARTHEST)
    if not _read_pelvis(filters[0], noises[0], body, sample.angular_velocity, state):
        return False
    finish(state, pair, body, filters[0].rotation)
    return True


@compiled
def _step_filter(
    sample: Sensors,
    contact: FloatArray,
    pair: LegPair,
    body: Body,
    state: FilterState,
    noise: FilterNoise,
) -> None:
    """Predict over one period with the IMU, then correct.

    Args:
        sample: Means over the period, and the IMU's own orientation `attitude_delay` ago.
        contact: Probability of each foot's contact. Shape (2,).
        pair, body, state, noise: See `move`.
    """
    sole = np.empty((3, 3))
    _predict(state, noise, sample.angular_velocity, sample.linear_acceleration, contact)
    for i in range(2):
        multiply(state.rotation, pair.states[i].foot_rotation, sole)
        _roll(state, noise, i, sole, contact[i])
        state.soles[i] = sole
    _correct_by_feet(state, noise, body.arms)
    correction = np.zeros(SIZE)
    _correct_by_attitude(state, noise, body.attitude, sample.angular_velocity, correction)
    touching = max(contact[0], contact[1])
    if touching < 0.5:
        _correct_by_hanging(state, noise.hanging / (1.0 - touching) ** 2, correction)
    _apply(state, noise, correction)


@compiled
def exponential(x: float, y: float, z: float, rotation: FloatArray, jacobian: FloatArray) -> None:
    """Rotation by a vector, and the left Jacobian of SO(3) there. In rad."""
    square = x * x + y * y + z * z
    angle = math.sqrt(square)
    if angle < 1e-4:
        a, b, c = 1.0 - square / 6.0, 0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0
    else:
        a, b = math.sin(angle) / angle, (1.0 - math.cos(angle)) / square
        c = (1.0 - a) / square
    w = (x, y, z)
    for i in range(3):
        for j in range(3):
            outer = w[i] * w[j]
            same = 1.0 if i == j else 0.0
            rotation[i, j] = (1.0 - b * square) * same + b * outer
            jacobian[i, j] = (1.0 - c * square) * same + c * outer
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        rotation[k, j] += a * w[i]
        rotation[j, k] -= a * w[i]
        jacobian[k, j] += b * w[i]
        jacobian[j, k] -= b * w[i]


@compiled
def small_turn(before: FloatArray, after: FloatArray) -> Vector:
    """Rotation vector between two near orientations (3, 3): skew part of after before^T."""
    x = y = z = 0.0
    for c in range(3):
        x += 0.5 * (after[2, c] * before[1, c] - after[1, c] * before[2, c])
        y += 0.5 * (after[0, c] * before[2, c] - after[2, c] * before[0, c])
        z += 0.5 * (after[1, c] * before[0, c] - after[0, c] * before[1, c])
    return x, y, z


@compiled
def multiply(left: FloatArray, right: FloatArray, out: FloatArray) -> None:
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
    """Predict X over one period, by the IMU's measurements less their biases."""
    dt = noise.period
    bias = state.gyro_bias
    w = (
        dt * (angular_velocity[0] - bias[0]),
        dt * (angular_velocity[1] - bias[1]),
        dt * (angular_velocity[2] - bias[2]),
    )
    _grow(state, noise, contact)
    turn, jacobian, new = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    exponential(w[0], w[1], w[2], turn, jacobian)
    bias = state.accelerometer_bias
    force = (
        specific_force[0] - bias[0],
        specific_force[1] - bias[1],
        specific_force[2] - bias[2],
    )
    force = turned(state.rotation, turned(jacobian, force))
    velocity, position = state.points[0], state.points[1]
    for k in range(3):
        a = force[k] - (robot.GRAVITY if k == 2 else 0.0)
        position[k] += dt * (velocity[k] + 0.5 * dt * a)
        velocity[k] += dt * a
    multiply(state.rotation, turn, new)
    state.rotation[:] = new


@compiled
def _roll(state: FilterState, noise: FilterNoise, i: int, sole: FloatArray, contact: float) -> None:
    """Move the contact point of a foot that rolled on the ground without slipping.

    A sole that is not parallel to the ground stands on one end of its centre line, and on its round
    edge. The middle of the line, the contact point, moves by turn x (radius up - end).
    """
    turn = small_turn(state.soles[i], sole)
    line = turned(sole, noise.sole_line)
    rise = line[2] - state.ground * math.hypot(line[0], line[1])
    side = max(-1.0, min(1.0, -rise / noise.sole_flat))
    arm = (-side * line[0], -side * line[1], noise.sole_radius - side * line[2])
    moved = cross(turn, arm)
    for k in range(3):
        state.points[2 + i, k] += moved[k]
    rate = math.hypot(turn[0], turn[1]) / (noise.period * noise.ground_still)
    share = contact**4 * noise.period / noise.ground_time / (1.0 + rate * rate)
    state.ground += share * (rise / math.hypot(line[0], line[1]))


@compiled
def _grow(state: FilterState, noise: FilterNoise, contact: FloatArray) -> None:
    """Covariance over one period: P = F P F^T + Q with F = 1 + A dt.

    No correction removes the asymmetry P - P^T by rounding, and F integrates it three times.
    """
    P = state.covariance
    _flow(state, noise.period, P)
    _flow(state, noise.period, P.T)
    _add_noise(state, noise, contact)
    for i in range(SIZE):
        for j in range(i):
            P[i, j] = P[j, i] = 0.5 * (P[i, j] + P[j, i])


@compiled
def _flow(state: FilterState, dt: float, P: FloatArray) -> None:
    """P <- F P; the order of the rows is such that each one uses old values of the others."""
    R = state.rotation
    for j in range(SIZE):
        gyro = turned(R, (dt * P[_BG, j], dt * P[_BG + 1, j], dt * P[_BG + 2, j]))
        force = turned(R, (dt * P[_BA, j], dt * P[_BA + 1, j], dt * P[_BA + 2, j]))
        for k in range(3):
            P[_P + k, j] += dt * P[_V + k, j]
        P[_V, j] += dt * robot.GRAVITY * P[_R + 1, j]
        P[_V + 1, j] -= dt * robot.GRAVITY * P[_R, j]
        for i in range(4):
            swept = cross(state.points[i], gyro)
            for k in range(3):
                P[_V + 3 * i + k, j] -= swept[k]
        for k in range(3):
            P[_V + k, j] -= force[k]
            P[_R + k, j] -= gyro[k]


@compiled
def _add_noise(state: FilterState, noise: FilterNoise, contact: FloatArray) -> None:
    """Q of one period: the gyro's noise sweeps all vectors about the world's origin."""
    P, dt = state.covariance, noise.period
    sweep = np.zeros((15, 3))
    for k in range(3):
        sweep[k, k] = 1.0
    for i in range(4):
        x, y, z = state.points[i, 0], state.points[i, 1], state.points[i, 2]
        at = _V + 3 * i
        sweep[at, 1], sweep[at, 2] = -z, y
        sweep[at + 1, 0], sweep[at + 1, 2] = z, -x
        sweep[at + 2, 0], sweep[at + 2, 1] = -y, x
    gyro = dt * noise.gyro
    for i in range(15):
        for j in range(15):
            P[i, j] += gyro * (
                sweep[i, 0] * sweep[j, 0] + sweep[i, 1] * sweep[j, 1] + sweep[i, 2] * sweep[j, 2]
            )
    for i in range(2):
        firm = contact[i] * (1.0 - state.doubt[i])
        moves = dt * noise.stance**firm * noise.swing ** (1.0 - firm)
        for k in range(3):
            P[_D + 3 * i + k, _D + 3 * i + k] += moves
    for k in range(3):
        P[_V + k, _V + k] += dt * noise.accelerometer
        P[_BG + k, _BG + k] += dt * noise.gyro_bias
        P[_BA + k, _BA + k] += dt * noise.accelerometer_bias


@compiled
def _correct_by_feet(state: FilterState, noise: FilterNoise, feet: FloatArray) -> None:
    """z = R h + p - d of each foot."""
    P = state.covariance
    correction, gain, z = np.zeros(SIZE), np.empty(SIZE), np.empty((2, 3))
    for i in range(2):
        arm = turned(state.rotation, feet[i])
        for k in range(3):
            z[i, k] = arm[k] + state.points[1, k] - state.points[2 + i, k]
        _let_slip(state, noise, i, z[i])
    for i in range(2):
        for k in range(3):
            p, d = _P + k, _D + 3 * i + k
            for j in range(SIZE):
                gain[j] = P[d, j] - P[p, j]
            rest = z[i, k] - correction[d] + correction[p]
            _take(P, gain, gain[d] - gain[p] + noise.kinematics, rest, correction)
    _apply(state, noise, correction)


@compiled
def _take(
    P: FloatArray, gain: FloatArray, variance: float, rest: float, correction: FloatArray
) -> None:
    """Update with one scalar measurement: `gain` is H P, `rest` the remaining innovation."""
    scale = 1.0 / variance
    for i in range(SIZE):
        share = scale * gain[i]
        correction[i] += share * rest
        for j in range(SIZE):
            P[i, j] -= share * gain[j]


@compiled
def _let_slip(state: FilterState, noise: FilterNoise, i: int, z: FloatArray) -> None:
    """Raise the contact's covariance where the innovation is an outlier for a still foot."""
    P, d = state.covariance, _D + 3 * i
    S = np.empty((3, 3))
    for a in range(3):
        for b in range(3):
            S[a, b] = P[d + a, d + b] + P[_P + a, _P + b] - P[d + a, _P + b] - P[_P + a, d + b]
        S[a, a] += noise.kinematics
    x, y, w = cross(S[1], S[2]), cross(S[2], S[0]), cross(S[0], S[1])
    determinant = S[0, 0] * x[0] + S[0, 1] * x[1] + S[0, 2] * x[2]
    square = 0.0
    for k in range(3):
        square += z[k] * (x[k] * z[0] + y[k] * z[1] + w[k] * z[2])
    square /= determinant
    state.doubt[i] *= noise.slip_decay
    if square > noise.gate:
        state.doubt[i] = 1.0
        for k in range(3):
            P[d + k, d + k] += noise.period * noise.swing


@compiled
def _apply(state: FilterState, noise: FilterNoise, correction: FloatArray) -> None:
    """X <- exp(correction) X, biases added.

    The gyro's bias saturates: on a vehicle that accelerates it would absorb the contradiction of
    IMU and resting feet.
    """
    turn, jacobian, new = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    exponential(correction[0], correction[1], correction[2], turn, jacobian)
    multiply(turn, state.rotation, new)
    state.rotation[:] = new
    for i in range(4):
        moved = turned(turn, state.points[i])
        shift = turned(jacobian, correction[_V + 3 * i : _V + 3 * i + 3])
        for k in range(3):
            state.points[i, k] = moved[k] + shift[k]
    for k in range(3):
        most, bias = noise.largest_gyro_bias, state.gyro_bias[k] + correction[_BG + k]
        state.gyro_bias[k] = max(-most, min(most, bias))
        state.accelerometer_bias[k] += correction[_BA + k]


@compiled
def take_origin_along(filters: Records[FilterState], farthest: float) -> None:
    """Move the filter's origin o to the IMU, once the IMU is far from it.

    The distance of foot and pelvis is a small difference of large numbers where both are far from
    the point about which the heading errs. About another origin, xi_p' = xi_p + xi_R x o, and
    likewise for the contacts.

    Args:
        filters: Changed in place. Shape (1,).
        farthest: Distance from the origin at which it moves. In m.
    """
    state = filters[0]
    position, P = state.points[1], state.covariance
    if abs(position[0]) + abs(position[1]) < farthest:
        return
    x, y = position[0], position[1]
    for i in range(1, 4):
        state.points[i, 0] -= x
        state.points[i, 1] -= y
    state.origin[0] += x
    state.origin[1] += y
    _shift(P, x, y)
    _shift(P.T, x, y)


@compiled
def _shift(P: FloatArray, x: float, y: float) -> None:
    """Move rows of the covariance, or of its transpose, to a new origin: position and contacts."""
    for j in range(SIZE):
        across = (-P[_R + 2, j] * y, P[_R + 2, j] * x, P[_R, j] * y - P[_R + 1, j] * x)
        for i in range(3):
            for k in range(3):
                P[_P + 3 * i + k, j] += across[k]


@compiled
def _correct_by_attitude(
    state: FilterState,
    noise: FilterNoise,
    measured: FloatArray,
    rate: FloatArray,
    correction: FloatArray,
) -> None:
    """z = Log(R_imu exp(delay rate) R^T), from its skew part."""
    P, R = state.covariance, state.rotation
    turn, late, gain = small_turn(R, measured), turned(R, rate), np.empty(SIZE)
    for k in range(3):
        z = turn[k] + noise.attitude_delay * late[k]
        for j in range(SIZE):
            gain[j] = P[k, j]
        r = noise.heading if k == 2 else noise.tilt
        _take(P, gain, gain[k] + r, z - correction[k], correction)


@compiled
def _correct_by_hanging(state: FilterState, variance: float, correction: FloatArray) -> None:
    """z = -v: a robot that hangs for long is at rest; too weak to matter between two steps."""
    P, gain = state.covariance, np.empty(SIZE)
    for k in range(3):
        for j in range(SIZE):
            gain[j] = P[_V + k, j]
        rest = -state.points[0, k] - correction[_V + k]
        _take(P, gain, gain[_V + k] + variance, rest, correction)


@compiled
def _read_pelvis(
    estimate: FilterState,
    noise: FilterNoise,
    body: Body,
    angular_velocity: FloatArray,
    state: RobotState,
) -> bool:
    """Compute the pelvis from the filter's IMU; False where the filter has diverged.

    Args:
        estimate, noise, body: See `move`.
        angular_velocity: Measured. Shape (3,), in rad/s.
        state: Gets angular velocity less its bias, position with the height above `body.ground`,
            velocity, covariance.
    """
    P, R, points = estimate.covariance, estimate.rotation, estimate.points
    rate, load, covariance = state.angular_velocity, state.foot_load, state.covariance
    for k in range(3):
        rate[k] = angular_velocity[k] - estimate.gyro_bias[k]
    swept, arm = turned(R, cross(rate, body.imu)), turned(R, body.imu)
    total = load[0] + load[1]
    touching = 0 if state.contact_probability[0] > state.contact_probability[1] else 1
    if state.contact_probability[touching] < 0.5:
        body.aloft += noise.period
    elif body.aloft < _ALOFT or total >= 1.0:
        body.aloft = 0.0
    else:  # put down on other ground, until the feet carry the robot
        body.ground = points[2 + touching, 2] - noise.sole_radius
    if total > 0.0:
        sole = (load[0] * points[2, 2] + load[1] * points[3, 2]) / total
        follow = 1.0 - math.exp(-body.height_bandwidth * min(1.0, total) * noise.period)
        body.ground += follow * (sole - noise.sole_radius - body.ground)
    for k in range(3):
        state.v[k] = points[0, k] - swept[k]
        state.q[k] = points[1, k] - arm[k] + (estimate.origin[k] if k < 2 else -body.ground)
        covariance[k] = _point_variance(P, points[1], _P, k)
        covariance[6 + k] = _point_variance(P, points[0], _V, k)
        covariance[9 + k] = P[_BG + k, _BG + k] + noise.gyro / noise.period
    heading = math.hypot(R[0, 0], R[1, 0])
    c, s = (R[0, 0] / heading, R[1, 0] / heading) if heading > 0.0 else (1.0, 0.0)
    covariance[3] = P[2, 2]
    covariance[4] = s * s * P[0, 0] + c * c * P[1, 1] - 2.0 * s * c * P[0, 1]
    covariance[5] = c * c * P[0, 0] + s * s * P[1, 1] + 2.0 * s * c * P[0, 1]
    total = R.sum() + points.sum() + estimate.accelerometer_bias.sum()
    sound = math.isfinite(total + estimate.ground)
    for k in range(len(P)):
        sound = sound and 0.0 < P[k, k] < math.inf  # NaN compares false
    return sound


@compiled
def _point_variance(P: FloatArray, point: FloatArray, at: int, k: int) -> float:
    """Variance of one coordinate k of a point: error of the filter plus xi_R x point."""
    i, j = (k + 1) % 3, (k + 2) % 3
    a, b = point[j], -point[i]
    value: float = P[at + k, at + k] + 2.0 * (a * P[at + k, i] + b * P[at + k, j])
    value += a * a * P[i, i] + b * b * P[j, j] + 2.0 * a * b * P[i, j]
    return value


_HANGING_SPEED = 0.1  # m/s, of a robot in the harness
_HANGING_TIME = 0.5  # s, correlation time of this speed
_WALKING_NOISE = 0.6  # m/s^2/sqrt(Hz), of walking: 2 m/s^2 that last 0.05 s
_FARTHEST = 10.0  # m, of the IMU from the filter's origin
_ALOFT = 1.0  # s without contact, after which the robot may stand on other ground
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

    A foot's contact is a probability c: its contact point is a random walk with the variance
    stance^(c) swing^(1-c). So a foot in the air gives no information, and a foot that takes load
    gives more and more. A foot whose innovation is beyond `slip_gate` slips: its contact point is
    estimated anew, and the foot is trusted again with the time constant `slip_time`.
    In flight the filter integrates the IMU alone; while the robot hangs for long, the velocity goes
    to zero.

    The error of the IMU's own attitude is nearly constant for a long time. It counts as white
    noise with the same information: error^2 * 2 error_time / period. Hence standing feet and the
    accelerometer decide roll and pitch, and the IMU decides the heading in the long run.

    The state's height is that above the ground under the loaded feet, as in the controller and in
    the kinematic estimator.

    Source:
        Hartley, Ghaffari, Eustice, Grizzle, "Contact-aided invariant extended Kalman filtering for
        robot state estimation", IJRR 2020. Added here: graded contact, gating, the rolling sole,
        the IMU's own attitude.
    """

    def __init__(self, config: EstimatorConfig, period: float) -> None:
        self._filter = FilterState()
        self._noise = FilterNoise()
        self._blind = False
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

    def coast(self, blind: bool) -> None:
        """Set whether the accelerometer is lost, so that samples have gravity in its place."""
        if blind is not self._blind:
            self._blind = blind
            self._set_noise()

    def _move(self, sensors: Sensors) -> None:
        if not self._started:
            self._start()
        state, legs = self._state.record, self._legs.records
        body, noise = self._body.records, self._noise.records
        if not move(sensors.record, state, legs, body, self._filter.records, noise):
            self.restart()
            raise SensorError("the filter has diverged: the estimate begins anew")

    def _start(self) -> None:
        """Begin at rest with the IMU's orientation, the lower sole on the ground."""
        self._started = True
        start, body = self._filter, self._body
        R, points = body.attitude, start.points
        start.rotation = R
        points[1] = R @ body.imu
        points[1, 2] += self._first_height()
        start.origin[:] = self._state.q[:2]
        for i in range(2):
            points[2 + i] = points[1] + R @ body.arms[i]
            start.soles[i] = R @ self._legs.states[i].foot_rotation
        start.covariance = np.diag(np.square(np.ravel(_START)))

    def _set_noise(self) -> None:
        c, noise, period = self._config.filter, self._noise, self._period
        persistent = 2.0 * c.error_time / period
        noise.period = period
        noise.gyro = c.gyro_noise**2
        noise.accelerometer = (_WALKING_NOISE if self._blind else c.accelerometer_noise) ** 2
        noise.gyro_bias = c.gyro_drift**2
        noise.largest_gyro_bias = c.gyro_bias
        noise.accelerometer_bias = c.accelerometer_drift**2
        noise.stance = c.stance_noise**2
        noise.swing = c.swing_noise**2
        noise.kinematics = c.kinematics_noise**2
        noise.tilt = c.tilt_error**2 * persistent
        noise.heading = c.heading_error**2 * persistent
        noise.hanging = _HANGING_SPEED**2 * 2.0 * _HANGING_TIME / period
        noise.gate = c.slip_gate**2
        noise.slip_decay = math.exp(-period / c.slip_time)
        noise.attitude_delay = c.attitude_delay
        noise.sole_radius = robot.SOLE_RADIUS
        front, back = np.array(robot.FOOT_CONTACTS)
        noise.sole_line = 0.5 * (front - back)
        noise.sole_flat = _SOLE_FLAT
        noise.ground_time = _GROUND_TIME
        noise.ground_still = _GROUND_STILL
