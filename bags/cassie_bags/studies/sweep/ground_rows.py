"""Rows on special ground: slopes, friction, sinking, steps."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

from cassie_bags.studies.sweep.course import COMMAND_AT, Budget, robots, steady, walk
from cassie_bags.studies.sweep.row import Row
from cassie_bags.studies.trial import Measures, Trial

SPEED = 0.3
"""Speed on slopes and soft ground. In m/s."""

DISTANCE = 10.0
"""Distance on slopes and soft ground. In m."""

TIME_FACTOR = 2.0
"""Ratio of the longest time for a distance to that at the commanded speed; also its inverse."""

LEVEL_PART = 1.0
"""Length of the level part before an obstacle. In m."""

PAST_STEP = 2.0
"""Distance beyond a step at which the step counts as taken. In m."""

_DUG = "pitch of feet whose heels dig in"

Parameters = Callable[[float, int, Budget], dict[str, Any]]
"""Function from level, seed and budget to parameters of a scene."""


def crossing(
    budget: Budget,
    seed: int,
    scene: str,
    parameters: dict[str, Any],
    distance: float,
    speed: float = SPEED,
    **more: Any,
) -> Trial:
    """Trial of one robot that walks over a scene.

    Args:
        budget: Extent of the runs.
        seed: Seed of the robot.
        scene: Name of the scene.
        parameters: Parameters of the scene.
        distance: Distance to walk beyond the level part. In m.
        speed: Commanded speed. In m/s.
        more: Other sections of the experiment, or `history` of the trial.
    """
    ahead = LEVEL_PART + distance
    return walk(
        budget,
        seed,
        (COMMAND_AT, COMMAND_AT + TIME_FACTOR * ahead / speed),
        vx=speed,
        ahead=ahead,
        scene=scene,
        scene_parameters=parameters,
        **more,
    )


def got_across(measures: Measures, distance: float = DISTANCE, speed: float = SPEED) -> bool:
    """Whether a robot walked the whole distance, at less than about twice the commanded speed.

    Args:
        measures: Measures of the trial.
        distance: Distance beyond the level part. In m.
        speed: Commanded speed. In m/s.
    """
    ahead = LEVEL_PART + distance
    return measures["ahead"] >= ahead and measures["end"] > COMMAND_AT + ahead / speed / TIME_FACTOR


def crossed(
    name: str,
    title: str,
    unit: str,
    target: float,
    levels: Sequence[float],
    scene: str,
    parameters: Parameters,
    *,
    distance: Callable[[float], float] = lambda level: DISTANCE,
    speed: float | None = SPEED,
    history: float | None = None,
    sections: dict[str, Any] | None = None,
    **more: Any,
) -> Row:
    """A row of ground that each robot crosses.

    Args:
        name, title, unit, target, levels: See `Row`.
        scene: Name of the scene.
        parameters: Parameters of the scene.
        distance: Distance to walk beyond the level part, by the level. In m.
        speed: Commanded speed. In m/s; None: the level.
        history: See `Trial`. In s.
        sections: Other sections of the experiment.
        more: Other fields of the row.
    """

    def way(level: float) -> tuple[float, float]:
        return distance(level), level if speed is None else speed

    def trial(budget: Budget, seed: int, level: float) -> Trial:
        ground = parameters(level, seed, budget)
        return crossing(
            budget, seed, scene, ground, *way(level), history=history, **(sections or {})
        )

    def holds(measures: Measures, level: float) -> bool:
        return got_across(measures, *way(level))

    return Row(name, title, unit, target, levels, robots(trial), holds, **more)


def ground_rows() -> list[Row]:
    """All rows of this module."""
    steep = [2.5 * n for n in range(1, 11)]
    return [
        slope("slope.up", "slope up", 20.0, steep, rising),
        slope("slope.down", "slope down", 15.0, steep, falling),
        slope("slope.side", "slope to the side", 8.0, [float(n) for n in range(1, 13)], aslant),
        _friction(0.5, 0.25),
        _friction(0.2, 0.2),
        _sinking("sand", "depth of the feet", "m", 0.06, 7, "depth", "sinking"),
        _sinking("heel", _DUG, "deg", 30.0, 8, "sole_pitch", "heel_dig", sinking=0.03),
        _step("down", -1.0, 0.1, [0.02, 0.04, 0.06, 0.08, 0.1, 0.12, 0.14, 0.16]),
        _step("up", 1.0, 0.05, [0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.1]),
    ]


def slope(
    name: str, title: str, target: float, levels: Sequence[float], parameters: Parameters
) -> Row:
    """A row of slopes, with the angle as level.

    Args:
        name, title, target, levels: See `Row`. In deg.
        parameters: Parameters of the scene.
    """
    title = f"{title} at {SPEED:g} m/s over {DISTANCE:g} m"
    return crossed(name, title, "deg", target, levels, "slope", parameters)


def rising(deg: float, *_: Any) -> dict[str, float]:
    """Parameters of a slope that rises ahead."""
    return {"rise_deg": deg, "start": LEVEL_PART}


def falling(deg: float, *_: Any) -> dict[str, float]:
    """Parameters of a slope that falls ahead."""
    return {"rise_deg": -deg, "start": LEVEL_PART}


def aslant(deg: float, *_: Any) -> dict[str, float]:
    """Parameters of a slope that rises to the left."""
    return {"rise_deg": 0.0, "side_deg": deg}


def _friction(speed: float, target: float) -> Row:
    def trial(budget: Budget, seed: int, friction: float) -> Trial:
        return walk(
            budget,
            seed,
            steady(budget, speed, 0.5 * budget.seconds),
            vx=speed,
            scene="waxed_floor",
            scene_parameters={"friction": friction},
            draw={"friction": 1.0},
        )

    return Row(
        f"friction.{speed:g}",
        f"least friction at {speed:g} m/s",
        "",
        target,
        [0.8, 0.6, 0.5, 0.4, 0.35, 0.3, 0.25, 0.2, 0.15, 0.1],
        robots(trial),
        at_least=False,
    )


def _sinking(
    name: str,
    title: str,
    unit: str,
    target: float,
    first_cm: int,
    figure: str,
    parameter: str,
    **ground: float,
) -> Row:
    """A row of sand: the level (m) is a parameter of the sand; `first_cm` is the first level."""

    def parameters(level: float, *_: Any) -> dict[str, Any]:
        sand = {"surface": "sand", "uneven": 0.0, "length": 60.0, **ground, parameter: level}
        return {"stretches": [sand]}

    row = crossed(
        f"sinking.{name}",
        f"{title} at {SPEED:g} m/s over {DISTANCE:g} m",
        unit,
        target,
        [n / 100 for n in range(1, 15)],
        "course",
        parameters,
        distance=lambda _: DISTANCE - LEVEL_PART,
        figure=figure,
        start=first_cm - 1,
    )

    def measured_late(budget: Budget, level: float) -> list[Trial]:
        trials = row.trials(budget, level)
        return [dataclasses.replace(trial, window=(10.0, 20.0)) for trial in trials]

    return dataclasses.replace(row, trials=measured_late)


def _step(name: str, sign: float, target: float, levels: list[float]) -> Row:
    return crossed(
        f"step.{name}",
        f"blind step {name} at {SPEED:g} m/s",
        "m",
        target,
        levels,
        "step",
        lambda height, *_: {"height": sign * height, "start": LEVEL_PART},
        distance=lambda _: PAST_STEP,
    )
