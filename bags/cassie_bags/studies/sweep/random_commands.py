"""Random operators' scripts: steps with random commands at random times, from a seed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from cassie_bags.run.seed import Stream

_STICKS = {
    "vx": (-0.7, 0.0, 1.2),
    "vy": (-0.3, 0.0, 0.3),
    "yaw_rate": (-0.8, 0.0, 0.8),
    "pitch": (-0.2, 0.0, 0.2),
    "height": (0.6, 0.9, 1.0),
}
"""Lowest, middle and highest position of the radio's sticks and slider."""

_OTHERS = {"roll": 0.3, "com_x": 0.1, "com_y": 0.1}
"""Other commands of an operator, up to values beyond the supervisor's limits."""

_TRIM = 0.1  # rad, of the four trims
_MODES, _MODE_CHANCES = ("walk", "stand", "segway"), (0.8, 0.17, 0.03)
_HOLDS, _FLICKS = (0.2, 4.0), (0.02, 0.2)  # s, between two jumps
_FLICK_CHANCE = 0.2
_MOVES, _EXTREME = 0.5, 0.6  # probability of a stick's move, and of a move to a stop or the middle

_LEANS = {"com_x": 0.1, "com_y": 0.1, "roll": 0.25, "pitch": 0.25}
_SHIFTS = {"com_x": 0.05, "com_y": 0.06, "roll": 0.25, "pitch": 0.25}
_HEIGHTS = (0.39, 1.01)


def radio_commands(seed: int, begin: float, end: float) -> list[dict[str, Any]]:
    """Steps of a radio whose sticks, slider and switches jump at random. Times in s."""
    rng, other = Stream.RADIO.rng(seed), Stream.RADIO.rng(seed, 1)

    def pause() -> float:
        return rng.uniform(*(_FLICKS if rng.random() < _FLICK_CHANCE else _HOLDS))

    steps: list[dict[str, Any]] = []
    for time in _times(begin, end, pause):
        step: dict[str, Any] = {"t": round(time, 3)}
        for name, (low, middle, high) in _STICKS.items():
            if rng.random() < _MOVES:
                stop = rng.random() < _EXTREME
                value = rng.choice((low, middle, high)) if stop else rng.uniform(low, high)
                step[name] = round(float(value), 3)
        if rng.random() < _MOVES:
            step["mode"] = str(rng.choice(_MODES, p=_MODE_CHANCES))
        if other.random() < _MOVES:
            for name, most in _OTHERS.items():
                step[name] = float(other.choice((-most, 0.0, most)))
            step["trims"] = other.choice((-_TRIM, 0.0, _TRIM), 4).tolist()
        steps.append(step)
    return steps


def riding_commands(seed: int, begin: float, end: float) -> list[dict[str, Any]]:
    """Steps of random leans and heights within the message's range, for riding. Times in s."""
    rng = Stream.LEANS.rng(seed)
    return [
        {
            "t": round(time, 3),
            **{name: round(rng.uniform(-most, most), 3) for name, most in _LEANS.items()},
            "height": round(rng.uniform(*_HEIGHTS), 3),
        }
        for time in _times(begin, end, lambda: rng.uniform(0.3, 4.0))
    ]


def standing_commands(seed: int, begin: float, end: float) -> list[dict[str, Any]]:
    """Steps of random sliders and sticks of standing, over their whole range. Times in s."""
    rng = Stream.STANDING_COMMANDS.rng(seed)
    return [
        {
            "t": round(time, 3),
            "height": rng.uniform(*_HEIGHTS),
            **{name: rng.uniform(-most, most) for name, most in _SHIFTS.items()},
        }
        for time in _times(begin, end, lambda: rng.uniform(0.1, 3.0))
    ]


def _times(begin: float, end: float, pause: Callable[[], float]) -> Iterator[float]:
    """Times from `begin` on, before `end`, with a pause between two of them. All in s."""
    time = begin
    while time < end:
        yield time
        time += pause()
