"""Arithmetic of the invariant filter, compiled. See `invariant` for the equations.

The covariance's rows and columns are those of `filter_records`; blocks of three.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from cassie_control.estimator.rotation_kernels import cross, exponential, rotated, times
from cassie_gaits.compiled import compiled

FloatArray = npt.NDArray[np.float64]
RecordArray = npt.NDArray[np.void]

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
        filters: State, of `filter_records.FILTER_TYPE`. Shape (1,).
        noises: Figures, of `filter_records.NOISE_TYPE`. Shape (1,).
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
