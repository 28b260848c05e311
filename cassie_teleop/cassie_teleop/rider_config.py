"""The `rider` section of a script: what a rider is like, and where he wants to go."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from cassie_msgs.tunables import ParameterError, from_mapping, tunable, unknown_name


@dataclass(frozen=True, kw_only=True)
class RiderSettings:
    """How he sees and how he leans."""

    rate: float = tunable(10.0, "Hz", 1.0, 50.0, "How often he looks")
    delay: float = tunable(0.2, "s", 0.0, 2.0, "How old what he sees is")
    noise: float = tunable(0.1, "m/s", 0.0, 1.0, "Largest error of the speed he sees, uniform")
    seed: int = tunable(0, "", 0, 2**63 - 1, "Of that error; 0: the experiment's own")
    acceleration: float = tunable(0.58, "m/s^2", 0.05, 2.0, "At which he speeds up")
    braking: float = tunable(0.8, "m/s^2", 0.05, 2.0, "At which he slows down")
    lean: float = tunable(0.075, "m/(m/s^2)", 0.0, 0.5, "CoM x by the acceleration he wants")
    speed_gain: float = tunable(0.035, "m/(m/s)", 0.0, 0.2, "CoM x by error of speed")
    speed_sum: float = tunable(0.015, "m/m", 0.0, 0.1, "CoM x by the sum of that error")
    speed_wait: float = tunable(0.6, "s", 0.0, 3.0, "In which he expects a lean to show")
    turn_lean: float = tunable(
        0.064, "m/(rad/s)", 0.0, 0.5, "CoM y by the turn rate he wants, times 1 + speed / 2"
    )
    turn_time: float = tunable(0.6, "s", 0.0, 5.0, "Turn rate by its own change on his way")
    turn_wait: float = tunable(0.22, "s", 0.0, 2.0, "How far ahead on his way he looks for it")
    turn_gain: float = tunable(1.03, "", 0.0, 5.0, "Turn rate by its error")
    turn_sum: float = tunable(0.9, "1/s", 0.0, 5.0, "Turn rate by the sum of its error")
    heading_gain: float = tunable(0.4, "1/s", 0.0, 5.0, "Turn rate by error of heading")
    slope_gain: float = tunable(1.1, "1/s", 0.0, 5.0, "The same on his way through gates")
    side_gain: float = tunable(0.5, "rad/s/m", 0.0, 5.0, "Turn rate by distance from his way")
    side_sum: float = tunable(
        0.08, "rad/s/(m s)", 0.0, 2.0, "Turn rate by the sum of that distance"
    )


@dataclass(frozen=True, kw_only=True)
class Gates:
    """A slalom straight ahead: gates to the left and to the right in turn."""

    first: float = tunable(9.0, "m", 0.0, 1000.0, "Of the first one from where he is then")
    spacing: float = tunable(3.0, "m", 1.0, 50.0, "From gate to gate")
    offset: float = tunable(0.2, "m", 0.0, 5.0, "Of the first one's middle to the left")
    count: int = tunable(8, "", 1, 1000, "How many")


@dataclass(frozen=True, kw_only=True)
class Target:
    """What he wants from a time on. What is not said stays; a course ends the one before."""

    t: float = tunable(dataclasses.MISSING, "s", 0.0, None, "From when on")
    speed: float | None = None
    heading: float | None = None
    turn: float | None = None
    gates: Gates | None = None


_RANGES = {"speed": (-1.0, 4.5, "m/s"), "heading": (-1e4, 1e4, "rad"), "turn": (-2.0, 2.0, "rad/s")}


@dataclass(frozen=True)
class RiderScript:
    """A whole `rider` section."""

    settings: RiderSettings = field(default_factory=RiderSettings)
    targets: tuple[Target, ...] = ()


def read_rider(section: Mapping[str, Any]) -> RiderScript:
    """A `rider` section: settings, and `targets` in order of time.

    Raises:
        ParameterError: naming the key, its value and what is permitted.
    """
    if not isinstance(section, Mapping):
        raise ParameterError(f"rider = {section!r} is not a mapping")
    entries = section.get("targets")
    if not isinstance(entries, (list, tuple)) or not entries:
        raise ParameterError("rider.targets must be given: a list of {t, speed, ...}")
    plain = {key: section[key] for key in section if key != "targets"}
    try:
        settings = from_mapping(RiderSettings, plain)
    except ParameterError as error:
        raise ParameterError(f"rider: {error}") from None
    targets = [_target(entry, f"rider.targets.{i}") for i, entry in enumerate(entries)]
    for i, (one, following) in enumerate(itertools.pairwise(targets)):
        if following.t < one.t:
            raise ParameterError(
                f"rider.targets.{i + 1}: t = {following.t:g} s is before the one ahead of it"
            )
    return RiderScript(settings, tuple(targets))


def _target(entry: object, where: str) -> Target:
    if not isinstance(entry, Mapping):
        raise ParameterError(f"{where} = {entry!r} is not a mapping")
    known = [spec.name for spec in dataclasses.fields(Target)]
    for key in entry:
        if key not in known:
            raise ParameterError(f"{where}: {unknown_name(str(key), known, 'key')}")
    if sum(key in entry for key in ("heading", "turn", "gates")) > 1:
        raise ParameterError(f"{where}: only one of heading, turn and gates")
    given: dict[str, Any] = {"t": entry.get("t")}
    _check(given["t"], "t", 0.0, float("inf"), "s", where)
    for name, (low, high, unit) in _RANGES.items():
        if entry.get(name) is not None:
            _check(entry[name], name, low, high, unit, where)
            given[name] = float(entry[name])
    if entry.get("gates") is not None:
        try:
            given["gates"] = from_mapping(Gates, entry["gates"])
        except (ParameterError, AttributeError, TypeError) as error:
            raise ParameterError(f"{where}.gates: {error}") from None
    return Target(**given)


def _check(value: object, name: str, low: float, high: float, unit: str, where: str) -> None:
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not number or not low <= float(value) <= high:  # type: ignore[arg-type]
        raise ParameterError(f"{where}: {name} = {value!r} is outside {low:g} .. {high:g} {unit}")
