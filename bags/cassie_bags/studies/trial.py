"""What a run of a sweep or of tuning is: `cassie_bags.studies.run_trial` runs it.

A trial draws its robot from a seed but keeps the written times. So events meet the phase of the
step that they were written for.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

Measures = dict[str, float]
"""What was measured of a trial, by name."""


@dataclass(frozen=True)
class Trial:
    """One run.

    Attributes:
        content: Experiment, as its file would say it; without seed.
        seed: What to draw the robot from; 0 is the nominal one.
        window: Part of the run to measure. In s.
        ahead: Distance along the first heading at which the run ends early, or None. In m.
        changes: `key=value` words that replace what the content says.
        beside: Words that replace more of it in a second run, or None for no second run.
        kept: Last part of the run that is held in memory, at least; None for all of it. What lies
            before it is not measured. In s.
    """

    content: Mapping[str, Any]
    seed: int
    window: tuple[float, float]
    ahead: float | None = None
    changes: tuple[str, ...] = field(default=())
    beside: tuple[str, ...] | None = None
    kept: float | None = None


def left_over(measures: Measures, name: str = "tracking") -> float:
    """A figure of a trial by that of the run beside it; NaN if one of them fell."""
    if measures["fell"] or measures["beside_fell"]:
        return math.nan
    return measures[name] / measures[f"beside_{name}"]
