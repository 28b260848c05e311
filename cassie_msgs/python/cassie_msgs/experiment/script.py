"""Sections `operator` and `rider`: what is asked of the robot, and when."""

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
    """What it is to do from a time on. What is not said stays; a course ends the one before."""

    t: float = tunable(dataclasses.MISSING, "s", 0.0, None, "From when on")
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
    """A whole `rider` section: what the rider is like, and its targets in order of time."""

    targets: tuple[Target, ...] = ()

    def __post_init__(self) -> None:
        """Refuse a rider without targets, and targets out of order."""
        if not self.targets:
            raise ParameterError("targets must be given: a list of {t, speed, ...}")
        require_order([target.t for target in self.targets], "targets")


@dataclass(frozen=True)
class OperatorStep:
    """What an operator changes at a time.

    Attributes:
        t: When. In s.
        changes: Fields of `Request` by name; what is not among them keeps its value.
    """

    t: float = tunable(dataclasses.MISSING, "s", 0.0, None, "The time at which it happens")
    changes: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def from_content(cls, mapping: Mapping[str, Any], where: str) -> OperatorStep:
        """From `{t, mode, vx, ...}`.

        Raises:
            ParameterError: naming the key, its value and what is permitted.
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
        """What `from_content` makes the same step of."""
        lists = {key: list(v) if isinstance(v, tuple) else v for key, v in self.changes.items()}
        return {"t": self.t, **lists}


def require_order(times: Sequence[float], where: str) -> None:
    """Raise a ParameterError unless times (s) ascend."""
    for index, (before, time) in enumerate(itertools.pairwise(times), 1):
        if time < before:
            raise ParameterError(
                f"{where}.{index}.t = {time:g} s is before {where}.{index - 1}.t = {before:g} s"
            )
