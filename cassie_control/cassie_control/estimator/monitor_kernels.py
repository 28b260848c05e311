"""Arithmetic of the sensor monitor, compiled. See `monitor` for the reasoning."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from cassie_gaits.compiled import compiled

GRAVITY = 9.81
CARRIED = 64
FloatArray = npt.NDArray[np.float64]
RecordArray = npt.NDArray[np.void]

PAIRS = 19
_P, _V = 0, 1
_IMU = 16  # first pair of the IMU
_APART_TIME = 0.3  # s
_TILTED = 0.02  # rad, of the IMU's orientation against its gyro: turning then seems to tilt it
_LATE_TIME = 0.1  # s
_SPIKE_TIME = 0.04  # s
_PULL_TIME = 0.06  # s
_FOOTING_TIME = 0.2  # s of firm feet, after which they know the velocity
_SETTLING = 0.4  # s, after a fault
_UPWARD_TIME = 0.1  # s
_SLOW_TIME = 0.3  # s
_UPWARD_LATE = 0.02  # s
_UPWARD_RATIO = 1.7  # of the mismatches, from which it is late
_STARTING = 1.0  # s
_NOT_ALL_CARRIED = 1.0  # m/s^2
_UPWARD_LEAST = 0.5  # (m/s^2)^2
_LATE = 0.010  # s, of delay between position and velocity
_PATIENCE = 0.03  # s, to see which of a pair is late
_TAIL = 2.0  # of the velocity filter's delay
_SMALL_SPIKE = 0.35  # of a clear one
_STUCK_TICKS = 3
_FROZEN_TICKS = 15  # for what carries noise
_UNSEEN_POSITION, _UNSEEN_VELOCITY = 0.008, 0.002  # rad
_WRONG_SPEED = 0.5  # rad/s
_NOT_AGAIN = 0.02  # rad, from the trusted position, within which a bad one may be believed again


@compiled
def arrange(
    orientation: FloatArray,
    angular_velocity: FloatArray,
    linear_acceleration: FloatArray,
    drive_position: FloatArray,
    drive_velocity: FloatArray,
    joint_position: FloatArray,
    joint_velocity: FloatArray,
    watches: RecordArray,
) -> bool:
    """Take in a sample; whether the orientation is one.

    Args:
        orientation to joint_velocity: Fields of Sensors.
        watches: Of `monitor_records.WATCH_TYPE`. Shape (1,).
    """
    watch = watches[0]
    for i in range(10):
        watch.position[i], watch.velocity[i] = drive_position[i], drive_velocity[i]
    for i in range(6):
        watch.position[10 + i], watch.velocity[10 + i] = joint_position[i], joint_velocity[i]
    for k in range(3):
        watch.velocity[_IMU + k] = angular_velocity[k]
        watch.acceleration[2, k] = watch.acceleration[1, k]
        watch.acceleration[1, k] = watch.acceleration[0, k]
        watch.acceleration[0, k] = linear_acceleration[k]
    q, p = orientation, watch.last_orientation
    square = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
    valid = 0.9 < square < 1.1  # NaN compares false
    if not valid:
        for k in range(3):
            watch.position[_IMU + k] = math.nan
        return False
    if watch.ticks == 0:
        for k in range(4):
            p[k] = watch.orientation[k] = q[k]
    sign = 2.0 if q[0] * p[0] + q[1] * p[1] + q[2] * p[2] + q[3] * p[3] > 0.0 else -2.0
    x = p[3] * q[0] - p[0] * q[3] - p[1] * q[2] + p[2] * q[1]
    y = p[3] * q[1] - p[1] * q[3] - p[2] * q[0] + p[0] * q[2]
    z = p[3] * q[2] - p[2] * q[3] - p[0] * q[1] + p[1] * q[0]
    watch.position[_IMU] = watch.last_position[_IMU] + sign * x
    watch.position[_IMU + 1] = watch.last_position[_IMU + 1] + sign * y
    watch.position[_IMU + 2] = watch.last_position[_IMU + 2] + sign * z
    for k in range(4):
        p[k] = q[k]
    return True


@compiled
def inspect(
    samples: RecordArray,
    watches: RecordArray,
    limits: RecordArray,
    rotation: FloatArray,
    pull: FloatArray,
    footing: float,
    force: float,
) -> bool:
    """Take in a sample and `look`; whether all of it can be believed.

    Args:
        samples: Numbers of Sensors, see `float_records`. Shape (1,).
        watches: Of `monitor_records.WATCH_TYPE`. Shape (1,).
        limits, rotation, pull, footing, force: See `look`.
    """
    sample, watch = samples[0], watches[0]
    arrange(
        sample.orientation,
        sample.angular_velocity,
        sample.linear_acceleration,
        sample.drive_position,
        sample.drive_velocity,
        sample.joint_position,
        sample.joint_velocity,
        watches,
    )
    look(watches, limits, rotation, pull, footing, force)
    good: bool = watch.bad.max() <= 0.0 and watch.bad_acceleration.max() <= 0.0
    return good


@compiled
def look(
    watches: RecordArray,
    limits: RecordArray,
    rotation: FloatArray,
    pull: FloatArray,
    footing: float,
    force: float,
) -> None:
    """Compare what belongs together; afterwards `bad` and `trusted` are those of this sample.

    Args:
        watches: Of `monitor_records.WATCH_TYPE`. Shape (1,).
        limits: Of `monitor_records.LIMITS_TYPE`. Shape (1,).
        rotation: Pelvis to world, last known. Shape (3, 3).
        pull: How the feet corrected the velocity in the world at the last sample. (3,), in m/s.
        footing: How firmly a foot stands, 0..1.
        force: Vertical force of both feet at the last sample. In N.
    """
    watch, limit = watches[0], limits[0]
    if watch.ticks == 0:
        for i in range(PAIRS):
            watch.last_position[i] = watch.position[i]
            watch.last_velocity[:, i] = watch.velocity[i]
            if watch.bad[_P, i] == 0.0 and math.isfinite(watch.position[i]):
                watch.trusted[_P, i] = watch.position[i]
            if watch.bad[_V, i] == 0.0 and math.isfinite(watch.velocity[i]):
                watch.trusted[_V, i] = watch.velocity[i]
        watch.acceleration[1:] = watch.acceleration[0]
    for k in range(3):
        rate = watch.velocity[_IMU + k]
        watch.turned[k] *= math.exp(-limit.period / _APART_TIME)
        watch.turned[k] += limit.period * rate if math.isfinite(rate) else 0.0
    for i in range(PAIRS):
        _look_at_pair(watch, limit, i)
    turned = max(watch.bad[_P, _IMU], watch.bad[_P, _IMU + 1], watch.bad[_P, _IMU + 2])
    for i in range(_IMU, PAIRS):
        watch.bad[_P, i] = turned
    for i in range(PAIRS):
        _go_on(watch, limit, i)
    _turn(watch, limit, turned > 0.0)
    _look_at_acceleration(watch, limit, rotation, pull, footing)
    if _late_upward(watch, limit, rotation, force):
        watch.bad_acceleration[2] = limit.hold
    watch.ticks += 1


@compiled
def _look_at_pair(watch: Any, limit: Any, i: int) -> None:
    p, v, dt, hold = watch.position[i], watch.velocity[i], limit.period, limit.hold
    for kind in range(2):
        watch.bad[kind, i] = max(0.0, watch.bad[kind, i] - dt)
    if not limit.low[i] <= p <= limit.high[i]:
        watch.bad[_P, i] = hold
        p = watch.last_position[i]
    if not abs(v) <= limit.speed[i]:
        watch.bad[_V, i] = hold
        v = watch.last_velocity[0, i]
    step, turn = p - watch.last_position[i], 0.5 * dt * (v + watch.last_velocity[0, i])
    if i >= _IMU:
        turn = dt * v
    if abs(step - turn) > limit.jump[i]:
        fast = abs(v - watch.last_velocity[0, i]) * dt > 0.5 * limit.jump[i]
        watch.bad[_V if fast else _P, i] = hold
        if fast:
            turn = step
        else:
            step = turn
    for k in (2, 1):
        watch.steps[k, i], watch.turns[k, i] = watch.steps[k - 1, i], watch.turns[k - 1, i]
    watch.steps[0, i], watch.turns[0, i] = step, turn
    watch.peak[i] = max(abs(v), watch.peak[i] * math.exp(-dt / _LATE_TIME))
    _count_same(watch, limit, i, p, v)
    _look_for_spikes(watch, limit, i, v)
    if watch.ticks > 3:
        _look_apart(watch, limit, i, v)
    watch.last_position[i], watch.last_velocity[1, i] = p, watch.last_velocity[0, i]
    watch.last_velocity[0, i] = v


@compiled
def _count_same(watch: Any, limit: Any, i: int, p: float, v: float) -> None:
    """A channel whose bits stay the same while its partner moves is stuck, or off."""
    step, turn = watch.steps[0, i], watch.turns[0, i]
    now, last, moved = (
        (p, v),
        (watch.last_position[i], watch.last_velocity[0, i]),
        (turn, step - turn),
    )
    # A velocity that comes late goes on for a while after the position has stopped.
    tail = (_TAIL * limit.velocity_lag[i] * limit.period * watch.peak[i], 0.0)
    unseen = (_UNSEEN_POSITION, _UNSEEN_VELOCITY)
    for kind in range(2):
        if now[kind] == last[kind]:
            watch.same[kind, i] += 1
            watch.unseen[kind, i] += moved[kind]
        else:
            watch.same[kind, i] = 0
            watch.unseen[kind, i] = 0.0
        stuck = watch.same[kind, i] >= _STUCK_TICKS
        stuck = stuck and abs(watch.unseen[kind, i]) > unseen[kind] + tail[kind]
        if stuck and watch.bad[1 - kind, i] <= 0.0:
            watch.bad[kind, i] = limit.hold


@compiled
def _look_for_spikes(watch: Any, limit: Any, i: int, v: float) -> None:
    """Velocities of one tick that leave the line of their neighbours, again and again."""
    fade = math.exp(-limit.period / _SPIKE_TIME)
    out = abs(watch.last_velocity[0, i] - 0.5 * (v + watch.last_velocity[1, i]))
    for k in range(2):
        bound = limit.spike[i] * (1.0, _SMALL_SPIKE)[k]
        watch.spikes[k, i] = fade * watch.spikes[k, i] + (1.0 if out > bound else 0.0)
    if watch.spikes[0, i] > 2.0:
        watch.bad[_V, i] = limit.hold


@compiled
def _look_apart(watch: Any, limit: Any, i: int, v: float) -> None:
    """Position against integrated velocity; the sign of a delay tells which of them is late."""
    dt, late = limit.period, watch.late[:, i]
    step, turn = watch.steps[limit.velocity_lag[i], i], watch.turns[limit.position_lag[i], i]
    watch.apart[i] = watch.apart[i] * math.exp(-dt / _APART_TIME) + step - turn
    leap = min(abs(step - turn), abs(step - watch.last_step[i]))
    watch.leap[i] = max(leap, watch.leap[i] * math.exp(-dt / _LATE_TIME))
    watch.last_step[i] = step
    apart, rate, share = watch.apart[i], 0.5 * (step + turn) / dt, 1.0 - math.exp(-dt / _LATE_TIME)
    late[0] += share * (apart - late[0])
    late[1] += share * (rate - late[1])
    late[2] += share * ((apart - late[0]) * (rate - late[1]) - late[2])
    late[3] += share * ((rate - late[1]) ** 2 - late[3])
    delay = late[2] / max(late[3], limit.excited[i])
    bound = limit.apart[i] + limit.apart_at_speed[i] * watch.peak[i]
    small = 0.5 * limit.apart[i]
    if i >= _IMU:
        tilted = _TILTED * (np.abs(watch.turned).sum() - abs(watch.turned[i - _IMU]))
        bound, small = bound + tilted, small + tilted
    if abs(apart) < bound and (abs(delay) < _LATE or abs(apart) < small):
        return
    known = False
    for kind in range(2):
        if watch.bad[kind, i] > 0.0:
            watch.bad[kind, i] = limit.hold
            known = True
    if known:
        return
    kind = _blame(watch, i)
    if kind < 0 and watch.unclear[i] < _PATIENCE:
        watch.unclear[i] += dt
        return
    kind = abs(kind)
    watch.unclear[i] = 0.0
    watch.bad[kind, i] = limit.hold
    if kind == _P:
        watch.trusted[_P, i] = watch.position[i] - apart - watch.turns[0, i]


@compiled
def _blame(watch: Any, i: int) -> int:
    """Which of a pair that has grown apart is wrong: position or velocity; -1 when unclear."""
    still = (watch.same[_P, i] >= _STUCK_TICKS, watch.same[_V, i] >= _STUCK_TICKS)
    if still[0] != still[1]:
        return _P if still[0] else _V
    if watch.leap[i] > 0.6 * abs(watch.apart[i]):
        return _P
    if watch.spikes[1, i] > 2.0:
        return _V
    late = watch.late[2, i]
    if abs(late) < 0.4 * _LATE * watch.late[3, i]:
        return -1
    return _V if late > 0.0 else _P


@compiled
def _go_on(watch: Any, limit: Any, i: int) -> None:
    """Replace what is bad: a position by the integrated velocity, a velocity by differences."""
    dt = limit.period
    bad_p, bad_v = watch.bad[_P, i] > 0.0, watch.bad[_V, i] > 0.0
    if bad_v:
        follow = 1.0 - math.exp(-dt / 0.004)
        rate = watch.steps[0, i] / dt
        if not bad_p:
            watch.trusted[_V, i] += follow * (rate - watch.trusted[_V, i])
        frozen = watch.same[_V, i] >= _STUCK_TICKS and abs(rate) > 0.1
        if frozen or not abs(watch.velocity[i] - watch.trusted[_V, i]) < _WRONG_SPEED:
            watch.bad[_V, i] = limit.hold
    else:
        watch.trusted[_V, i] = watch.velocity[i]
    if bad_p:
        near = _NOT_AGAIN if watch.same[_P, i] < _FROZEN_TICKS else _UNSEEN_VELOCITY
        watch.trusted[_P, i] += dt * watch.trusted[_V, i] if bad_v else watch.turns[0, i]
        if not abs(watch.position[i] - watch.trusted[_P, i]) < near:
            watch.bad[_P, i] = limit.hold
    else:
        watch.trusted[_P, i] = watch.position[i]


@compiled
def _turn(watch: Any, limit: Any, bad: bool) -> None:
    """The orientation to go on with: the measured one, or the last one turned by the gyro."""
    q = watch.orientation
    if not bad:
        for k in range(4):
            q[k] = watch.last_orientation[k]
        return
    half = 0.5 * limit.period
    x, y, z = (
        half * watch.trusted[_V, 16],
        half * watch.trusted[_V, 17],
        half * watch.trusted[_V, 18],
    )
    a, b, c, w = q[0], q[1], q[2], q[3]
    q[0] = a + w * x + b * z - c * y
    q[1] = b + w * y + c * x - a * z
    q[2] = c + w * z + a * y - b * x
    q[3] = w - a * x - b * y - c * z
    scale = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    for k in range(4):
        q[k] *= scale


@compiled
def _look_at_acceleration(
    watch: Any, limit: Any, rotation: FloatArray, pull: FloatArray, footing: float
) -> None:
    fade, dt = math.exp(-limit.period / _PULL_TIME), limit.period
    a = watch.acceleration
    disturbed = watch.bad.max() > 0.0 or watch.bad_acceleration.max() > 0.0
    if disturbed:  # the filter's velocity takes a while to be right again
        watch.footing = -_SETTLING
    elif footing > 0.9:
        watch.footing += dt
    else:
        watch.footing = min(0.0, watch.footing)
    for k in range(3):
        watch.bad_acceleration[k] = max(0.0, watch.bad_acceleration[k] - dt)
        watch.same_acceleration[k] = watch.same_acceleration[k] + 1 if a[0, k] == a[1, k] else 0
        watch.acceleration_spikes[k] *= math.exp(-dt / _SPIKE_TIME)
        if abs(a[1, k] - 0.5 * (a[0, k] + a[2, k])) > limit.acceleration_spike:
            watch.acceleration_spikes[k] += 1.0
        wrong = not abs(a[0, k]) <= limit.acceleration
        wrong = wrong or watch.same_acceleration[k] >= _FROZEN_TICKS
        wrong = wrong or watch.acceleration_spikes[k] > 2.0
        if wrong:
            watch.bad_acceleration[k] = limit.hold
        body = rotation[0, k] * pull[0] + rotation[1, k] * pull[1] + rotation[2, k] * pull[2]
        if watch.footing < _FOOTING_TIME or disturbed:
            watch.pulled[:, k] = 0.0
        elif _late_acceleration(watch, limit, k, body, a[1, k] - GRAVITY * rotation[2, k], fade):
            watch.bad_acceleration[k] = limit.hold


@compiled
def _late_acceleration(
    watch: Any, limit: Any, k: int, pull: float, acceleration: float, fade: float
) -> bool:
    """Whether the feet correct the velocity along with an acceleration that they know earlier."""
    pulled, share = watch.pulled[:, k], 1.0 - fade
    pulled[0] = fade * pulled[0] + pull
    pulled[1] += share * (pulled[0] * acceleration - pulled[1])
    pulled[2] += share * (acceleration * acceleration - pulled[2])
    late: bool = abs(pulled[0]) > limit.pulled[k] and pulled[1] > limit.late_pull[k] * pulled[2]
    return late


@compiled
def _late_upward(watch: Any, limit: Any, rotation: FloatArray, force: float) -> bool:
    """Whether the upward acceleration follows the springs' force of a while ago, not of now."""
    dt, a = limit.period, watch.acceleration
    up = 0.0
    for k in range(3):
        up += rotation[2, k] * a[0, k]
    carried = force / limit.mass
    if watch.ticks == 0 or watch.bad_acceleration.max() > 0.0:
        watch.upward[0], watch.upward[1] = up, carried
        watch.mismatch[:] = 0.0
        watch.late_upward = 0.0
    slow, share = 1.0 - math.exp(-dt / _SLOW_TIME), 1.0 - math.exp(-dt / _UPWARD_TIME)
    watch.upward[0] += slow * (up - watch.upward[0])
    watch.upward[1] += slow * (carried - watch.upward[1])
    up -= watch.upward[0]
    carried -= watch.upward[1]
    count = max(1, min(CARRIED - 1, int(_UPWARD_LATE / dt + 0.5)))
    before = watch.carried[(watch.ticks - count) % CARRIED]
    watch.carried[watch.ticks % CARRIED] = carried
    watch.mismatch[0] += share * ((up - carried) ** 2 - watch.mismatch[0])
    watch.mismatch[1] += share * ((up - before) ** 2 - watch.mismatch[1])
    # A gantry carries too, or the ground gives way.
    settled = watch.ticks * dt > _STARTING
    if not settled or abs(watch.upward[1] - GRAVITY) > _NOT_ALL_CARRIED:
        watch.mismatch[:] = 0.0
    late = watch.mismatch[0] > max(_UPWARD_LEAST, _UPWARD_RATIO * watch.mismatch[1])
    watch.late_upward = watch.late_upward + dt if late else 0.0
    answer: bool = watch.late_upward > _PATIENCE
    return answer
