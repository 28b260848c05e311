"""Definition of one run of a sweep or of tuning: `cassie_bags.studies.run_trial` runs it.

A trial draws its robot from a seed but keeps the written times of events. So each event happens at
the phase of the step for which it was written.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

SEEDS = 10
"""Number of drawn robots of a study, by default."""

Measures = dict[str, float]
"""Measures of a trial by name."""


@dataclass(frozen=True)
class Trial:
    """One run.

    Attributes:
        content: Experiment, with the keys of its file; without seed.
        seed: Seed of the robot; 0 is the nominal robot.
        window: Part of the run to measure. In s.
        ahead: Distance along the first heading at which the run ends early, or None. In m.
        changes: `key=value` words that replace values of the content.
        reference: Further such words for a reference run, or None for no reference run.
        history: Least length of the last part of the run that is held in memory; None for all of
            it. Earlier parts are not measured. In s.
    """

    content: Mapping[str, Any]
    seed: int
    window: tuple[float, float]
    ahead: float | None = None
    changes: tuple[str, ...] = field(default=())
    reference: tuple[str, ...] | None = None
    history: float | None = None


def walking_operator(speed: float, begin: float = 2.2) -> list[dict[str, Any]]:
    """Operator who asks for walking at a time (s), and from 4 s on for a speed (m/s)."""
    return [
        {"t": 0.0, "power": True, "mode": "stand", "height": 0.98},
        {"t": begin, "mode": "walk"},
        {"t": 4.0, "vx": speed},
    ]


def ratio_to_reference(measures: Measures) -> float:
    """Ratio of a trial's tracking error to that of its reference run; NaN if a robot fell."""
    if measures["fell"] or measures["reference_fell"]:
        return math.nan
    return measures["tracking"] / measures["reference_tracking"]
