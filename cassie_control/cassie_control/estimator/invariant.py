"""State estimation by a contact-aided invariant extended Kalman filter."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from cassie_control.errors import SensorError
from cassie_control.estimator.base import LegEstimator, finish
from cassie_control.estimator.config import EstimatorConfig
from cassie_control.estimator.fusion import read_pelvis
from cassie_gaits import robot
from cassie_gaits.compiled import compiled
from cassie_msgs.layout import Sensors

FloatArray = npt.NDArray[np.float64]
Vector = tuple[float, float, float]
RecordArray = npt.NDArray[np.void]


@compiled
def cross(a: Any, b: Any) -> Vector:
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@compiled
def rotated(matrix: FloatArray, v: Any) -> Vector:
    """Matrix times vector."""
    return (
        matrix[0, 0] * v[0] + matrix[0, 1] * v[1] + matrix[0, 2] * v[2],
        matrix[1, 0] * v[0] + matrix[1, 1] * v[1] + matrix[1, 2] * v[2],
        matrix[2, 0] * v[0] + matrix[2, 1] * v[1] + matrix[2, 2] * v[2],
    )


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
def times(left: FloatArray, right: FloatArray, out: FloatArray) -> None:
    """Product of two 3 x 3 matrices; `out` is neither of them."""
    for i in range(3):
        for j in range(3):
            out[i, j] = (
                left[i, 0] * right[0, j] + left[i, 1] * right[1, j] + left[i, 2] * right[2, j]
            )


SIZE = 21
"""Errors of the filter: orientation, velocity, position, left and right contact, gyro and
accelerometer bias, three of each."""

GRAVITY = 9.81
_R, _V, _P, _D, _BG, _BA = 0, 3, 6, 9, 15, 18


@compiled
def filter_step(
    filters: RecordArray,
    noises: RecordArray,
    angular_velocity: FloatArray,
    specific_force: FloatArray,
    attitude: FloatArray,
    feet: FloatArray,
    foot_rotations: FloatArray,
    contact: FloatArray,
) -> None:
    """Predict over one period with the IMU, then correct.

    Args:
        filters: State, of `FILTER_TYPE`. Shape (1,).
        noises: Figures, of `NOISE_TYPE`. Shape (1,).
        angular_velocity: Mean over the period, pelvis frame. Shape (3,), in rad/s.
        specific_force: The same at the IMU. Shape (3,), in m/s^2.
        attitude: The IMU's own orientation, to the world, `attitude_delay` ago. Shape (3, 3).
        feet: Middle of each sole's centre line from the IMU, pelvis frame. Shape (2, 3), in m.
        foot_rotations: Toe links to pelvis. Shape (2, 3, 3).
        contact: Probability of each foot's contact. Shape (2,).
    """
    state, noise = filters[0], noises[0]
    turned = np.empty((3, 3))
    _predict(state, noise, angular_velocity, specific_force, contact)
    for i in range(2):
        times(state.rotation, foot_rotations[i], turned)
        _roll(state, noise, i, turned, contact[i])
        state.soles[i] = turned
    _correct_by_feet(state, noise, feet)
    correction = np.zeros(SIZE)
    _correct_by_attitude(state, noise, attitude, angular_velocity, correction)
    touching = max(contact[0], contact[1])
    if touching < 0.5:
        _correct_by_hanging(state, noise.hanging / (1.0 - touching) ** 2, correction)
    _apply(state, noise, correction)


@compiled
def _predict(
    state: Any, noise: Any, angular_velocity: FloatArray, specific_force: FloatArray, contact: Any
) -> None:
    """X over one period, with what the IMU measured less its biases."""
    dt = noise.period
    bias = state.gyro_bias
    w = (
        dt * (angular_velocity[0] - bias[0]),
        dt * (angular_velocity[1] - bias[1]),
        dt * (angular_velocity[2] - bias[2]),
    )
    _grow(state, noise, contact)
    turn, jacobian, turned = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    exponential(w[0], w[1], w[2], turn, jacobian)
    bias = state.accelerometer_bias
    force = (
        specific_force[0] - bias[0],
        specific_force[1] - bias[1],
        specific_force[2] - bias[2],
    )
    force = rotated(state.rotation, rotated(jacobian, force))
    velocity, position = state.points[0], state.points[1]
    for k in range(3):
        a = force[k] - (GRAVITY if k == 2 else 0.0)
        position[k] += dt * (velocity[k] + 0.5 * dt * a)
        velocity[k] += dt * a
    times(state.rotation, turn, turned)
    state.rotation[:] = turned


@compiled
def _roll(state: Any, noise: Any, i: int, sole: FloatArray, contact: float) -> None:
    """Move the middle of a foot that turned on the ground without slipping.

    The small turn is the skew part of after before^T. A sole that is not level with the ground
    stands on one end of its line, and on its round edge: the middle moves by
    turn x (radius up - end).
    """
    before = state.soles[i]
    turn = [0.0, 0.0, 0.0]
    for k in range(3):
        a, b = (k + 1) % 3, (k + 2) % 3
        for c in range(3):
            turn[k] += 0.5 * (sole[b, c] * before[a, c] - sole[a, c] * before[b, c])
    line = rotated(sole, noise.sole_line)
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
def _grow(state: Any, noise: Any, contact: FloatArray) -> None:
    """Covariance over one period: P = F P F^T + Q with F = 1 + A dt."""
    _flow(state, noise.period, state.covariance)
    _flow(state, noise.period, state.covariance.T)
    _add_noise(state, noise, contact)


@compiled
def _flow(state: Any, dt: float, P: FloatArray) -> None:
    """P <- F P; rows in an order in which each still finds the old ones that it needs."""
    R = state.rotation
    for j in range(SIZE):
        gyro = rotated(R, (dt * P[_BG, j], dt * P[_BG + 1, j], dt * P[_BG + 2, j]))
        force = rotated(R, (dt * P[_BA, j], dt * P[_BA + 1, j], dt * P[_BA + 2, j]))
        for k in range(3):
            P[_P + k, j] += dt * P[_V + k, j]
        P[_V, j] += dt * GRAVITY * P[_R + 1, j]
        P[_V + 1, j] -= dt * GRAVITY * P[_R, j]
        for i in range(4):
            swept = cross(state.points[i], gyro)
            for k in range(3):
                P[_V + 3 * i + k, j] -= swept[k]
        for k in range(3):
            P[_V + k, j] -= force[k]
            P[_R + k, j] -= gyro[k]


@compiled
def _add_noise(state: Any, noise: Any, contact: FloatArray) -> None:
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
def _correct_by_feet(state: Any, noise: Any, feet: FloatArray) -> None:
    """z = R h + p - d of each foot."""
    P = state.covariance
    correction, gain, z = np.zeros(SIZE), np.empty(SIZE), np.empty((2, 3))
    for i in range(2):
        arm = rotated(state.rotation, feet[i])
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
    """One scalar measurement: `gain` is H P, `rest` what of the innovation is left."""
    scale = 1.0 / variance
    for i in range(SIZE):
        share = scale * gain[i]
        correction[i] += share * rest
        for j in range(SIZE):
            P[i, j] -= share * gain[j]


@compiled
def _let_slip(state: Any, noise: Any, i: int, z: FloatArray) -> None:
    """Widen the contact's covariance where the innovation is too far off for a still foot."""
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
def _apply(state: Any, noise: Any, correction: FloatArray) -> None:
    """X <- exp(correction) X, biases added.

    On a vehicle that accelerates the gyro's would take in what the resting feet contradict.
    """
    turn, jacobian, turned = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    exponential(correction[0], correction[1], correction[2], turn, jacobian)
    times(turn, state.rotation, turned)
    state.rotation[:] = turned
    for i in range(4):
        moved = rotated(turn, state.points[i])
        shift = rotated(jacobian, correction[_V + 3 * i : _V + 3 * i + 3])
        for k in range(3):
            state.points[i, k] = moved[k] + shift[k]
    for k in range(3):
        most, bias = noise.largest_gyro_bias, state.gyro_bias[k] + correction[_BG + k]
        state.gyro_bias[k] = max(-most, min(most, bias))
        state.accelerometer_bias[k] += correction[_BA + k]


@compiled
def _correct_by_attitude(
    state: Any, noise: Any, measured: FloatArray, rate: FloatArray, correction: FloatArray
) -> None:
    """z = Log(R_imu exp(delay rate) R^T), from its skew part."""
    P, R = state.covariance, state.rotation
    z = np.empty(3)
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        z[k] = 0.0
        for a in range(3):
            z[k] += 0.5 * (measured[j, a] * R[i, a] - measured[i, a] * R[j, a])
    late, gain = rotated(R, rate), np.empty(SIZE)
    for k in range(3):
        z[k] += noise.attitude_delay * late[k]
        for j in range(SIZE):
            gain[j] = P[k, j]
        r = noise.heading if k == 2 else noise.tilt
        _take(P, gain, gain[k] + r, z[k] - correction[k], correction)


@compiled
def _correct_by_hanging(state: Any, variance: float, correction: FloatArray) -> None:
    """z = -v: what hangs for long does not fly; too weak to matter between two steps."""
    P, gain = state.covariance, np.empty(SIZE)
    for k in range(3):
        for j in range(SIZE):
            gain[j] = P[_V + k, j]
        rest = -state.points[0, k] - correction[_V + k]
        _take(P, gain, gain[_V + k] + variance, rest, correction)


FILTER_TYPE = np.dtype(
    [
        ("rotation", float, (3, 3)),  # IMU to world
        ("points", float, (4, 3)),  # world: velocity, position of the IMU, left, right contact
        ("gyro_bias", float, 3),  # rad/s
        ("accelerometer_bias", float, 3),  # m/s^2
        ("covariance", float, (SIZE, SIZE)),
        ("soles", float, (2, 3, 3)),  # orientation of each foot in the world at the last sample
        ("ground", float),  # rise of the ground ahead, along the feet
        ("doubt", float, 2),  # 0..1, of each foot: 1 when it slips, fading
    ]
)
"""State of the filter."""

NOISE_TYPE = np.dtype(
    [
        ("period", float),  # s
        ("gyro", float),  # variances by time: (rad/s)^2 s
        ("accelerometer", float),  # (m/s^2)^2 s
        ("gyro_bias", float),  # (rad/s)^2 / s
        ("largest_gyro_bias", float),  # rad/s
        ("accelerometer_bias", float),  # (m/s^2)^2 / s
        ("stance", float),  # m^2/s, of a contact under load
        ("swing", float),  # m^2/s, of a foot in the air
        ("kinematics", float),  # m^2, of a foot's position from the pelvis
        ("tilt", float),  # rad^2, of the IMU's own roll and pitch, as white noise
        ("heading", float),  # rad^2, of its yaw
        ("hanging", float),  # (m/s)^2, of the velocity of a robot that does not touch the ground
        ("gate", float),  # squared Mahalanobis distance beyond which a foot slips
        ("slip_decay", float),  # of the doubt, over one period
        ("attitude_delay", float),  # s
        ("sole_radius", float),  # m
        ("sole_line", float, 3),  # from the middle of the sole's centre line to its front, toe link
        ("sole_flat", float),  # m, height of a sole's end over the ground below which both touch
        ("ground_time", float),  # s, in which the ground's rise is learned from a still foot
        ("ground_still", float),  # rad/s, turn rate of such a foot
    ]
)
"""What the filter takes for granted."""


@compiled
def move(
    samples: RecordArray,
    states: RecordArray,
    pairs: RecordArray,
    bodies: RecordArray,
    filters: RecordArray,
    noises: RecordArray,
) -> bool:
    """The filter, and the state that follows from it; False where the filter has diverged.

    Args:
        samples: `Sensors.record`. Shape (1,).
        states: Result, `RobotState.record`. Shape (1,).
        pairs: Legs as `read_legs` left them, `LegPair.record`. Shape (1,).
        bodies: The same, of `base.BODY_TYPE`. Shape (1,).
        filters: Of `FILTER_TYPE`. Shape (1,).
        noises: Of `NOISE_TYPE`. Shape (1,).
    """
    sample, state, pair, body = samples[0], states[0], pairs[0], bodies[0]
    filter_step(
        filters,
        noises,
        sample.angular_velocity,
        sample.linear_acceleration,
        body.attitude,
        body.arms,
        pair.states.foot_rotation,
        state.contact_probability,
    )
    if not read_pelvis(filters[0], noises[0], body, sample.angular_velocity, state):
        return False
    finish(state, pair, body, filters[0].rotation)
    return True


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
        self._soles: FloatArray = self._legs.records["states"]["foot_rotation"][0]
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
        state, legs = self._state.record, self._legs.records
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
