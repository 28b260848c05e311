"""The objective of tuning, read from a file, and the cost of a run."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cassie_bags.errors import ExperimentError
from cassie_bags.run.seed import Stream
from cassie_bags.run.yaml_file import read_mapping
from cassie_bags.studies.sweep.course import push, reached_at, step_time, walk
from cassie_bags.studies.trial import Measures, Trial
from cassie_msgs.experiment.scenario import Delays, ModelScale
from cassie_msgs.structured import refuse_unknown, structure
from cassie_msgs.tunables import ParameterError, as_mapping, check_value, names, tunable

DEFAULT = Path(__file__).with_name("objective.yaml")
"""File of the objective that comes with the package."""

SETTLING = 3.0
"""Time between reaching a speed and measuring. In s."""


@dataclass(frozen=True, kw_only=True)
class Cost:
    """Cost of a run, in points."""

    fall: float = tunable(20.0, "", 0.0, 1e6, "Points of a fall; up to twice as many if early")
    vx: float = tunable(0.05, "m/s", 1e-4, 10.0, "Error of the mean forward speed for one point")
    vy: float = tunable(0.05, "m/s", 1e-4, 10.0, "Error of the mean sideways speed for one point")
    yaw_rate: float = tunable(0.1, "rad/s", 1e-4, 10.0, "Error of the mean turn rate for one point")
    tracking: float = tunable(0.05, "", 1e-4, 10.0, "RMS error of the outputs for one point")


@dataclass(frozen=True, kw_only=True)
class Impulse:
    """A push on the pelvis, in the two steps that follow the first measured second."""

    impulse: float = tunable(dataclasses.MISSING, "Ns", 0.0, 1000.0, "Force times time")
    angle_deg: float | None = tunable(
        None, "deg", -360.0, 360.0, "Direction of the force from ahead to the left"
    )


@dataclass(frozen=True, kw_only=True)
class Manoeuvre:
    """One manoeuvre that every robot does."""

    name: str = tunable("course", description="Name for readers")
    vx: float = tunable(0.0, "m/s", -1.0, 2.0, "Speed forward")
    vy: float = tunable(0.0, "m/s", -0.4, 0.4, "Speed to the left")
    yaw_rate: float = tunable(0.0, "rad/s", -1.2, 1.2, "Turn rate to the left")
    seconds: float = tunable(6.0, "s", 0.5, 600.0, "Measured time")
    scene: str = tunable("flat", description="Scene")
    scene_parameters: Mapping[str, Any] = field(default_factory=dict)
    push: Impulse | None = None
    delays: Delays = field(default_factory=Delays)


@dataclass(frozen=True, kw_only=True)
class Objective:
    """Manoeuvres; errors of the model as [low, high] by name; and costs."""

    courses: tuple[Manoeuvre, ...] = ()
    model: Mapping[str, Any] = field(default_factory=dict)
    cost: Cost = field(default_factory=Cost)

    def __post_init__(self) -> None:
        """Refuse an objective without manoeuvres, or with model errors that are no ranges."""
        if not self.courses:
            raise ParameterError("courses must be a list of at least one")
        refuse_unknown(self.model, names(ModelScale), "model")
        for name, value in self.model.items():
            pair = check_value(f"model.{name}", tuple[float, float], value, None)
            if not 0.0 < pair[0] <= pair[1]:
                raise ParameterError(f"model.{name} = {value!r} is not [low, high]")

    def trials(
        self, values: Mapping[str, float], seeds: Sequence[int], changes: Sequence[str]
    ) -> list[Trial]:
        """Trials of every course by every robot.

        Args:
            values: Parameters of the controller by dotted name.
            seeds: Seeds of the robots.
            changes: Further `key=value` words for each run.
        """
        words = (*changes, *(f"controller.{name}={value!r}" for name, value in values.items()))
        return [
            self._trial(index, seed, words) for index in range(len(self.courses)) for seed in seeds
        ]

    def _trial(self, index: int, seed: int, words: tuple[str, ...]) -> Trial:
        course = self.courses[index]
        fastest = max(abs(course.vx), abs(course.vy), 0.5 * abs(course.yaw_rate))
        begin = reached_at(fastest) + (SETTLING if fastest else 0.0)
        rng = Stream.TUNED_MODEL.rng(seed, index)
        model = {name: float(rng.uniform(*bounds)) for name, bounds in self.model.items()}
        sections: dict[str, Any] = {
            "scene": course.scene,
            "scene_parameters": dict(course.scene_parameters),
            "model": model,
            "delays": as_mapping(course.delays),
        }
        if course.push is not None:
            drawn = float(rng.uniform(-180.0, 180.0))
            angle = drawn if course.push.angle_deg is None else course.push.angle_deg
            at = begin + 1.0 + float(rng.uniform(0.0, 2.0 * step_time(course.vx)))
            sections["pushes"] = [push(at, course.push.impulse, angle)]
        window, command = (begin, begin + course.seconds), (course.vx, course.vy, course.yaw_rate)
        return walk(seed, window, *command, changes=words, **sections)

    def cost_of(self, trial: Trial, measures: Measures) -> float:
        """Cost of one run in points; an earlier fall costs more."""
        if measures["fell"]:
            early = 1.0 - min(1.0, measures["end"] / float(trial.content["duration"]))
            return self.cost.fall * (1.0 + early)
        commanded = trial.content["operator"][-1]
        points = measures["tracking"] / self.cost.tracking
        for name in ("vx", "vy", "yaw_rate"):
            points += abs(measures[name] - commanded[name]) / getattr(self.cost, name)
        return float(points) if math.isfinite(points) else self.cost.fall


def load_objective(path: Path = DEFAULT) -> Objective:
    """Read an objective from its file; see the one that comes with the package.

    Raises:
        ExperimentError: naming the key, its value and what is permitted.
    """
    try:
        return structure(Objective, read_mapping(path))
    except ParameterError as error:
        raise ExperimentError(f"{path}: {error}") from None
