"""What an experiment file expects of a run: bounds on the whole run and on phases of it.

    expect:
      fell: false                                  # the default
      metrics:
        real_time_factor: {min: 1.0}
      phases:
        - {name: half speed, t0: 22, t1: 30, vx: {target: 0.5, tolerance: 0.1}}
        - {name: turn, t0: 40, t1: 50, turn_deg: {target: 90, tolerance: 15}, drift: {max: 1.0}}

A bound is `{min, max}` (either may be left out) or `{target, tolerance}`. What can be bounded
stands in `metrics.RUN_METRICS` and `metrics.PHASE_METRICS`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from cassie_bags.errors import ExperimentError
from cassie_bags.signals.metrics import PHASE_METRICS, RUN_METRICS, Metrics, Phase
from cassie_msgs.tunables import unknown_name

_KEYS = ("fell", "lockstep_broken", "metrics", "phases")
_BOUND_KEYS = ("min", "max", "target", "tolerance")


@dataclass(frozen=True)
class Bound:
    """A closed interval, in the unit of what it bounds."""

    low: float = -math.inf
    high: float = math.inf

    def holds(self, value: float) -> bool:
        """Whether a value lies in it; NaN never does."""
        return self.low <= value <= self.high

    def __str__(self) -> str:
        if self.low == -math.inf:
            return f"<= {self.high:g}"
        return f">= {self.low:g}" if self.high == math.inf else f"{self.low:g} .. {self.high:g}"


@dataclass(frozen=True)
class Check:
    """One thing that is expected of a run.

    Attributes:
        phase: Of which phase; empty for the whole run.
        name: What is measured.
        value, target: What came, and what was expected.
        problem: What is wrong, in a line; empty if nothing is.
    """

    phase: str
    name: str
    value: str
    target: str
    problem: str


@dataclass(frozen=True)
class Expectation:
    """Bounds that a run must keep.

    Attributes:
        fell: Whether the robot must (True), must not (False) or may (None) fall.
        lockstep_broken: Whether lock-step may break, for experiments that provoke it.
        metrics: Bounds on the whole run by metric.
        phases: Phases of the table, in order.
        phase_bounds: Bounds on each phase by metric, in the same order.
    """

    fell: bool | None = False
    lockstep_broken: bool = False
    metrics: Mapping[str, Bound] = field(default_factory=dict)
    phases: tuple[Phase, ...] = ()
    phase_bounds: tuple[Mapping[str, Bound], ...] = ()

    def checks(self, metrics: Metrics) -> list[Check]:
        """Everything that is expected, and what came of it.

        Args:
            metrics: Of the run, over `phases`.
        """
        found = []
        if self.fell is not None:
            found.append(_fall_check(self.fell, metrics))
        for name, bound in self.metrics.items():
            found.append(_check("", name, metrics.run[name], bound))
        for bounds, values in zip(self.phase_bounds, metrics.phases, strict=bool(self.phases)):
            phase = values.phase
            if bounds and not values.reached:
                problem = f"{phase.name}: the run ended before {phase.t1:g} s"
                found.append(Check(phase.name, "reached", "no", "yes", problem))
                continue
            found += [_check(phase.name, n, values.values[n], bound) for n, bound in bounds.items()]
        return found

    def failures(self, metrics: Metrics) -> list[str]:
        """What a run did not keep, one line each."""
        return [check.problem for check in self.checks(metrics) if check.problem]


def _fall_check(wanted: bool, metrics: Metrics) -> Check:
    when = "" if metrics.fall_time is None else f" at {metrics.fall_time:.2f} s"
    value = f"yes{when}" if metrics.fell else "no"
    problem = f"the robot fell{when}" if metrics.fell else "the robot did not fall"
    kept = metrics.fell == wanted
    return Check("", "falls", value, "yes" if wanted else "no", "" if kept else problem)


def _check(phase: str, name: str, value: float, bound: Bound) -> Check:
    problem = f"{name} = {value:.4g}, expected {bound}"
    if phase:
        problem = f"{phase}: {problem}"
    return Check(phase, name, f"{value:.4g}", str(bound), "" if bound.holds(value) else problem)


def read_expectation(section: object) -> Expectation:
    """The `expect` section of an experiment file.

    Raises:
        ExperimentError: if a key is unknown (the message names the nearest known one), or a
            value is not of its type.
    """
    mapping = _mapping(section, "expect")
    _refuse_unknown(mapping, _KEYS, "expect")
    fell = mapping.get("fell", False)
    if fell is not None and not isinstance(fell, bool):
        raise ExperimentError(f"expect.fell = {fell!r} is not true, false or null")
    broken = mapping.get("lockstep_broken", False)
    if not isinstance(broken, bool):
        raise ExperimentError(f"expect.lockstep_broken = {broken!r} is not true or false")
    metrics = _bounds(_mapping(mapping.get("metrics"), "expect.metrics"), "expect.metrics")
    entries = mapping.get("phases") or []
    if not isinstance(entries, list):
        raise ExperimentError(f"expect.phases = {entries!r} is not a list")
    phases, bounds = [], []
    for index, entry in enumerate(entries):
        phase, bound = _phase(_mapping(entry, f"expect.phases.{index}"), f"expect.phases.{index}")
        phases.append(phase)
        bounds.append(bound)
    return Expectation(fell, broken, metrics, tuple(phases), tuple(bounds))


def _phase(entry: Mapping[str, Any], where: str) -> tuple[Phase, Mapping[str, Bound]]:
    _refuse_unknown(entry, ("name", "t0", "t1", *PHASE_METRICS), where)
    t0, t1 = (_number(entry.get(key), f"{where}.{key}") for key in ("t0", "t1"))
    if not 0.0 <= t0 < t1:
        raise ExperimentError(f"{where}: t0 = {t0:g} s, t1 = {t1:g} s, expected 0 <= t0 < t1")
    name = entry.get("name", f"{t0:g} to {t1:g} s")
    if not isinstance(name, str):
        raise ExperimentError(f"{where}.name = {name!r} is not a word")
    bounds = {key: value for key, value in entry.items() if key in PHASE_METRICS}
    return Phase(name, t0, t1), _read_bounds(bounds, where)


def _bounds(section: Mapping[str, Any], where: str) -> Mapping[str, Bound]:
    _refuse_unknown(section, RUN_METRICS, where)
    return _read_bounds(section, where)


def _read_bounds(section: Mapping[str, Any], where: str) -> dict[str, Bound]:
    return {key: _bound(value, f"{where}.{key}") for key, value in section.items()}


def _bound(section: object, where: str) -> Bound:
    if not isinstance(section, Mapping) or not section:
        raise ExperimentError(f"{where} = {section!r} is not {{min, max}} or {{target, tolerance}}")
    _refuse_unknown(section, _BOUND_KEYS, where)
    values = {key: _number(value, f"{where}.{key}") for key, value in section.items()}
    if values.keys() & {"target", "tolerance"}:
        if values.keys() != {"target", "tolerance"}:
            raise ExperimentError(f"{where} needs both target and tolerance, and nothing else")
        bound = Bound(
            values["target"] - values["tolerance"], values["target"] + values["tolerance"]
        )
    else:
        bound = Bound(values.get("min", -math.inf), values.get("max", math.inf))
    if bound.low > bound.high:
        raise ExperimentError(f"{where}: nothing lies in {bound}")
    return bound


def _mapping(section: object, where: str) -> Mapping[str, Any]:
    if section is None:
        return {}
    if not isinstance(section, Mapping):
        raise ExperimentError(f"{where} = {section!r} is not a mapping")
    return section


def _number(value: object, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ExperimentError(f"{where} = {value!r} is not a number")
    return float(value)


def _refuse_unknown(section: Mapping[str, Any], known: tuple[str, ...], where: str) -> None:
    for key in section:
        if key not in known:
            raise ExperimentError(f"{where}: {unknown_name(str(key), known, 'key')}")
