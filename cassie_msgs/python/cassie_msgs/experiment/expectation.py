"""Section `expect`: bounds on the whole run and on phases of it.

    expect:
      fell: false                                  # the default
      metrics:
        real_time_factor: {min: 1.0}
      phases:
        - {name: half speed, t0: 22, t1: 30, vx: {target: 0.5, tolerance: 0.1}}
        - {name: turn, t0: 40, t1: 50, turn_deg: {target: 90, tolerance: 15}, drift: {max: 1.0}}

A bound is `{min, max}` (either may be left out) or `{target, tolerance}`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from cassie_msgs.structured import (
    path_of,
    refuse_unknown,
    structure_entry,
    structure_fields,
    unstructure,
)
from cassie_msgs.tunables import ParameterError, tunable

TRACKED = ("vx", "vy", "yaw_rate", "height")
"""Quantities that an operator commands and a run is evaluated by. In m/s, m/s, rad/s, m."""

PHASE_METRICS = (
    *TRACKED,
    *(f"{name}_rms" for name in TRACKED),
    "roll_deg",
    "pitch_deg",
    "drift",
    "distance",
    "turn_deg",
    "speed_peak",
    "vx_min",
    "vx_max",
    "sole_pitch_deg",
)
"""Metrics of a phase: mean of each tracked quantity, RMS of its error, mean roll and pitch,
greatest horizontal distance from the start of the phase, distance and turn from its start to
its end, greatest mean speed over a second, least and greatest speed forward, and the pitch of the
soles."""

RUN_METRICS = (
    *(f"{name}_mean" for name in TRACKED),
    *(f"{name}_mean_error" for name in TRACKED),
    *(f"{name}_rms_error" for name in TRACKED),
    "fall_time",
    "duration",
    "drift",
    "distance",
    "tilt_deg",
    "height_min",
    "height_max",
    "peak_torque_ratio",
    "steps",
    "gate_miss",
    "real_time_factor",
    "missed_share",
)
"""Metrics of a run: means and errors of the tracked quantities while the robot carries its own
weight, time of the fall (NaN if none), greatest and final horizontal distance from where it began
to carry its own weight, greatest tilt, least and greatest height, greatest ratio of a drive's
torque to its limit, steps walked, greatest distance of a Segway from the middle of a gate (NaN
without gates), ratio of robot time to wall time, ratio of control ticks without a new command
where the wall clock sets the pace (NaN where robot time waits)."""


@dataclass(frozen=True, kw_only=True)
class Bound:
    """A closed interval, in the unit of what it bounds."""

    FORM: ClassVar[str] = "{min, max} or {target, tolerance}"

    min: float | None = tunable(None, description="Least value")
    max: float | None = tunable(None, description="Greatest value")
    target: float | None = tunable(None, description="Middle, instead of min and max")
    tolerance: float | None = tunable(None, description="Half the width of the interval")

    def __post_init__(self) -> None:
        """Refuse an interval that is empty or not given in exactly one of the two forms."""
        ends = (self.min, self.max)
        if (self.target is None) != (self.tolerance is None) or (
            self.target is not None and ends != (None, None)
        ):
            raise ParameterError("needs both target and tolerance, and nothing else")
        if self.target is None and ends == (None, None):
            raise ParameterError(f"expected {self.FORM}")
        if self.low > self.high:
            raise ParameterError(f"nothing lies in {self}")

    @property
    def low(self) -> float:
        """Least value in the interval."""
        if self.target is not None and self.tolerance is not None:
            return self.target - self.tolerance
        return -math.inf if self.min is None else self.min

    @property
    def high(self) -> float:
        """Greatest value in the interval."""
        if self.target is not None and self.tolerance is not None:
            return self.target + self.tolerance
        return math.inf if self.max is None else self.max

    def holds(self, value: float) -> bool:
        """Whether a value lies in the interval; NaN never does."""
        return self.low <= value <= self.high

    def __str__(self) -> str:
        """The interval as text for people."""
        if self.low == -math.inf:
            return f"<= {self.high:g}"
        return f">= {self.low:g}" if self.high == math.inf else f"{self.low:g} .. {self.high:g}"


@dataclass(frozen=True)
class Phase:
    """A part of a run: name, start and end in robot time (s), and bounds by metric."""

    name: str = tunable("")
    t0: float = tunable(0.0, "s", 0.0, None, "Start")
    t1: float = tunable(0.0, "s", 0.0, None, "End")
    bounds: Mapping[str, Bound] = field(default_factory=dict, metadata={"known": PHASE_METRICS})

    @classmethod
    def from_content(cls, mapping: Mapping[str, Any], where: str) -> Phase:
        """A phase, from `{name, t0, t1}` and a bound under the name of each metric.

        Raises:
            ParameterError: naming the key, its value and the permitted values.
        """
        refuse_unknown(mapping, ("name", "t0", "t1", *PHASE_METRICS), where)
        for key in ("t0", "t1"):
            if mapping.get(key) is None:
                raise ParameterError(f"{path_of(where, key)} must be given: a time in s")
        own = {key: mapping[key] for key in ("name", "t0", "t1") if key in mapping}
        phase = structure_fields(cls, own, where)
        if not phase.t0 < phase.t1:
            raise ParameterError(
                f"{where}: t0 = {phase.t0:g} s, t1 = {phase.t1:g} s, expected 0 <= t0 < t1"
            )
        bounds = {
            key: structure_entry(Bound, mapping[key], path_of(where, key))
            for key in mapping
            if key in PHASE_METRICS
        }
        name = phase.name or f"{phase.t0:g} to {phase.t1:g} s"
        return cls(name, phase.t0, phase.t1, bounds)

    def to_content(self) -> dict[str, Any]:
        """The mapping from which `from_content` makes the same phase."""
        bounds = {name: unstructure(bound) for name, bound in self.bounds.items()}
        return {"name": self.name, "t0": self.t0, "t1": self.t1, **bounds}


@dataclass(frozen=True, kw_only=True)
class Expectation:
    """Bounds that a run must keep."""

    fell: bool | None = tunable(
        False, description="Whether the robot must fall; null: either is accepted"
    )
    lockstep_broken: bool = tunable(False, description="Whether lock-step may break")
    metrics: Mapping[str, Bound] = field(default_factory=dict, metadata={"known": RUN_METRICS})
    phases: tuple[Phase, ...] = ()
