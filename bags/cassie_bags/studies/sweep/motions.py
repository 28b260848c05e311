"""What the robot does in the trials of a row: it walks, crosses a scene, stands or rides.

A motion is a section of a row. Its class says which keys the section has, and makes a trial.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass
from typing import Any

from cassie_bags.studies.sweep.course import COMMAND_AT, Budget, steady, walk
from cassie_bags.studies.sweep.random_commands import (
    radio_commands,
    riding_commands,
    standing_commands,
)
from cassie_bags.studies.trial import Measures, Trial
from cassie_msgs.tunables import ParameterError, tunable

_LEVEL_PART = 1.0  # m, length of the level part before an obstacle
_TIME_FACTOR = 2.0  # longest time for a distance by that at the commanded speed; also its inverse
_SETTLED = 5.0  # s, time at which a robot that was let down stands quietly
_LET_GO = 10.0  # s, when the operator lets go of the Segway; the rider begins a second later

GO = 16.0
"""Time at which a ride begins; before, the rider finds at rest how the robot stands. In s."""

Steps = Sequence[Mapping[str, Any]]
"""Steps of the operator."""

Window = tuple[float, float]
"""Begin and end of the part to measure. In s."""


class Motion(ABC):
    """A motion that holds unless the robot falls, and that commands no speed."""

    @property
    def forward(self) -> float:
        """Commanded speed forward. In m/s."""
        return 0.0

    @property
    def fastest(self) -> float:
        """Magnitude of the commanded speed that takes longest to be reached. In m/s."""
        return abs(self.forward)

    def window(self, budget: Budget) -> Window:
        """The measured part of a row without `window`.

        Raises:
            ParameterError: if rows of this motion must have one.
        """
        raise ParameterError("window must be given: {begin, seconds} or {end, seconds}")

    def commands(self, seed: int, end: float) -> Steps:
        """Random steps of the operator until a time (s), if the motion has them."""
        return ()

    @abstractmethod
    def trial(self, budget: Budget, seed: int, window: Window, then: Steps, **more: Any) -> Trial:
        """A trial, with further steps of the operator and other sections of the experiment."""

    def holds(self, measures: Measures) -> bool:
        """Whether a trial that did not fall holds, apart from the bounds of the row."""
        return True


@dataclass(frozen=True, kw_only=True)
class Walk(Motion):
    """The robot stands on the ground, walks, and follows a command from `COMMAND_AT` on."""

    vx: float | None = tunable(None, "m/s", -3.0, 3.0, "Commanded speed forward")
    vy: float | None = tunable(None, "m/s", -1.0, 1.0, "Commanded speed to the left")
    yaw_rate: float | None = tunable(None, "rad/s", -3.0, 3.0, "Commanded turn rate to the left")
    seconds: float | None = tunable(None, "s", 0.1, 1e5, "Measured time at the steady speed")
    random: bool = tunable(False, description="Whether sticks and switches jump at random")

    @property
    def forward(self) -> float:
        return self.vx or 0.0

    @property
    def fastest(self) -> float:
        return max(abs(self.forward), abs(self.vy or 0.0), 0.5 * abs(self.yaw_rate or 0.0))

    def window(self, budget: Budget) -> Window:
        return steady(self.fastest, budget.seconds if self.seconds is None else self.seconds)

    def commands(self, seed: int, end: float) -> Steps:
        return radio_commands(seed, COMMAND_AT, end) if self.random else ()

    def trial(self, budget: Budget, seed: int, window: Window, then: Steps, **more: Any) -> Trial:
        command = self.vx, self.vy, self.yaw_rate
        return walk(seed, window, *command, changes=budget.changes, then=then, **more)


@dataclass(frozen=True, kw_only=True)
class Cross(Motion):
    """The robot walks over a scene, up to a distance that it must reach in time."""

    vx: float = tunable(MISSING, "m/s", 0.05, 3.0, "Commanded speed forward")
    distance: float = tunable(MISSING, "m", 0.0, 1e5, "Distance beyond the level part")

    @property
    def forward(self) -> float:
        return self.vx

    @property
    def ahead(self) -> float:
        """Distance from the start. In m."""
        return _LEVEL_PART + self.distance

    def window(self, budget: Budget) -> Window:
        return COMMAND_AT, COMMAND_AT + _TIME_FACTOR * self.ahead / self.vx

    def trial(self, budget: Budget, seed: int, window: Window, then: Steps, **more: Any) -> Trial:
        more = {"duration": self.window(budget)[1], **more}
        changes, ahead = budget.changes, self.ahead
        return walk(seed, window, self.vx, changes=changes, then=then, ahead=ahead, **more)

    def holds(self, measures: Measures) -> bool:
        soonest = COMMAND_AT + self.ahead / self.vx / _TIME_FACTOR
        return measures["ahead"] >= self.ahead and measures["end"] > soonest


@dataclass(frozen=True, kw_only=True)
class Stand(Motion):
    """The robot is let down from the gantry and stands."""

    height: float = tunable(0.9, "m", 0.3, 1.1, "Commanded pelvis height")
    random: bool = tunable(False, description="Whether sliders and sticks jump at random")

    def commands(self, seed: int, end: float) -> Steps:
        return standing_commands(seed, _SETTLED, end) if self.random else ()

    def trial(self, budget: Budget, seed: int, window: Window, then: Steps, **more: Any) -> Trial:
        content = {
            "start": "gantry",
            "gantry": [{"t": 0.2, "height": 0.8, "speed": 0.5}],
            "duration": window[1],
            "operator": [{"t": 0.0, "power": True, "mode": "stand", "height": self.height}, *then],
            **more,
        }
        return Trial(content, seed, window, None, budget.changes)


@dataclass(frozen=True, kw_only=True)
class Ride(Motion):
    """The robot is let down onto a Segway, crouches, and rides; a rider drives it from `GO` on."""

    surface: str = tunable("sidewalk", description="Surface of the ground")
    softness: float | None = tunable(None, "", 0.1, 10.0, "Softness of the platform by the nominal")
    stands: bool = tunable(False, description="Whether the robot stands on it without riding")
    random: bool = tunable(False, description="Whether leans and heights jump at random")

    def commands(self, seed: int, end: float) -> Steps:
        return riding_commands(seed, GO, end) if self.random else ()

    def trial(self, budget: Budget, seed: int, window: Window, then: Steps, **more: Any) -> Trial:
        scene: dict[str, Any] = {"let_go": _LET_GO, "surface": self.surface}
        if self.softness is not None:
            scene["softness"] = self.softness
        content: dict[str, Any] = {
            "scene": "segway",
            "scene_parameters": scene,
            "start": "gantry",
            "duration": window[1],
            "gantry": [
                {"t": 0.02, "action": "hold", "height": 1.35, "speed": 1.0},
                {"t": 1.0, "action": "lower", "height": 0.785, "speed": 0.3},
            ],
            "operator": [
                {"t": 0.0, "power": True, "mode": "stand", "height": 0.65},
                *([] if self.stands else [{"t": 5.0, "mode": "segway"}]),
                *then,
            ],
            **more,
        }
        if rider := more.get("rider"):
            start = {"t": _LET_GO + 1.0, "speed": 0.0, "heading": 0.0}
            targets = [start, *rider["targets"]]
            content["rider"] = {"seed": seed, **rider, "targets": targets}
        return Trial(content, seed, window, None, budget.changes)


MOTIONS: dict[str, type[Motion]] = {"walk": Walk, "cross": Cross, "stand": Stand, "ride": Ride}
"""Class of a motion by its key in a row."""
