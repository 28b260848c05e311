"""Rows on special ground whose targets the shipped law does not promise."""

from __future__ import annotations

from typing import Any

from cassie_bags.studies.sweep.course import Budget, mirrored, robots, steady, step_time, walk
from cassie_bags.studies.sweep.ground_rows import (
    LEVEL_PART,
    PAST_STEP,
    SPEED,
    aslant,
    crossed,
    falling,
    rising,
    slope,
)
from cassie_bags.studies.sweep.row import Row
from cassie_bags.studies.trial import Trial

FAST = 0.4
"""Speed on rough ground and steps. In m/s."""

ROUGH_DISTANCE = 15.0
"""Distance on rough ground. In m."""

GRASS_DISTANCE = 20.0
"""Distance on grass. In m."""

TURN_RATE = 0.6
"""Turn rate on a slope. In rad/s."""

ICE_LENGTH = 0.5
"""Length of a slippery patch; a metre of concrete follows each. In m."""

ICE_PATCHES = 5
"""Number of slippery patches, one after another."""

ICE_DISTANCE = ICE_PATCHES * (ICE_LENGTH + 1.0) + 1.0
"""Distance over which the patches lie. In m."""

PILLAR_PASSED = 25.0
"""Time at which a robot that began to bump into the pillar at 14 s must still walk. In s."""

STAIRS, TREAD, LANDING = 5, 0.3, 1.5
"""Number of steps of a flight of stairs; depth of a step, and distance of two flights. In m."""

LOW = [0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.09, 0.1, 0.12]
"""Risers for rows with a target of 0.1 m. In m."""

HIGH = [*LOW[1:], 0.14, 0.17, 0.2]
"""Risers for rows with a target of 0.17 m. In m."""

FIVE_KILOMETRES = 5000.0
"""Distance of the rows of far walks. In m."""

COURSE_SPEED = 0.6
"""Speed on a course of all grounds. In m/s."""

HISTORY = 20.0
"""`Trial.history` of long runs. In s."""

MOST = 0.9
"""Share of the trials that must hold in rows that ask for 18 of 20."""


def beyond_ground_rows() -> list[Row]:
    """All rows of this module."""
    return [
        _rough(),
        _grass(0.8, "all robots", 1.0),
        _grass(1.2, "9 of 10 robots", MOST),
        slope("steep.up", "steep slope up", 28.0, [float(n) for n in range(16, 31, 2)], rising),
        slope(
            "steep.down", "steep slope down", 25.0, [float(n) for n in range(15, 30, 2)], falling
        ),
        slope(
            "steep.side", "steep slope to the side", 12.0, [float(n) for n in range(6, 16)], aslant
        ),
        _step("up", 1.0, 0.1, LOW),
        _step("down", -1.0, 0.2, [0.08, 0.1, 0.12, 0.14, 0.16, 0.18, 0.2, 0.22]),
        _stairs("up", "up", 0.17, HIGH),
        _stairs("down", "down", 0.17, HIGH),
        _stairs("up_and_down", "up, then down", 0.1, LOW),
        _stairs("down_and_up", "down, then up", 0.17, HIGH),
        _turning("turning", "in place", 0.0),
        _turning("circling", "at 0.3 m/s", SPEED),
        _pillar(),
        _ice(),
        _course(),
    ]


def _rough() -> Row:
    return crossed(
        "rough.hard",
        f"s.d. of hard ground's height, grain 0.4 m, at {FAST:g} m/s over {ROUGH_DISTANCE:g} m, "
        "9 of 10 robots",
        "m",
        0.04,
        [0.01, 0.02, 0.03, 0.04, 0.05, 0.06],
        "rough",
        lambda height, seed, _: {
            "height": height,
            "grain": 0.4,
            "start": LEVEL_PART,
            "seed": seed,
        },
        distance=lambda _: ROUGH_DISTANCE,
        speed=FAST,
        share=MOST,
    )


def _grass(speed: float, title: str, share: float) -> Row:
    return crossed(
        f"grass.{speed:g}",
        f"speed on grass over {GRASS_DISTANCE:g} m, {title}",
        "m/s",
        speed,
        [0.4, 0.6, 0.8, 1.0, 1.2, 1.4, 1.6],
        "grass",
        lambda _, seed, __: {"uneven": 0.02, "sinking": 0.02, "start": LEVEL_PART, "seed": seed},
        distance=lambda _: GRASS_DISTANCE,
        speed=None,
        share=share,
    )


def _step(name: str, sign: float, target: float, levels: list[float]) -> Row:
    return crossed(
        f"step_fast.{name}",
        f"blind step {name} at {FAST:g} m/s, at any phase",
        "m",
        target,
        levels,
        "step",
        lambda height, seed, budget: {
            "height": sign * height,
            "start": LEVEL_PART + _further(seed, budget),
        },
        distance=lambda _: _stride() + PAST_STEP,
        speed=FAST,
    )


def _stairs(way: str, title: str, target: float, levels: list[float]) -> Row:
    flights = 1 + way.count("_and_")
    over = flights * (STAIRS - 1) * TREAD + (flights - 1) * LANDING

    def parameters(riser: float, seed: int, budget: Budget) -> dict[str, Any]:
        stairs = {"way": way, "flights": flights, "riser": riser, "number": STAIRS}
        start = LEVEL_PART + _further(seed, budget)
        return {**stairs, "tread": TREAD, "landing": LANDING, "start": start}

    return crossed(
        f"stairs.{way}",
        f"blind stairs {title}, {STAIRS} steps of {TREAD:g} m at {FAST:g} m/s, 9 of 10 robots",
        "m",
        target,
        levels,
        "stairs",
        parameters,
        distance=lambda _: _stride() + over + PAST_STEP,
        speed=FAST,
        share=MOST,
    )


def _course() -> Row:
    return crossed(
        "far.course",
        f"way over a course of all grounds at {COURSE_SPEED:g} m/s, each robot its own",
        "m",
        FIVE_KILOMETRES,
        [50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0, FIVE_KILOMETRES],
        "random_course",
        lambda _, seed, __: {"seed": seed},
        distance=lambda metres: metres,
        speed=COURSE_SPEED,
        history=HISTORY,
    )


def _stride() -> float:
    """Length of two steps. In m."""
    return 2.0 * step_time(FAST) * FAST


def _further(seed: int, budget: Budget) -> float:
    """Part of a stride by which a seed's obstacle is shifted, over all phases. In m."""
    return _stride() * (seed - budget.first) / budget.seeds


def _turning(name: str, title: str, speed: float) -> Row:
    def trial(budget: Budget, seed: int, deg: float) -> Trial:
        return walk(
            budget,
            seed,
            steady(budget, SPEED, 0.5 * budget.seconds),
            vx=speed,
            yaw_rate=mirrored(seed, TURN_RATE),
            scene="slope",
            scene_parameters=aslant(deg),
        )

    return Row(
        f"slope.{name}",
        f"side slope, turning at {TURN_RATE:g} rad/s {title}",
        "deg",
        8.0,
        [2.0, 4.0, 6.0, 8.0, 10.0, 12.0],
        robots(trial),
        holds=lambda measures, _: abs(measures["yaw_rate"]) >= 0.9 * TURN_RATE,
    )


def _pillar() -> Row:
    """The experiment `waxed_floor`, with the pillar met at each phase of a stride."""

    def trial(budget: Budget, seed: int, friction: float) -> Trial:
        floor = {"surface": "waxed", "friction": friction, "length": 60.0}
        pillar = {"x": 3.0 + _further(seed, budget), "y": 0.44, "radius": 0.2, "friction": 0.3}
        return walk(
            budget,
            seed,
            (PILLAR_PASSED - 1.0, PILLAR_PASSED),
            vx=SPEED,
            scene="course",
            scene_parameters={"stretches": [floor], "pillars": [pillar]},
        )

    return Row(
        "friction.pillar",
        f"friction of a floor with a pillar in the way, bumped into at {SPEED:g} m/s",
        "",
        0.25,
        [0.4, 0.3, 0.25, 0.22, 0.2, 0.18],
        robots(trial),
        at_least=False,
    )


def _ice() -> Row:
    def parameters(friction: float, seed: int, budget: Budget) -> dict[str, Any]:
        ice = {"surface": "waxed", "friction": friction, "length": ICE_LENGTH}
        patches = [ice, {"length": 1.0}] * ICE_PATCHES
        level = {"length": LEVEL_PART + _further(seed, budget)}
        return {"stretches": [level, *patches, {"length": 60.0}]}

    return crossed(
        "friction.ice",
        f"friction of {ICE_PATCHES} patches of {ICE_LENGTH:g} m at {FAST:g} m/s, 9 of 10 robots",
        "",
        0.12,
        [0.4, 0.3, 0.25, 0.2, 0.15, 0.12, 0.1, 0.08],
        "course",
        parameters,
        distance=lambda _: ICE_DISTANCE,
        speed=FAST,
        sections={"draw": {"friction": 1.0}},
        share=MOST,
        at_least=False,
    )
