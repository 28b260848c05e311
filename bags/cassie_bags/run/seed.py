"""Draws the random values of an experiment from its seed, once for all nodes.

The result is an experiment again, with `drawn: true`: its file can be run as it is and gives
the same run.
"""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cassie_bags.errors import ExperimentError
from cassie_msgs.experiment.file import Experiment, to_yaml

_DELAYS = {"operator": 0.2, "gantry": 0.2, "pushes": 0.4, "faults": 0.4}
"""Largest random delay after the written time, by kind of event. In s."""


@enum.unique
class Stream(enum.IntEnum):
    """Random streams of a seed, each for one kind of draw; the robot itself is not among them."""

    EVENTS = 1
    TUNED_MODEL = 2
    RADIO = 3
    STANDING_COMMANDS = 4
    LEANS = 5

    def rng(self, seed: int, *more: int) -> np.random.Generator:
        """The generator of this stream of a seed; more numbers choose a stream within it."""
        return np.random.default_rng([seed, self.value, *more])


def resolve(experiment: Experiment) -> Experiment:
    """Draw the times of events from the experiment's seed; the robot was drawn on reading the file.

    An event at 0 s is the state at the start and stays at 0 s. Entries of one list keep their
    order. Seed 0 gives the nominal robot at the written times.
    """
    if experiment.drawn:
        return experiment
    changes: dict[str, Any] = {}
    if experiment.seed:
        rng = Stream.EVENTS.rng(experiment.seed)
        for name, max_delay in _DELAYS.items():
            changes[name] = _later(getattr(experiment, name), max_delay, rng)
    rider = experiment.rider
    if rider is not None and not rider.seed:
        changes["rider"] = dataclasses.replace(rider, seed=experiment.seed)
    return dataclasses.replace(experiment, drawn=True, **changes)


def write_resolved(experiment: Experiment, path: Path) -> None:
    """Write the experiment's file that all nodes get.

    Raises:
        ExperimentError: if it cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(to_yaml(experiment), encoding="utf-8")
    except OSError as error:
        raise ExperimentError(f"cannot write {path}: {error.strerror}") from None


def delayed(times: Sequence[float], max_delay: float, rng: np.random.Generator) -> list[float]:
    """Delayed times in the same order; a time of 0 stays 0. In s.

    Args:
        times: Written times, ascending. In s.
        max_delay: Largest delay, which is uniformly distributed. In s.
        rng: Random generator.
    """
    result: list[float] = []
    for time, delay in zip(times, rng.uniform(0.0, max_delay, len(times)).tolist(), strict=True):
        later = time if time == 0.0 else time + delay
        result.append(max(later, result[-1]) if result else later)
    return result


def _later(events: tuple[Any, ...], max_delay: float, rng: np.random.Generator) -> tuple[Any, ...]:
    times = delayed([event.t for event in events], max_delay, rng)
    return tuple(
        dataclasses.replace(event, t=time) for event, time in zip(events, times, strict=True)
    )
