"""Rows on ground whose targets lie beyond what the shipped law promises."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import Any

from cassie_bags.studies.sweep.course import Budget, steady, step_time, walk
from cassie_bags.studies.sweep.ground_rows import (
    DISTANCE,
    LEVEL_PART,
    PAST_STEP,
    SPEED,
    crossing,
    got_across,
)
from cassie_bags.studies.sweep.row import Row
from cassie_bags.studies.trial import Trial

FAST = 0.4
"""At which rough ground and steps are walked. In m/s."""

ROUGH_DISTANCE = 15.0
"""Over which rough ground must be walked. In m."""

GRASS_DISTANCE = 20.0
"""Over which grass must be walked. In m."""

TURN_RATE = 0.6
"""At which it turns on a slope. In rad/s."""

ICE_LENGTH = 0.5
"""Length of a slippery patch, of which each is followed by a metre of concrete. In m."""

ICE_PATCHES = 5
"""Slippery patches one behind the other."""

ICE_DISTANCE = ICE_PATCHES * (ICE_LENGTH + 1.0) + 1.0
"""Over which the patches lie. In m."""

STAIRS, TREAD, LANDING = 5, 0.3, 1.5
"""Steps of a flight of stairs, their depth, and the way between two flights. In m."""

FIVE_KILOMETRES = 5000.0
"""In m."""

COURSE_SPEED = 0.6
"""At which a course of all grounds is walked. In m/s."""

KEPT = 20.0
"""Of long runs this much is kept in memory. In s."""

MOST = 0.9
"""Share of the trials that must hold where 18 of 20 are asked for."""


def beyond_ground_rows() -> list[Row]:
    """All rows of this module."""
    return [
        _rough(),
        *_grass(),
        *_steep(),
        *_steps(),
        *_stairs(),
        *_turning(),
        _ice(),
        _course(),
    ]


def _rough() -> Row:
    def trials(budget: Budget, height: float) -> list[Trial]:
        return [
            crossing(
                budget,
                seed,
                "rough",
                {"height": height, "grain": 0.4, "start": LEVEL_PART, "seed": seed},
                ROUGH_DISTANCE,
                FAST,
            )
            for seed in budget.each_seed()
        ]

    levels = [0.01, 0.02, 0.03, 0.04, 0.05, 0.06]
    return Row(
        "rough.hard",
        f"s.d. of hard ground's height, grain 0.4 m, at {FAST:g} m/s over {ROUGH_DISTANCE:g} m, "
        "9 of 10 robots",
        "m",
        0.04,
        levels,
        trials,
        holds=lambda figures, _: got_across(figures, ROUGH_DISTANCE, FAST),
        share=MOST,
        start=levels.index(0.04),
    )


def _grass() -> list[Row]:
    def trials(budget: Budget, speed: float) -> list[Trial]:
        return [
            crossing(budget, seed, "grass", _grass_of(seed), GRASS_DISTANCE, speed)
            for seed in budget.each_seed()
        ]

    levels = [0.4, 0.6, 0.8, 1.0, 1.2, 1.4, 1.6]
    return [
        Row(
            f"grass.{speed:g}",
            f"speed on grass over {GRASS_DISTANCE:g} m, {title}",
            "m/s",
            speed,
            levels,
            trials,
            holds=lambda figures, level: got_across(figures, GRASS_DISTANCE, level),
            share=share,
            start=levels.index(speed),
        )
        for speed, title, share in ((0.8, "all robots", 1.0), (1.2, "9 of 10 robots", MOST))
    ]


def _grass_of(seed: int) -> dict[str, float]:
    return {"uneven": 0.02, "sinking": 0.02, "start": LEVEL_PART, "seed": seed}


def _steep() -> list[Row]:
    def trials(slope: Callable[[float], dict[str, float]], budget: Budget, deg: float) -> Any:
        return [
            crossing(budget, seed, "slope", slope(deg), DISTANCE) for seed in budget.each_seed()
        ]

    def row(
        name: str,
        title: str,
        target: float,
        levels: list[float],
        slope: Callable[[float], dict[str, float]],
    ) -> Row:
        return Row(
            f"steep.{name}",
            f"steep slope {title} at {SPEED:g} m/s over {DISTANCE:g} m",
            "deg",
            target,
            levels,
            partial(trials, slope),
            holds=lambda figures, _: got_across(figures),
            start=levels.index(target),
        )

    return [
        row("up", "up", 28.0, [float(n) for n in range(16, 31, 2)], _rising),
        row("down", "down", 25.0, [float(n) for n in range(15, 30, 2)], _falling),
        row("side", "to the side", 12.0, [float(n) for n in range(6, 16)], _aslant),
    ]


def _rising(deg: float) -> dict[str, float]:
    return {"rise_deg": deg, "start": LEVEL_PART}


def _falling(deg: float) -> dict[str, float]:
    return {"rise_deg": -deg, "start": LEVEL_PART}


def _aslant(deg: float) -> dict[str, float]:
    return {"rise_deg": 0.0, "side_deg": deg}


def _steps() -> list[Row]:
    stride = 2.0 * step_time(FAST) * FAST
    distance = stride + PAST_STEP

    def trials(sign: float, budget: Budget, height: float) -> list[Trial]:
        return [
            crossing(
                budget,
                seed,
                "step",
                {"height": sign * height, "start": LEVEL_PART + further},
                distance,
                FAST,
            )
            for seed, further in _spread(budget, stride)
        ]

    def row(name: str, sign: float, target: float, levels: list[float]) -> Row:
        return Row(
            f"step_fast.{name}",
            f"blind step {name} at {FAST:g} m/s, at any phase",
            "m",
            target,
            levels,
            partial(trials, sign),
            holds=lambda figures, _: got_across(figures, distance, FAST),
            start=levels.index(target),
        )

    return [
        row("up", 1.0, 0.1, [0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.09, 0.1, 0.12]),
        row("down", -1.0, 0.2, [0.08, 0.1, 0.12, 0.14, 0.16, 0.18, 0.2, 0.22]),
    ]


def _stairs() -> list[Row]:
    stride = 2.0 * step_time(FAST) * FAST

    def row(way: str, title: str, target: float, levels: list[float]) -> Row:
        flights = 1 + way.count("_and_")
        over = flights * (STAIRS - 1) * TREAD + (flights - 1) * LANDING
        distance = stride + over + PAST_STEP

        def trials(budget: Budget, riser: float) -> list[Trial]:
            stairs = {"way": way, "flights": flights, "riser": riser, "number": STAIRS}
            stairs |= {"tread": TREAD, "landing": LANDING}
            return [
                crossing(
                    budget,
                    seed,
                    "stairs",
                    {**stairs, "start": LEVEL_PART + further},
                    distance,
                    FAST,
                )
                for seed, further in _spread(budget, stride)
            ]

        return Row(
            f"stairs.{way}",
            f"blind stairs {title}, {STAIRS} steps of {TREAD:g} m at {FAST:g} m/s, 9 of 10 robots",
            "m",
            target,
            levels,
            trials,
            holds=lambda figures, _: got_across(figures, distance, FAST),
            share=MOST,
            start=levels.index(target),
        )

    low = [0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.09, 0.1, 0.12]
    high = [*low[1:], 0.14, 0.17, 0.2]
    return [
        row("up", "up", 0.17, high),
        row("down", "down", 0.17, high),
        row("up_and_down", "up, then down", 0.1, low),
        row("down_and_up", "down, then up", 0.17, high),
    ]


def _course() -> Row:
    def trials(budget: Budget, distance: float) -> list[Trial]:
        return [
            dataclasses.replace(
                crossing(budget, seed, "random_course", {"seed": seed}, distance, COURSE_SPEED),
                kept=KEPT,
            )
            for seed in budget.each_seed()
        ]

    levels = [50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0, FIVE_KILOMETRES]
    return Row(
        "far.course",
        f"way over a course of all grounds at {COURSE_SPEED:g} m/s, each robot its own",
        "m",
        FIVE_KILOMETRES,
        levels,
        trials,
        holds=lambda figures, distance: got_across(figures, distance, COURSE_SPEED),
        start=levels.index(FIVE_KILOMETRES),
    )


def _spread(budget: Budget, length: float) -> list[tuple[int, float]]:
    """Each seed, with its part of a length (m): the seeds are spread over it."""
    return [(seed, length * (seed - 1) / budget.seeds) for seed in budget.each_seed()]


def _turning() -> list[Row]:
    def trials(speed: float, budget: Budget, deg: float) -> list[Trial]:
        window = steady(budget, SPEED, 0.5 * budget.seconds)
        return [
            walk(
                budget,
                seed,
                window,
                vx=speed,
                yaw_rate=TURN_RATE if seed % 2 else -TURN_RATE,
                scene="slope",
                scene_parameters=_aslant(deg),
            )
            for seed in budget.each_seed()
        ]

    levels = [2.0, 4.0, 6.0, 8.0, 10.0, 12.0]
    return [
        Row(
            f"slope.{name}",
            f"side slope, turning at {TURN_RATE:g} rad/s {title}",
            "deg",
            8.0,
            levels,
            partial(trials, speed),
            holds=lambda figures, _: abs(figures["yaw_rate"]) >= 0.9 * TURN_RATE,
            start=levels.index(8.0),
        )
        for name, title, speed in (("turning", "in place", 0.0), ("circling", "at 0.3 m/s", SPEED))
    ]


def _ice() -> Row:
    def trials(budget: Budget, friction: float) -> list[Trial]:
        ice = {"surface": "waxed", "friction": friction, "length": ICE_LENGTH}
        found = []
        for seed, further in _spread(budget, 2.0 * step_time(FAST) * FAST):
            patches = [ice, {"length": 1.0}] * ICE_PATCHES
            stretches = [{"length": LEVEL_PART + further}, *patches, {"length": 60.0}]
            parameters = {"stretches": stretches}
            trial = crossing(budget, seed, "course", parameters, ICE_DISTANCE, FAST)
            content = {**trial.content, "draw": {"friction": 1.0}}
            found.append(dataclasses.replace(trial, content=content))
        return found

    levels = [0.4, 0.3, 0.25, 0.2, 0.15, 0.12, 0.1, 0.08]
    return Row(
        "friction.ice",
        f"friction of {ICE_PATCHES} patches of {ICE_LENGTH:g} m at {FAST:g} m/s, 9 of 10 robots",
        "",
        0.12,
        levels,
        trials,
        holds=lambda figures, _: got_across(figures, ICE_DISTANCE, FAST),
        share=MOST,
        at_least=False,
        start=levels.index(0.12),
    )
