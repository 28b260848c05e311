"""Sections `operator` and `rider`: what is commanded, and when."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from cassie_msgs.request import Request
from cassie_msgs.structured import field_value, refuse_unknown, structure_fields
from cassie_msgs.tunables import ParameterError, names, tunable


@dataclass(frozen=True, kw_only=True)
class RiderSettings:
    """Measurement and control law of the rider model."""

    rate: float = tunable(10.0, "Hz", 1.0, 50.0, "Rate at which the rider measures and decides")
    delay: float = tunable(0.2, "s", 0.0, 2.0, "Latency of the rider's measurements")
    noise: float = tunable(
        0.1, "m/s", 0.0, 1.0, "Largest error of the measured speed, uniformly distributed"
    )
    seed: int = tunable(
        0, "", 0, 2**63 - 1, "Seed of the speed's measurement error; 0: the experiment's seed"
    )
    acceleration: float = tunable(
        0.58, "m/s^2", 0.05, 2.0, "Acceleration of the speed's set-point towards a higher speed"
    )
    braking: float = tunable(
        0.8, "m/s^2", 0.05, 2.0, "Deceleration of the speed's set-point towards a lower speed"
    )
    lean: float = tunable(
        0.075, "m/(m/s^2)", 0.0, 0.5, "CoM x by the acceleration of the speed's set-point"
    )
    speed_gain: float = tunable(0.035, "m/(m/s)", 0.0, 0.2, "CoM x by speed error")
    speed_sum: float = tunable(0.015, "m/m", 0.0, 0.1, "CoM x by integrated speed error")
    speed_wait: float = tunable(
        0.6, "s", 0.0, 3.0, "Expected latency from a lean to its effect on speed"
    )
    turn_lean: float = tunable(
        0.064, "m/(rad/s)", 0.0, 0.5, "CoM y by desired turn rate, multiplied by 1 + speed / 2"
    )
    turn_time: float = tunable(
        0.6, "s", 0.0, 5.0, "Turn rate by the rate of change of the path's turn rate"
    )
    turn_wait: float = tunable(
        0.22, "s", 0.0, 2.0, "Time ahead for which the path's turn rate is evaluated"
    )
    turn_gain: float = tunable(1.03, "", 0.0, 5.0, "Turn rate by turn rate error")
    turn_sum: float = tunable(0.9, "1/s", 0.0, 5.0, "Turn rate by integrated turn rate error")
    heading_gain: float = tunable(0.4, "1/s", 0.0, 5.0, "Turn rate by heading error")
    slope_gain: float = tunable(
        1.1, "1/s", 0.0, 5.0, "Turn rate by heading error on the path through gates"
    )
    side_gain: float = tunable(
        0.5, "rad/s/m", 0.0, 5.0, "Turn rate by lateral distance from the path"
    )
    side_sum: float = tunable(
        0.08, "rad/s/(m s)", 0.0, 2.0, "Turn rate by integrated lateral distance from the path"
    )


@dataclass(frozen=True, kw_only=True)
class Gates:
    """A slalom straight ahead: gates to the left and to the right in turn."""

    first: float = tunable(
        9.0, "m", 0.0, 1000.0, "Distance of the first gate from where the slalom is commanded"
    )
    spacing: float = tunable(3.0, "m", 1.0, 50.0, "Distance from gate to gate")
    offset: float = tunable(0.2, "m", 0.0, 5.0, "Offset of the first gate's middle to the left")
    count: int = tunable(8, "", 1, 1000, "Number of gates")


@dataclass(frozen=True, kw_only=True)
class Target:
    """Speed and course from a time on.

    A value that is not given does not change. A new course replaces the one before.
    """

    t: float = tunable(dataclasses.MISSING, "s", 0.0, None, "Time from which the target holds")
    speed: float | None = tunable(None, "m/s", -1.0, 4.5, "Speed forward")
    heading: float | None = tunable(None, "rad", -1e4, 1e4, "Heading to keep")
    turn: float | None = tunable(None, "rad/s", -2.0, 2.0, "Turn to the left")
    gates: Gates | None = None

    def __post_init__(self) -> None:
        """Refuse two courses at once."""
        if sum(way is not None for way in (self.heading, self.turn, self.gates)) > 1:
            raise ParameterError("only one of heading, turn and gates")


@dataclass(frozen=True, kw_only=True)
class RiderScript(RiderSettings):
    """A whole `rider` section: settings of the rider, and targets in order of time."""

    targets: tuple[Target, ...] = ()

    def __post_init__(self) -> None:
        """Refuse a rider without targets, and targets out of order."""
        if not self.targets:
            raise ParameterError("targets must be given: a list of {t, speed, ...}")
        require_order([target.t for target in self.targets], "targets")


@dataclass(frozen=True)
class OperatorStep:
    """Changes of an operator's request at one time.

    Attributes:
        t: Time of the changes. In s.
        changes: Fields of `Request` by name; other fields keep their values.
    """

    t: float = tunable(dataclasses.MISSING, "s", 0.0, None, "Time of the changes")
    changes: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def from_content(cls, mapping: Mapping[str, Any], where: str) -> OperatorStep:
        """A step, from `{t, mode, vx, ...}`.

        Raises:
            ParameterError: naming the key, its value and the permitted values.
        """
        known = names(Request)
        refuse_unknown(mapping, ("t", *known), where)
        changes = {
            name: field_value(Request, name, value, where)
            for name, value in mapping.items()
            if name != "t"
        }
        at = {name: value for name, value in mapping.items() if name == "t"}
        return dataclasses.replace(structure_fields(cls, at, where), changes=changes)

    def to_content(self) -> dict[str, Any]:
        """The mapping from which `from_content` makes the same step."""
        lists = {key: list(v) if isinstance(v, tuple) else v for key, v in self.changes.items()}
        return {"t": self.t, **lists}


def require_order(times: Sequence[float], where: str) -> None:
    """Raise a ParameterError unless times (s) ascend."""
    for index, (before, time) in enumerate(itertools.pairwise(times), 1):
        if time < before:
            raise ParameterError(
                f"{where}.{index}.t = {time:g} s is before {where}.{index - 1}.t = {before:g} s"
            )
