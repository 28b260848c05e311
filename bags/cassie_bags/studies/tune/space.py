"""Which parameters are searched, and how they become numbers from -1 to 1."""

from __future__ import annotations

import fnmatch
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cassie_bags.errors import ExperimentError
from cassie_control.config import ControllerConfig
from cassie_msgs.tunables import entries, unknown_name

FloatArray = npt.NDArray[np.float64]

JOINT_GAINS = ("walk.joints.*", "walk.k[pd]_torso_*")
"""Gains of the drives and of the torso through the stance hip."""

LEG_ANGLE_GAINS = {
    "pendulum": ("walk.map_*", "walk.observer_gain"),
    "paper": ("walk.paper_k[pd]_*",),
}
"""Gains of the foot placement by law."""


@dataclass(frozen=True)
class Parameter:
    """One parameter: dotted name, where the search begins, and how far it goes.

    `start`, `low` and `high` in the parameter's unit; positive ones are searched by ratio.
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
        patterns: Of dotted names, as file patterns; none: `JOINT_GAINS` and those of the law.
        given: Values to begin from in place of the defaults, by dotted name.
        factor: By which a value may go up or down, within its range.

    Raises:
        ExperimentError: if a pattern matches no number; the message names the nearest one.
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
            raise ExperimentError(unknown_name(pattern, known, "parameter"))
        names |= dict.fromkeys(matching)
    found = []
    for name in names:
        entry = known[name]
        start = float(given.get(name, entry.value))  # type: ignore[arg-type]
        low, high = _reach(start, entry.spec.low, entry.spec.high, factor)
        found.append(Parameter(name, entry.spec.unit, start, low, high))
    return found


def values(space: Sequence[Parameter], coordinates: FloatArray) -> dict[str, float]:
    """Values by dotted name, to six digits: what is written is what was tried."""
    return {
        parameter.name: float(f"{parameter.value(float(coordinate)):.6g}")
        for parameter, coordinate in zip(space, coordinates, strict=True)
    }


def _reach(
    start: float, least: float | None, most: float | None, factor: float
) -> tuple[float, float]:
    """How far a search goes from a start: by a factor, or over the range where that is nothing."""
    least = -math.inf if least is None else least
    most = math.inf if most is None else most
    if start > 0.0:
        return max(least, start / factor), min(most, start * factor)
    if math.isinf(least) or math.isinf(most):
        return start - 1.0, start + 1.0
    return least, start + (most - start) / factor
