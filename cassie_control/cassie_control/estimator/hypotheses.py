"""Of a position and the velocity that belongs to it, which one fails; compiled.

One residual and one bank of hypotheses for each pair. A hypothesis has as evidence the logarithm
of its likelihood ratio to "both are healthy", in nats; `SensorMonitor` has the reasoning. In all
of this `watch` is a record of `faults.WATCH_TYPE`, `limit` one of `faults.LIMITS_TYPE`, and `i`
the pair.
"""

from __future__ import annotations

import math
from typing import Any

from cassie_gaits.compiled import compiled

P, V = 0, 1

PAIRS = 19
IMU = 16
"""First pair of the IMU."""

DELAYS = tuple(0.001 * ms for ms in range(10, 103, 2))
"""Delays that are looked for, and all between them. In s."""

KEPT = 256
"""Ticks for which motions are kept: the longest of `DELAYS` at 2 kHz, and until it is judged."""

RESPONSE_TICKS, WAIT_TICKS = 36, 16
"""Most ticks of a filter's answer, and most that a pair waits to be judged: at 2 kHz."""

CORRELATED = 0.002
"""Over which what is left over is no new evidence. In s."""

OUTLIER = 9.0
"""What is further off is no more evidence for a fault than this (Huber's bound). In variances."""

_AGAINST = 4.0  # times as much it can be against one
_NORMAL = 0.5  # nats, of a healthy sample's own residual
_SUDDEN = 0.2  # of the change of a turn from tick to tick, which samples do not tell
_ROUGH_TIME = 0.01  # s, for which a sudden change is felt: the answer of the slowest filter
_SPIKES_TIME = 0.2  # s
APART_TIME = 0.3
"""Over which what position and velocity differ by fades. In s."""


@compiled
def gain(now: float, then: float) -> float:
    """Evidence of one sample that a channel is late, in nats.

    Args:
        now: Square of the residual without delay. In variances.
        then: With the delay. In variances.
    """
    return 0.5 * (min(now, OUTLIER) - min(then, _AGAINST * OUTLIER)) - _NORMAL


@compiled
def look_at_pair(watch: Any, limit: Any, i: int) -> None:
    """Take in a sample of a pair, and mark in `bad` which of them is wrong."""
    p, v, dt, hold = watch.position[i], watch.velocity[i], limit.period, limit.hold
    for kind in range(2):
        watch.bad[kind, i] = max(0.0, watch.bad[kind, i] - dt)
    if not limit.low[i] <= p <= limit.high[i]:  # NaN compares false
        watch.bad[P, i] = hold
        p = watch.last_position[i]
    if not abs(v) <= limit.speed[i]:
        watch.bad[V, i] = hold
        v = watch.velocities[0, i]
    watch.same[P, i] = watch.same[P, i] + 1 if p == watch.last_position[i] else 0
    watch.same[V, i] = watch.same[V, i] + 1 if v == watch.velocities[0, i] else 0
    for k in range(limit.kept_ticks[i] - 1, 0, -1):
        watch.steps[k, i] = watch.steps[k - 1, i]
    for k in range(limit.wait_ticks[i] + 1, 0, -1):
        watch.velocities[k, i] = watch.velocities[k - 1, i]
    step = p - watch.last_position[i]
    if abs(step) > dt * limit.speed[i]:
        watch.bad[P, i] = hold
        step = dt * v
    watch.steps[0, i], watch.velocities[0, i], watch.last_position[i] = step, v, p
    _compare(watch, limit, i)
    if watch.ticks > limit.kept_ticks[i]:
        _judge(watch, limit, i)


@compiled
def _compare(watch: Any, limit: Any, i: int) -> None:
    """What position and velocity say of this tick, and how suddenly that changes."""
    dt, now, last = limit.period, watch.ticks % KEPT, (watch.ticks - 1) % KEPT
    expected = 0.0
    for k in range(limit.response_ticks[i]):
        expected += limit.response[k, i] * watch.steps[k, i]
    velocities, late = watch.velocities[:, i], limit.position_lag[i]
    before = velocities[late] if i >= IMU else velocities[1]  # a gyro gives the tick's mean
    turn = 0.5 * dt * (velocities[late] + before)
    watch.said[P, i, now], watch.said[V, i, now] = expected, turn
    changes = (
        abs(expected - watch.said[P, i, last]),
        dt * abs(velocities[late] - velocities[late + 1]),
    )
    for kind in range(2):
        fading = watch.rough[kind, i] * math.exp(-dt / _ROUGH_TIME)
        watch.rough[kind, i] = max(changes[kind], fading)
    step = watch.steps[0, i]
    # Without the filter in front of the velocity, the two agree at once.
    unfiltered, residual = turn - step, turn - expected
    for k in range(limit.wait_ticks[i], 0, -1):
        watch.residual[k, i] = watch.residual[k - 1, i]
    watch.residual[0, i] = unfiltered if abs(unfiltered) < abs(residual) else residual
    watch.turn[i] = turn
    watch.apart[i] = watch.apart[i] * math.exp(-dt / APART_TIME) + step - turn


@compiled
def _judge(watch: Any, limit: Any, i: int) -> None:
    """Weigh the hypotheses, and mark the channel that the likeliest of them is about."""
    stuck = (_stuck(watch, limit, i, P), _stuck(watch, limit, i, V))
    evidence = [0.0, 0.0]
    for kind in range(2):
        silent = stuck[1 - kind] > 0.5 * OUTLIER
        evidence[kind] = max(_late(watch, limit, i, kind, silent), stuck[kind])
        evidence[kind] = max(evidence[kind], _spike(watch, limit, i, kind))
    for kind in range(2):
        if evidence[kind] < limit.enough or watch.bad[1 - kind, i] > 0.0:
            continue
        if watch.bad[kind, i] > 0.0:
            watch.bad[kind, i] = limit.hold
        elif evidence[kind] - evidence[1 - kind] > 0.5 * limit.enough:
            watch.bad[kind, i] = limit.hold
            if kind == P:
                watch.trusted[P, i] = watch.last_position[i] - watch.apart[i] - watch.turn[i]


@compiled
def _variance(watch: Any, limit: Any, i: int, change: float) -> float:
    """Variance of a healthy residual in rad^2, where the motion changes so much within a tick."""
    variance: float = limit.noise[i] ** 2 + (_SUDDEN * change) ** 2
    if i >= IMU:
        # The orientation is tilted: turning about one axis, it seems to turn about the others.
        across = abs(watch.turn[IMU]) + abs(watch.turn[IMU + 1]) + abs(watch.turn[IMU + 2])
        variance += (limit.tilt * (across - abs(watch.turn[i]))) ** 2
    return variance


@compiled
def _late(watch: Any, limit: Any, i: int, kind: int, silent: bool) -> float:
    """Evidence that a channel says now what the other one said a while ago.

    For each delay a sum over ticks, never below zero, so that what was before the delay began does
    not count (the cumulative sum test of Page, Biometrika 1954). A channel that seems to be stuck
    is silent: it tells nothing of the other one.
    """
    wait, sums = limit.wait_ticks[i], watch.evidence[kind, i]
    at = watch.ticks - wait
    now, other = watch.said[kind, i, at % KEPT], watch.said[1 - kind, i]
    change = math.hypot(watch.rough[P, i], watch.rough[V, i])
    scale = 1.0 / _variance(watch, limit, i, change)
    healthy = scale * watch.residual[wait, i] ** 2
    if healthy <= 2.0 * _NORMAL and watch.late[kind, i] <= 0.0:
        return 0.0  # no sum can grow
    share = min(1.0, limit.period / CORRELATED)
    most, last = 0.0, other[(at - limit.delay_ticks[0]) % KEPT]
    for m in range(len(DELAYS) - 1):
        then = other[(at - limit.delay_ticks[m + 1]) % KEPT]
        off = max(0.0, max(min(last, then) - now, now - max(last, then)))
        last = then
        more = share * gain(healthy, scale * off * off)
        if silent:
            more = min(0.0, more)
        sums[m] = max(0.0, min(sums[m] + more, 2.0 * limit.enough))
        most = max(most, sums[m])
    watch.late[kind, i] = most
    return most


@compiled
def _stuck(watch: Any, limit: Any, i: int, kind: int) -> float:
    """Evidence that a channel stands still: by how the other one moved while its bits stayed.

    Of an even motion by the sum of the residuals, of an oscillation by that of their squares.
    """
    wait = limit.wait_ticks[i]
    if watch.same[kind, i] <= wait:
        watch.missed[:, kind, i] = 0.0
        return 0.0
    residual, missed = watch.residual[wait, i], watch.missed[:, kind, i]
    variance = _variance(watch, limit, i, watch.rough[1 - kind, i])
    missed[0] += residual
    missed[1] += variance
    share = min(1.0, limit.period / CORRELATED)
    missed[2] = max(0.0, missed[2] + share * gain(residual * residual / variance, 0.0))
    evidence: float = max(0.5 * missed[0] ** 2 / missed[1], missed[2])
    return evidence


@compiled
def _spike(watch: Any, limit: Any, i: int, kind: int) -> float:
    """Evidence of samples that are off both of their neighbours: by what the other one does."""
    k, scale = limit.wait_ticks[i], 1.0 if kind == P else limit.period
    values = watch.steps[:, i] if kind == P else watch.velocities[:, i]
    off = scale * outlier(values[k - 1], values[k], values[k + 1])
    # The filter of a velocity flattens what its position shows.
    untold = (1.0 if kind == P else _SUDDEN) * watch.rough[1 - kind, i]
    noise = limit.uneven[kind, i] ** 2 + untold * untold
    watch.spikes[kind, i] = sum_up(watch.spikes[kind, i], spike_gain(off * off / noise), limit)
    spikes: float = watch.spikes[kind, i]
    return spikes


@compiled
def outlier(after: float, value: float, before: float) -> float:
    """By how much a value is off both of its neighbours; 0 where it is between them."""
    if (value - after) * (value - before) <= 0.0:
        return 0.0
    return min(abs(value - after), abs(value - before))


@compiled
def spike_gain(square: float) -> float:
    """Evidence of one sample that is so far off its neighbours (in variances), in nats."""
    return max(0.0, 0.5 * (square - OUTLIER))


@compiled
def sum_up(evidence: float, more: float, limit: Any) -> float:
    """Evidence of spikes, of which what is enough is forgotten within `_SPIKES_TIME`."""
    evidence += more - limit.period / _SPIKES_TIME * limit.enough
    bounded: float = max(0.0, min(evidence, 2.0 * limit.enough))
    return bounded
