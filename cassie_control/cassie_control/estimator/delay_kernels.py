"""Which of a pair comes late: what speaks for each delay, summed up; compiled. See `monitor`.

In all of this `watch` is a record of `monitor_records.WATCH_TYPE`, `limit` one of `LIMITS_TYPE`,
and `i` the pair.
"""

from __future__ import annotations

from typing import Any

from cassie_gaits.compiled import compiled

P, V = 0, 1

DELAYS = (0.02, 0.03, 0.04)
"""Delays that are looked for; those between them fit one of these well enough. In s."""

DELAY_TICKS = 40
"""Ticks for which the motions of a pair are kept: the longest of `DELAYS` at 1 kHz."""

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
_UNDECIDED = 0.5  # of what is enough, that the other one must be below
_LARGEST = 1.5  # of what is enough


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
    for m in range(len(DELAYS)):
        then = (watch.ticks - limit.delay_ticks[m]) % DELAY_TICKS
        for kind in range(2):
            left = step - watch.past[V, then, i] if kind == P else turn - watch.past[P, then, i]
            gain = apart - _WORSE * left**2 - _FADE * enough
            # At an even speed one that stands still, leaps or has spikes makes the other look late.
            if watch.same[1 - kind, i] or (spikes if kind == P else leapt):
                gain = min(gain, 0.0)
            sum_ = watch.evidence[m, kind, i] + min(gain, _AT_ONCE * enough)
            watch.evidence[m, kind, i] = max(0.0, min(sum_, _LARGEST * enough))
    now = watch.ticks % DELAY_TICKS
    watch.past[P, now, i], watch.past[V, now, i] = step, turn
    for kind in range(2):
        other = watch.evidence[:, 1 - kind, i].max()
        if watch.evidence[:, kind, i].max() > enough and other < _UNDECIDED * enough:
            return kind
    return -1
