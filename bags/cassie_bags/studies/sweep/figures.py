"""Figures that are made of several measures of a trial, and the names of all figures."""

from __future__ import annotations

from collections.abc import Callable

from cassie_bags.studies.trial import Measures, ratio_to_reference
from cassie_msgs.tunables import ParameterError, unknown_name

_STILL = 0.02  # m/s, of a robot at rest; of its pelvis with delayed commands
_GOES_ON = 0.1  # m/s
_EVERYTHING = {"vx": 1.0, "vy": 0.2, "yaw_rate": 0.4}  # m/s, m/s, rad/s


def _stands(measures: Measures, _: float = 0.0) -> bool:
    return measures["standing"] > 0.0 and measures["end_speed"] < _STILL


def _rests(measures: Measures, _: float = 0.0) -> bool:
    return _stands(measures) and not measures["stepped"]


FIGURES: dict[str, Callable[[Measures, float], float]] = {
    "stands": _stands,
    "rests": _rests,
    "rests_quietly": lambda measures, _: _rests(measures) and measures["shaking"] < _STILL,
    "goes_on": lambda measures, _: measures["vx"] > _GOES_ON,
    "vx_error": lambda measures, level: abs(measures["vx"] - level),
    "vy_error": lambda measures, level: abs(measures["vy"] - level),
    "turn_rate": lambda measures, _: abs(measures["yaw_rate"]),
    "everything_error": lambda measures, _: (
        100.0 * max(abs(abs(measures[name]) / value - 1.0) for name, value in _EVERYTHING.items())
    ),
    "rmse_velocity": lambda measures, _: max(measures[f"rmse_{v}"] for v in ("vx", "vy", "vz")),
    "tracking_ratio": lambda measures, _: ratio_to_reference(measures),
    "ride_error": lambda measures, level: max(
        measures["ride_max"] - level, level - measures["ride_min"]
    ),
}
"""Figures from measures and level: whether it stands at rest at the end (1 or 0), also without a
step in the window, also without shaking; whether it goes ahead; errors of speeds from the level;
magnitude of the turn rate; greatest error of a fast command of all speeds, in %; RMSE of the worst
axis of the estimated velocity; tracking error by that of the reference run; greatest error of a
ride's speed from the level. In the unit of the measures."""


def figure_of(name: str, measures: Measures, level: float) -> float:
    """A figure, or a measure, of a trial by its name.

    Raises:
        ParameterError: if there is no such figure; the message names the nearest one.
    """
    if name in FIGURES:
        return FIGURES[name](measures, level)
    if name not in measures:
        raise ParameterError(unknown_name(name, {*measures, *FIGURES}, "figure"))
    return measures[name]
