"""Rows on other ground: slopes, friction, sinking, steps."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import Any

from cassie_bags.studies.sweep.course import COMMAND_AT, Budget, steady, walk
from cassie_bags.studies.sweep.row import Row
from cassie_bags.studies.trial import Figures, Trial

SPEED = 0.3
"""At which slopes and soft ground are walked. In m/s."""

DISTANCE = 10.0
"""Over which they must be. In m."""

TIME_FACTOR = 2.0
"""Longest time for a distance, by that at the commanded speed; and shortest, one by it."""

LEVEL_PART = 1.0
"""Before what is to be crossed. In m."""

PAST_STEP = 2.0
"""Distance beyond a step at which it counts as taken. In m."""


def ground_rows() -> list[Row]:
    """All rows of this module."""
    return [*_slopes(), *_frictions(), *_sinking(), *_steps()]


def across(
    budget: Budget, scene: str, parameters: dict[str, Any], distance: float = DISTANCE
) -> list[Trial]:
    """Walking over a scene for a distance beyond its level part."""
    return [crossing(budget, seed, scene, parameters, distance) for seed in budget.each_seed()]


def crossing(
    budget: Budget,
    seed: int,
    scene: str,
    parameters: dict[str, Any],
    distance: float,
    speed: float = SPEED,
) -> Trial:
    """One robot that walks over a scene.

    Args:
        budget: How much to run.
        seed: Robot.
        scene: Its name.
        parameters: Of the scene.
        distance: To walk beyond its level part. In m.
        speed: Commanded. In m/s.
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
    )


def got_across(figures: Figures, distance: float = DISTANCE, speed: float = SPEED) -> bool:
    """Whether a robot went all the way, and did not run away on it."""
    ahead = LEVEL_PART + distance
    return figures["ahead"] >= ahead and figures["end"] > COMMAND_AT + ahead / speed / TIME_FACTOR


def _slopes() -> list[Row]:
    def ahead(sign: float, budget: Budget, angle: float) -> list[Trial]:
        return across(budget, "slope", {"rise_deg": sign * angle, "start": LEVEL_PART})

    def side(budget: Budget, angle: float) -> list[Trial]:
        return across(budget, "slope", {"rise_deg": 0.0, "side_deg": angle})

    def row(name: str, title: str, target: float, levels: list[float], trials: Any) -> Row:
        return Row(
            f"slope.{name}",
            f"slope {title} at {SPEED:g} m/s over {DISTANCE:g} m",
            "deg",
            target,
            levels,
            trials,
            holds=lambda figures, _: got_across(figures),
            start=levels.index(target),
        )

    steep = [2.5 * n for n in range(1, 11)]
    return [
        row("up", "up", 20.0, steep, partial(ahead, 1.0)),
        row("down", "down", 15.0, steep, partial(ahead, -1.0)),
        row("side", "to the side", 8.0, [float(n) for n in range(1, 13)], side),
    ]


def _frictions() -> list[Row]:
    levels = [0.8, 0.6, 0.5, 0.4, 0.35, 0.3, 0.25, 0.2, 0.15, 0.1]

    def trials(speed: float, budget: Budget, friction: float) -> list[Trial]:
        window = steady(budget, speed, 0.5 * budget.seconds)
        return [
            walk(
                budget,
                seed,
                window,
                vx=speed,
                scene="waxed_floor",
                scene_parameters={"friction": friction},
                draw={"friction": 1.0},
            )
            for seed in budget.each_seed()
        ]

    return [
        Row(
            f"friction.{speed:g}",
            f"least friction at {speed:g} m/s",
            "",
            target,
            levels,
            partial(trials, speed),
            at_least=False,
            start=levels.index(target),
        )
        for speed, target in ((0.5, 0.25), (0.2, 0.2))
    ]


def _sinking() -> list[Row]:
    def over(budget: Budget, ground: dict[str, float]) -> list[Trial]:
        sand = {"surface": "sand", "uneven": 0.0, "length": 60.0, **ground}
        found = across(budget, "course", {"stretches": [sand]}, DISTANCE - LEVEL_PART)
        return [dataclasses.replace(trial, window=(10.0, 20.0)) for trial in found]

    def row(
        name: str,
        title: str,
        target: tuple[float, str],
        levels: list[float],
        start: float,
        ground: Callable[[float], dict[str, float]],
        figure: str,
    ) -> Row:
        return Row(
            f"sinking.{name}",
            f"{title} at {SPEED:g} m/s over {DISTANCE:g} m",
            target[1],
            target[0],
            levels,
            lambda budget, level: over(budget, ground(level)),
            holds=lambda figures, _: got_across(figures, DISTANCE - LEVEL_PART),
            figure=lambda figures, _: figures[figure],
            start=levels.index(start),
        )

    depths = [n / 100 for n in range(1, 15)]
    return [
        row("sand", "depth of the feet", (0.06, "m"), depths, 0.07, _deep, "depth"),
        row(
            "heel",
            "pitch of feet whose heels dig in",
            (30.0, "deg"),
            depths,
            0.08,
            _dug,
            "sole_pitch",
        ),
    ]


def _deep(sinking: float) -> dict[str, float]:
    return {"sinking": sinking}


def _dug(heel_dig: float) -> dict[str, float]:
    return {"sinking": 0.03, "heel_dig": heel_dig}


def _steps() -> list[Row]:
    def trials(sign: float, budget: Budget, height: float) -> list[Trial]:
        step = {"height": sign * height, "start": LEVEL_PART}
        return across(budget, "step", step, PAST_STEP)

    def row(name: str, sign: float, target: float, levels: list[float]) -> Row:
        return Row(
            f"step.{name}",
            f"blind step {name} at {SPEED:g} m/s",
            "m",
            target,
            levels,
            partial(trials, sign),
            holds=lambda figures, _: got_across(figures, PAST_STEP),
            start=levels.index(target),
        )

    return [
        row("down", -1.0, 0.1, [0.02, 0.04, 0.06, 0.08, 0.1, 0.12, 0.14, 0.16]),
        row("up", 1.0, 0.05, [0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.1]),
    ]
