"""Position and velocity that belong together, compared; compiled. See `faults`.

In all of this `watch` is a record of `faults.WATCH_TYPE`, `limit` one of `LIMITS_TYPE`,
and `i` the pair.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from cassie_control.estimator.delays import HARDLY_A_SPIKE, LEAPT, P, V, weigh
from cassie_gaits.compiled import compiled

PAIRS = 19
IMU = 16
"""First pair of the IMU."""

APART_TIME = 0.3
"""Over which what position and velocity differ by fades. In s."""

_TILTED = 0.02  # rad, of the IMU's orientation against its gyro: turning then seems to tilt it
_LATE_TIME = 0.1  # s
_SPIKE_TIME = 0.04  # s
_LATE = 0.010  # s, of delay between position and velocity
_DELAYED = 0.4  # of it, from which on its sign counts
_TIMEOUT = 0.03  # s, to see which of a pair is late
_TAIL = 2.0  # of the velocity filter's delay
_SMALL_SPIKE = 0.35  # of a clear one
_SPIKES = 1.2  # of them that count within `_SPIKE_TIME`: two
_STUCK_TICKS = 3
_FROZEN_TICKS = 15  # for what carries noise
_UNSEEN_POSITION, _UNSEEN_VELOCITY = 0.008, 0.002  # rad
_SEEN_SPEED = 0.5  # rad/s, as which faster motion counts that a velocity does not see
_WRONG_SPEED = 0.5  # rad/s
_NOT_AGAIN = 0.02  # rad, from the trusted position, within which a bad one may be believed again
REST_TIME = 1.0
"""At rest without power, after which all is learned anew. In s."""


@compiled
def look_at_pair(watch: Any, limit: Any, i: int) -> None:
    """Compare position and velocity of a pair, and mark in `bad` which of them is wrong."""
    p, v, dt, hold = watch.position[i], watch.velocity[i], limit.period, limit.hold
    for kind in range(2):
        watch.bad[kind, i] = max(0.0, watch.bad[kind, i] - dt)
    if not limit.low[i] <= p <= limit.high[i]:
        watch.bad[P, i] = hold
        p = watch.last_position[i]
    if not abs(v) <= limit.speed[i]:
        watch.bad[V, i] = hold
        v = watch.last_velocity[0, i]
    step, turn = p - watch.last_position[i], 0.5 * dt * (v + watch.last_velocity[0, i])
    if i >= IMU:
        turn = dt * v
    if abs(step - turn) > limit.jump[i]:
        # At a hard landing a position runs ahead of its filtered velocity: neither jumps.
        last = watch.last_velocity[:, i]
        sudden = abs(v - 2.0 * last[0] + last[1]) * dt > 0.5 * limit.jump[i]
        if sudden and watch.bad[P, i] <= 0.0:
            watch.bad[V, i] = hold
            turn = step
        elif abs(step - watch.steps[0, i]) > limit.jump[i]:
            watch.bad[P, i] = hold
            step = turn
    for k in range(limit.response_ticks[i] - 1, 0, -1):
        watch.steps[k, i] = watch.steps[k - 1, i]
    for k in (2, 1):
        watch.turns[k, i] = watch.turns[k - 1, i]
    watch.steps[0, i], watch.turns[0, i] = step, turn
    watch.peak[i] = max(abs(v), watch.peak[i] * math.exp(-dt / _LATE_TIME))
    _count_same(watch, limit, i, p, v)
    _look_for_spikes(watch, limit, i, v)
    if watch.ticks > 3:
        _look_apart(watch, limit, i, v)
    for k in (3, 2, 1):
        watch.last_velocity[k, i] = watch.last_velocity[k - 1, i]
    watch.last_position[i], watch.last_velocity[0, i] = p, v


@compiled
def _count_same(watch: Any, limit: Any, i: int, p: float, v: float) -> None:
    """Find a channel that is stuck or off: its bits stay the same while its partner moves."""
    step, turn = watch.steps[0, i], watch.turns[0, i]
    most = _SEEN_SPEED * limit.period  # a position that jumps once is no motion
    now, last, moved = (
        (p, v),
        (watch.last_position[i], watch.last_velocity[0, i]),
        (turn, max(-most, min(most, step - turn))),
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
    """Find spikes: velocities of one tick that leave the curve of their neighbours.

    The curve is the cubic through two of them on each side, so that legs that ring on their
    springs, with ten samples a period, do not leave it.
    """
    fade = math.exp(-limit.period / _SPIKE_TIME)
    after, spike, before = watch.last_velocity[:3, i]
    outer = v - watch.last_velocity[3, i]
    out = abs(spike - (4.0 * (after + before) - v - watch.last_velocity[3, i]) / 6.0)
    if abs(after - before) > out or abs(outer - 2.0 * (after - before)) > out:
        out = 0.0  # a step, as at a hard landing, or a neighbour's spike
    for k in range(2):
        bound = limit.spike[i] * (1.0, _SMALL_SPIKE)[k]
        watch.spikes[k, i] = fade * watch.spikes[k, i] + (1.0 if out > bound else 0.0)
    if watch.spikes[0, i] > _SPIKES:
        watch.bad[V, i] = limit.hold


@compiled
def _look_apart(watch: Any, limit: Any, i: int, v: float) -> None:
    """Compare the position with the integrated velocity."""
    dt, late = limit.period, watch.late[:, i]
    step, turn = watch.steps[limit.velocity_lag[i], i], watch.turns[limit.position_lag[i], i]
    watch.apart[i] = watch.apart[i] * math.exp(-dt / APART_TIME) + step - turn
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
    if i >= IMU:
        tilted = _TILTED * (np.abs(watch.turned).sum() - abs(watch.turned[i - IMU]))
        bound, small = bound + tilted, small + tilted
    near = abs(apart) < bound and (abs(delay) < _LATE or abs(apart) < small)
    matched = weigh(watch, limit, i, turn)
    if matched >= 0 or not near:
        _judge(watch, limit, i, matched)


@compiled
def _judge(watch: Any, limit: Any, i: int, matched: int) -> None:
    """Mark the wrong channel of a pair that has grown apart: the late one, or that of `_blame`."""
    if max(watch.bad[P, i], watch.bad[V, i]) <= 0.0:
        watch.guessed[i] = 0
    if matched >= 0 and watch.guessed[i]:
        watch.bad[1 - matched, i] = 0.0
        if i >= IMU and matched == V:  # the axes have one orientation
            watch.bad[P, IMU:] = 0.0
    known = False
    for kind in range(2):
        if watch.bad[kind, i] > 0.0:
            watch.bad[kind, i] = limit.hold
            known = True
    if known:
        return
    kind = matched if matched >= 0 else _blame(watch, i)
    if kind < 0 and watch.unclear[i] < _TIMEOUT:
        watch.unclear[i] += limit.period
        return
    if kind < 0:
        kind = _guess(watch, i)
    watch.unclear[i], watch.guessed[i] = 0.0, matched < 0
    watch.bad[kind, i] = limit.hold
    if kind == P:
        watch.trusted[P, i] = watch.position[i] - watch.apart[i] - watch.turns[0, i]


@compiled
def _blame(watch: Any, i: int) -> int:
    """Channel that is wrong of a pair that has grown apart; -1 while unclear."""
    if watch.leap[i] > LEAPT * abs(watch.apart[i]):
        return P  # also where it stands, and the velocity is 0 for good reason
    if watch.spikes[1, i] >= HARDLY_A_SPIKE:
        return V if watch.spikes[1, i] > 2.0 else -1  # the next one tells
    still = (watch.same[P, i] >= _STUCK_TICKS, watch.same[V, i] >= _STUCK_TICKS)
    if still[0] != still[1]:
        return P if still[0] else V
    return -1


@compiled
def _guess(watch: Any, i: int) -> int:
    """The likelier channel where nothing is sure: by the evidence for delays, or their sign."""
    if watch.spikes[1, i] >= HARDLY_A_SPIKE:
        return V
    if watch.doubt[P, i] != watch.doubt[V, i]:
        return P if watch.doubt[P, i] > watch.doubt[V, i] else V
    return P if watch.late[2, i] < -_DELAYED * _LATE * watch.late[3, i] else V


@compiled
def go_on(watch: Any, limit: Any, i: int) -> None:
    """Replace what is bad: a position by the integrated velocity, a velocity by differences."""
    dt = limit.period
    if watch.bad[P, i] > 0.0 and watch.bad[V, i] > 0.0:
        # Without a position to go on from, a velocity alone is of no use.
        watch.bad[V, i] = max(watch.bad[P, i], watch.bad[V, i])
    bad_p, bad_v = watch.bad[P, i] > 0.0, watch.bad[V, i] > 0.0
    for kind in range(2):
        _look_for_life(watch, i, kind)
    if bad_v:
        follow = 1.0 - math.exp(-dt / 0.004)
        rate = watch.steps[0, i] / dt
        if not bad_p:
            last = watch.trusted[V, i] if math.isfinite(watch.trusted[V, i]) else rate
            watch.trusted[V, i] = last + follow * (rate - last)
        frozen = watch.same[V, i] >= _STUCK_TICKS and abs(rate) > 0.1
        wrong = frozen or abs(watch.velocity[i] - watch.trusted[V, i]) >= _WRONG_SPEED
        _hold(watch, limit, i, V, wrong)
    else:
        watch.trusted[V, i] = watch.velocity[i]
    if bad_p:
        near = _NOT_AGAIN if watch.same[P, i] < _FROZEN_TICKS else _UNSEEN_VELOCITY
        watch.trusted[P, i] += dt * watch.trusted[V, i] if bad_v else watch.turns[0, i]
        wrong = abs(watch.position[i] - watch.trusted[P, i]) >= near  # not where that is NaN
        _hold(watch, limit, i, P, wrong)
    else:
        watch.trusted[P, i] = watch.position[i]


@compiled
def _look_for_life(watch: Any, i: int, kind: int) -> None:
    """Note whether an unbelieved channel changes while a robot without power is moved."""
    if watch.bad[kind, i] > 0.0:
        if watch.life[kind, i] == 0:
            watch.life[kind, i] = 1
        elif watch.same[kind, i] == 0 and watch.powered == 0:
            watch.life[kind, i] = 2
    elif watch.life[kind, i] > 0:
        watch.life[kind, i] = 0
        watch.moved = watch.used  # the estimate begins anew with it


@compiled
def _hold(watch: Any, limit: Any, i: int, kind: int, wrong: bool) -> None:
    """Keep a channel unbelieved while it differs from its replacement.

    After a fall the replacement may be far off, for good. So without power a channel that is alive
    counts as right unless something else speaks against it: while its partner, which is believed,
    agrees with it, or at rest.
    """
    partner = watch.powered == 0 and watch.bad[1 - kind, i] <= 0.0
    if watch.life[kind, i] == 2 and (partner or watch.rest > 0.0):
        watch.bad[kind, i] = min(watch.bad[kind, i], REST_TIME)
    elif wrong:
        watch.bad[kind, i] = limit.hold
