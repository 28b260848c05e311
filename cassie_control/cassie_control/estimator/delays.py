"""Which of a pair comes late: what speaks for each delay, summed up; compiled. See `faults`.

In all of this `watch` is a record of `faults.WATCH_TYPE`, `limit` one of `LIMITS_TYPE`,
and `i` the pair.
"""

from __future__ import annotations

from typing import Any

from cassie_gaits.compiled import compiled

P, V = 0, 1

DELAYS = tuple(0.001 * ms for ms in range(20, 101, 2))
"""Delays that are looked for; those between them fit one of these well enough. In s."""

KEPT_TICKS = 201
"""Ticks for which the motions of a pair are kept: this one and the longest of `DELAYS` at 2 kHz."""

RESPONSE_TICKS = 36
"""Ticks for which steps are kept: the joints' velocity filter answers one for 18 ms, at 2 kHz."""

HARDLY_A_SPIKE = 0.3
"""Fading count of small spikes of a velocity below which there was none of late."""

LEAPT = 0.6
"""Of what position and velocity are apart, from which on a leap of the position explains it."""

_LEAP = 0.25  # of the least jump, from which on it is one
_WORSE = 3.0  # times what a delay leaves unexplained speaks against it
_FADE = 0.01  # of what is enough, per tick
_AT_ONCE = 0.25  # of what is enough, that one tick can add: a landing lasts for fewer than five
_UNDECIDED = 0.5  # of what speaks for one, that what speaks for the other must be below
_LARGEST = 4.0  # of what is enough


@compiled
def weigh(watch: Any, limit: Any, i: int, turn: float) -> int:
    """Which of a pair moves now as the other one did one of `DELAYS` ago; -1 if none.

    For each delay of each of the two a sum over ticks, never below zero, of how much better than
    none it explains what they do (the cumulative sum test of Page, Biometrika 1954). So what was
    before the delay began does not count, and the first movement tells.

    Args:
        turn: What the velocity says now. In rad.
    """
    step = 0.0  # what the position says that the velocity should say
    for k in range(limit.response_ticks[i]):
        step += limit.response[k, i] * watch.steps[k, i]
    # Without the filter in front of the velocity they agree at once.
    apart = min((step - turn) ** 2, (watch.steps[0, i] - turn) ** 2)
    spikes = watch.spikes[1, i] >= HARDLY_A_SPIKE
    leapt = watch.leap[i] > max(_LEAP * limit.jump[i], LEAPT * abs(watch.apart[i]))
    enough = limit.evidence[i]
    fade = _FADE * enough
    now = watch.ticks % KEPT_TICKS
    watch.past[P, i, now], watch.past[V, i, now] = step, turn
    if apart <= fade and watch.doubt[P, i] + watch.doubt[V, i] <= 0.0:
        return -1
    for kind in range(2):
        moved, past = (step, turn)[kind], watch.past[1 - kind, i]
        # At an even speed one that stands still, leaps or has spikes makes the other look late.
        silent = watch.same[1 - kind, i] > 0 or (spikes if kind == P else leapt)
        most, sums = 0.0, watch.evidence[kind, i]
        for m in range(len(DELAYS)):
            then = now - limit.delay_ticks[m]
            left = moved - past[then if then >= 0 else then + KEPT_TICKS]
            gain = min(apart - _WORSE * left * left - fade, 0.0 if silent else _AT_ONCE * enough)
            sums[m] = max(0.0, min(sums[m] + gain, _LARGEST * enough))
            most = max(most, sums[m])
        watch.doubt[kind, i] = most
    for kind in range(2):
        most = watch.doubt[kind, i]
        if most > enough and watch.doubt[1 - kind, i] < _UNDECIDED * most:
            return kind
    return -1
