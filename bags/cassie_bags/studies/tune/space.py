"""Selection of the searched parameters, and their mapping to numbers from -1 to 1."""

from __future__ import annotations

import fnmatch
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from cassie_bags.bag.rows import FloatArray
from cassie_bags.errors import ExperimentError
from cassie_control.config import ControllerConfig
from cassie_msgs.tunables import entries, unknown_name

JOINT_GAINS = ("walk.joints.*", "walk.k[pd]_torso_*")
"""Gains of the drives and of the torso through the stance hip."""

LEG_ANGLE_GAINS = {
    "pendulum": ("walk.map_*", "walk.observer_gain"),
    "paper": ("walk.paper_k[pd]_*",),
}
"""Gains of the foot placement by law."""


@dataclass(frozen=True)
class Parameter:
    """One searched parameter: dotted name, initial value, and range of the search.

    `start`, `low` and `high` are in the parameter's unit. The scale is logarithmic if `low` > 0.
    """

    name: str
    unit: str
    start: float
    low: float
    high: float

    def value(self, coordinate: float) -> float:
        """The value at a coordinate: -1 is `low`, 0 is `start`, 1 is `high`."""
        end = self.high if coordinate >= 0.0 else self.low
        share = min(1.0, abs(coordinate))
        if self.low > 0.0:
            return float(self.start * (end / self.start) ** share)
        return self.start + (end - self.start) * share


def parameters(
    patterns: Sequence[str], given: Mapping[str, object], factor: float
) -> list[Parameter]:
    """The parameters that match patterns.

    Args:
        patterns: File patterns of dotted names; if empty, `JOINT_GAINS` and those of the law.
        given: Initial values in place of the defaults, by dotted name.
        factor: Largest factor on a value, up or down, within the parameter's range.

    Raises:
        ExperimentError: if a pattern matches no numeric parameter; the message names the nearest.
    """
    known = {
        entry.name: entry
        for entry in entries(ControllerConfig())
        if entry.kind in (float, int) and not isinstance(entry.value, bool)
    }
    if not patterns:
        law = str(given.get("walk.law", ControllerConfig().walk.law))
        patterns = (*JOINT_GAINS, *LEG_ANGLE_GAINS.get(law, ()))
    names: dict[str, None] = {}
    for pattern in patterns:
        matching = fnmatch.filter(known, pattern)
        if not matching:
            raise ExperimentError(unknown_name(pattern, known, "numeric parameter"))
        names |= dict.fromkeys(matching)
    space = []
    for name in names:
        entry = known[name]
        start = float(given.get(name, entry.value))  # type: ignore[arg-type]
        low, high = _reach(start, entry.spec.low, entry.spec.high, factor)
        space.append(Parameter(name, entry.spec.unit, start, low, high))
    return space


def values(space: Sequence[Parameter], coordinates: FloatArray) -> dict[str, float]:
    """Values by dotted name, rounded to six digits: the same values are run and written."""
    return {
        parameter.name: float(f"{parameter.value(float(coordinate)):.6g}")
        for parameter, coordinate in zip(space, coordinates, strict=True)
    }


def _reach(
    start: float, low: float | None, high: float | None, factor: float
) -> tuple[float, float]:
    """Range of a search from a start: by a factor, or by the parameter's range if start <= 0."""
    low = -math.inf if low is None else low
    high = math.inf if high is None else high
    if start > 0.0:
        return max(low, start / factor), min(high, start * factor)
    if math.isinf(low) or math.isinf(high):
        return start - 1.0, start + 1.0
    return low, start + (high - start) / factor
