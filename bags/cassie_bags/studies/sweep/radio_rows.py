"""Row of a radio that goes mad: sticks, slider and switches that jump anywhere at any time."""

from __future__ import annotations

from typing import Any

from cassie_bags.run.seed import Stream
from cassie_bags.studies.sweep.course import COMMAND_AT, Budget, walk
from cassie_bags.studies.sweep.row import Row
from cassie_bags.studies.trial import Trial

LASTS = 7.5
"""How long it goes on, by the measured seconds of the budget: five minutes of the usual 40 s."""

_STICKS = {
    "vx": (-0.7, 0.0, 1.2),
    "vy": (-0.3, 0.0, 0.3),
    "yaw_rate": (-0.8, 0.0, 0.8),
    "pitch": (-0.2, 0.0, 0.2),
    "height": (0.6, 0.9, 1.0),
}
"""Lowest, middle and highest position of what the radio has sticks and a slider for."""

_OTHERS = {"roll": 0.3, "com_x": 0.1, "com_y": 0.1}
"""What else an operator may ask for, up to beyond what the supervisor lets through."""

_TRIM = 0.1
"""The same of the four trims. In rad."""

_MODES, _SHARES = ("walk", "stand", "segway"), (0.8, 0.17, 0.03)
_HOLDS, _FLICKS = (0.2, 4.0), (0.02, 0.2)  # s, between two jumps
_FLICK_SHARE = 0.2
_MOVES, _EXTREME = 0.5, 0.6  # chance that a stick moves, and that it goes to a stop or the middle


def radio_rows() -> list[Row]:
    """All rows of this module."""

    def trials(budget: Budget, _: float) -> list[Trial]:
        end = COMMAND_AT + LASTS * budget.seconds
        return [
            walk(budget, seed, (end - 1.0, end), then=jumps(seed, COMMAND_AT, end))
            for seed in budget.each_seed()
        ]

    return [
        Row(
            "radio.jumps",
            "robots that bear sticks and switches at random for 5 min",
            "%",
            100.0,
            (0.0,),
            trials,
            counts=True,
        )
    ]


def jumps(seed: int, begin: float, end: float) -> list[dict[str, Any]]:
    """Operator steps of a radio that jumps from one moment to another, in s."""
    rng, other = Stream.RADIO.rng(seed), Stream.RADIO.rng(seed, 1)
    steps: list[dict[str, Any]] = []
    time = begin
    while time < end:
        step: dict[str, Any] = {"t": round(time, 3)}
        for name, (low, middle, high) in _STICKS.items():
            if rng.random() < _MOVES:
                stop = rng.random() < _EXTREME
                value = rng.choice((low, middle, high)) if stop else rng.uniform(low, high)
                step[name] = round(float(value), 3)
        if rng.random() < _MOVES:
            step["mode"] = str(rng.choice(_MODES, p=_SHARES))
        if other.random() < _MOVES:
            for name, most in _OTHERS.items():
                step[name] = float(other.choice((-most, 0.0, most)))
            step["trims"] = other.choice((-_TRIM, 0.0, _TRIM), 4).tolist()
        steps.append(step)
        time += rng.uniform(*(_FLICKS if rng.random() < _FLICK_SHARE else _HOLDS))
    return steps
