"""What tuned parameters must do, read from a file, and what a run of it costs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cassie_bags.errors import ExperimentError
from cassie_bags.run.seed import Stream
from cassie_bags.run.yaml_file import read_mapping
from cassie_bags.studies.sweep.course import Budget, push, reached_at, step_time, walk
from cassie_bags.studies.trial import Figures, Trial
from cassie_msgs.tunables import ParameterError, from_mapping, tunable, unknown_name

DEFAULT = Path(__file__).with_name("objective.yaml")
"""The objective that comes with the package."""

SETTLING = 3.0
"""Time between reaching a speed and measuring. In s."""

_KEYS = ("courses", "model", "cost")
_PUSH_KEYS = ("impulse", "angle_deg")
_DELAY_KEYS = ("torque", "set_point")


@dataclass(frozen=True, kw_only=True)
class Cost:
    """Points for what goes wrong."""

    fall: float = tunable(20.0, "", 0.0, 1e6, "Of a fall; once more as much if it comes at once")
    vx: float = tunable(0.05, "m/s", 1e-4, 10.0, "Error of the mean that is one point")
    vy: float = tunable(0.05, "m/s", 1e-4, 10.0, "The same sideways")
    yaw_rate: float = tunable(0.1, "rad/s", 1e-4, 10.0, "The same of the turn rate")
    tracking: float = tunable(0.05, "", 1e-4, 10.0, "RMS error of the outputs that is one point")


@dataclass(frozen=True, kw_only=True)
class Course:
    """One thing that every robot does."""

    name: str = tunable("course", description="For people")
    vx: float = tunable(0.0, "m/s", -1.0, 2.0, "Speed forward")
    vy: float = tunable(0.0, "m/s", -0.4, 0.4, "Speed to the left")
    yaw_rate: float = tunable(0.0, "rad/s", -1.2, 1.2, "Turn to the left")
    seconds: float = tunable(6.0, "s", 0.5, 600.0, "Measured time")
    scene: str = tunable("flat", description="Ground")


@dataclass(frozen=True)
class Circumstances:
    """What else there is on a course: parameters of the ground, a push, delays of the drives."""

    ground: Mapping[str, Any]
    push: Mapping[str, Any]
    delays: Mapping[str, Any]


@dataclass(frozen=True)
class Objective:
    """Courses, errors of the model, and costs."""

    courses: tuple[tuple[Course, Circumstances], ...]
    model: Mapping[str, tuple[float, float]]
    cost: Cost
    content: Mapping[str, Any] = field(default_factory=dict)

    def trials(
        self, values: Mapping[str, float], seeds: Sequence[int], changes: Sequence[str]
    ) -> list[Trial]:
        """Every course by every robot, with controller parameters by dotted name."""
        words = (*changes, *(f"controller.{name}={value!r}" for name, value in values.items()))
        return [
            self._trial(index, seed, words) for index in range(len(self.courses)) for seed in seeds
        ]

    def _trial(self, index: int, seed: int, words: tuple[str, ...]) -> Trial:
        course, there = self.courses[index]
        fastest = max(abs(course.vx), abs(course.vy), 0.5 * abs(course.yaw_rate))
        begin = reached_at(fastest) + (SETTLING if fastest else 0.0)
        rng = Stream.TUNED_MODEL.rng(seed, index)
        model = {name: float(rng.uniform(*bounds)) for name, bounds in self.model.items()}
        sections: dict[str, Any] = {
            "scene": course.scene,
            "scene_parameters": dict(there.ground),
            "model": model,
            "delays": dict(there.delays),
        }
        if there.push:
            angle = float(there.push.get("angle_deg", rng.uniform(-180.0, 180.0)))
            at = begin + 1.0 + float(rng.uniform(0.0, 2.0 * step_time(course.vx)))
            sections["pushes"] = [push(at, float(there.push["impulse"]), angle)]
        commanded = {"vx": course.vx, "vy": course.vy, "yaw_rate": course.yaw_rate}
        window = (begin, begin + course.seconds)
        return walk(Budget(changes=words), seed, window, **commanded, **sections)

    def cost_of(self, trial: Trial, figures: Figures) -> float:
        """Points of one run; a fall is dearer the earlier it comes."""
        if figures["fell"]:
            early = 1.0 - min(1.0, figures["end"] / float(trial.content["duration"]))
            return self.cost.fall * (1.0 + early)
        commanded = trial.content["operator"][-1]
        points = figures["tracking"] / self.cost.tracking
        for name in ("vx", "vy", "yaw_rate"):
            points += abs(figures[name] - commanded[name]) / getattr(self.cost, name)
        return float(points) if math.isfinite(points) else self.cost.fall


def load_objective(path: Path = DEFAULT) -> Objective:
    """An objective from its file; see the one that comes with the package.

    Raises:
        ExperimentError: naming the key, its value and what is permitted.
    """
    content = read_mapping(path)
    for key in content:
        if key not in _KEYS:
            raise ExperimentError(f"{path}: {unknown_name(str(key), _KEYS, 'key')}")
    entries = content.get("courses")
    if not isinstance(entries, list) or not entries:
        raise ExperimentError(f"{path}: courses must be a list of at least one")
    try:
        courses = tuple(_course(entry, f"courses.{i}") for i, entry in enumerate(entries))
        cost = from_mapping(Cost, content.get("cost") or {})
    except ParameterError as error:
        raise ExperimentError(f"{path}: {error}") from None
    model = {
        str(name): _bounds(bounds, f"{path}: model.{name}")
        for name, bounds in (content.get("model") or {}).items()
    }
    return Objective(courses, model, cost, content)


def _course(entry: object, where: str) -> tuple[Course, Circumstances]:
    if not isinstance(entry, Mapping):
        raise ParameterError(f"{where} = {entry!r} is not a mapping")
    rest = dict(entry)
    there = Circumstances(
        *(rest.pop(key, None) or {} for key in ("scene_parameters", "push", "delays"))
    )
    for name, given, known in (
        ("push", there.push, _PUSH_KEYS),
        ("delays", there.delays, _DELAY_KEYS),
    ):
        for key in given:
            if key not in known:
                raise ParameterError(f"{where}.{name}: {unknown_name(str(key), known, 'key')}")
    if there.push and "impulse" not in there.push:
        raise ParameterError(f"{where}.push.impulse must be given, in Ns")
    try:
        return from_mapping(Course, rest), there
    except ParameterError as error:
        raise ParameterError(f"{where}: {error}") from None


def _bounds(value: object, where: str) -> tuple[float, float]:
    if (
        not isinstance(value, list)
        or len(value) != 2
        or not all(isinstance(bound, (int, float)) for bound in value)
        or not 0.0 < value[0] <= value[1]
    ):
        raise ExperimentError(f"{where} = {value!r} is not [low, high]")
    return float(value[0]), float(value[1])
