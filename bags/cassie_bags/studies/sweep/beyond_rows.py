"""Rows on level ground whose targets lie beyond what the shipped law promises."""

from __future__ import annotations

import dataclasses
import math
from functools import partial
from typing import Any

from cassie_bags.studies.sweep.beyond_ground_rows import FIVE_KILOMETRES, KEPT
from cassie_bags.studies.sweep.course import (
    AFTER_EVENT,
    SETTLING,
    Budget,
    push,
    reached_at,
    steady,
    walk,
)
from cassie_bags.studies.sweep.row import Row
from cassie_bags.studies.sweep.standing_course import SETTLED, stand
from cassie_bags.studies.sweep.walking_rows import HELD, SLIP
from cassie_bags.studies.trial import Figures, Trial

PUSH_TIMES = (0.05, 0.1, 0.2, 0.4)
"""How long pushes from all directions last, in turn. In s."""

FORCE_TIME = 3.0
"""How long a steady force lasts. In s."""

BACK_WITHIN = 2.0
"""Time after a steady force until the commanded velocity must be there again. In s."""

BACK_TO = 0.1
"""How near to it, as a mean over two steps. In m/s."""

EVERYTHING = {"vx": 1.0, "vy": 0.2, "yaw_rate": 0.4}
"""The fast command of everything at once. In m/s, m/s, rad/s."""

OFF_CENTRE = 0.05
"""Distance of a payload from the pelvis's centre of mass. In m."""

SPEED_ERROR = 0.03
"""That a payload may bring. In m/s."""


FAR_SPEED = 1.65
"""At which five kilometres are walked on level ground. In m/s."""


def beyond_rows() -> list[Row]:
    """All rows of this module."""
    return [
        *_fastest(),
        _far(),
        _quarter_turn(),
        _everything(),
        *_forces(),
        *_payloads(),
        *_pushes(),
        *_costs(),
    ]


def _fastest() -> list[Row]:
    def trials(sign: float, budget: Budget, speed: float) -> list[Trial]:
        window = steady(budget, speed, HELD)
        return [walk(budget, seed, window, vx=sign * speed) for seed in budget.each_seed()]

    def row(name: str, sign: float, target: float, levels: list[float]) -> Row:
        return Row(
            f"fastest.{name}",
            f"top speed {name}, held {HELD:g} s",
            "m/s",
            target,
            levels,
            partial(trials, sign),
            figure=lambda figures, _: sign * figures["vx"],
            start=levels.index(target),
            achieved=lambda figures, _: sign * figures["vx"],
        )

    return [
        row("forward", 1.0, 2.2, [tenths / 10.0 for tenths in range(12, 25)]),
        row("backward", -1.0, 1.2, [tenths / 10.0 for tenths in range(6, 14)]),
    ]


def _far() -> Row:
    def trials(budget: Budget, speed: float) -> list[Trial]:
        end = reached_at(speed) + 1.2 * FIVE_KILOMETRES / speed
        return [
            dataclasses.replace(
                walk(budget, seed, (end - 1.0, end), vx=speed, ahead=FIVE_KILOMETRES), kept=KEPT
            )
            for seed in budget.each_seed()
        ]

    return Row(
        "far.level",
        f"time for five kilometres on level ground at {FAR_SPEED:g} m/s",
        "min",
        53.0,
        (FAR_SPEED,),
        trials,
        holds=lambda figures, _: figures["ahead"] >= FIVE_KILOMETRES,
        figure=lambda figures, _: figures["end"] / 60.0,
        at_least=False,
    )


def _quarter_turn() -> Row:
    def trials(budget: Budget, rate: float) -> list[Trial]:
        window = steady(budget, 0.5 * rate, 0.5 * budget.seconds)
        return [
            walk(budget, seed, window, vx=0.0, yaw_rate=rate if seed % 2 else -rate)
            for seed in budget.each_seed()
        ]

    levels = [0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2]
    return Row(
        "turn.quarter",
        f"steps of a quarter turn while it turns in place, side-slip below {SLIP:g} m/s",
        "",
        4.0,
        levels,
        trials,
        holds=lambda figures, _: figures["vy_slip"] <= SLIP,
        figure=lambda figures, _: 0.5 * math.pi * figures["step_rate"] / abs(figures["yaw_rate"]),
        at_least=False,
        start=levels.index(1.1),
    )


def _everything() -> Row:
    def trials(budget: Budget, _: float) -> list[Trial]:
        window = steady(budget, EVERYTHING["vx"], 0.5 * budget.seconds)
        return [walk(budget, seed, window, **_mirrored(seed)) for seed in budget.each_seed()]

    return Row(
        "speed.everything",
        "largest error of 1 m/s, 0.2 m/s sideways and 0.4 rad/s at once",
        "%",
        5.0,
        (1.0,),
        trials,
        figure=lambda figures, _: 100.0 * _missed(figures),
        at_least=False,
    )


def _mirrored(seed: int) -> dict[str, float]:
    """Everything at once; sideways and turn each to the left or right, as the seed says."""
    sideways, turn = 1 - 2 * (seed // 2 % 2), 1 - 2 * (seed % 2)
    return {
        "vx": EVERYTHING["vx"],
        "vy": sideways * EVERYTHING["vy"],
        "yaw_rate": turn * EVERYTHING["yaw_rate"],
    }


def _missed(figures: Figures) -> float:
    """Largest relative error of the three magnitudes."""
    return max(abs(abs(figures[name]) / value - 1.0) for name, value in EVERYTHING.items())


def _forces() -> list[Row]:
    def standing(budget: Budget, newtons: float) -> list[Trial]:
        end = SETTLED + FORCE_TIME + BACK_WITHIN + AFTER_EVENT
        left, right = (
            stand(budget, end, AFTER_EVENT, pushes=[_steady_force(SETTLED, side * newtons)])
            for side in (1.0, -1.0)
        )
        return [(left, right)[index % 2][index] for index in range(len(left))]

    def walking(speed: float, budget: Budget, newtons: float) -> list[Trial]:
        begin = reached_at(speed) + SETTLING
        trials = []
        for index, (delay, seed) in enumerate(budget.each_phase(speed)):
            start = begin + delay + FORCE_TIME + BACK_WITHIN
            force = _steady_force(begin + delay, -newtons if index % 2 else newtons)
            window = (start, start + AFTER_EVENT)
            trials.append(walk(budget, seed, window, vx=speed, pushes=[force]))
        return trials

    levels = [6.0, 10.0, 14.0, 18.0, 22.0, 26.0, 30.0, 36.0, 42.0]
    return [
        Row(
            f"steady_force.{name}",
            f"force to the side for {FORCE_TIME:g} s {title}, "
            f"within {BACK_TO:g} m/s of the command {BACK_WITHIN:g} s later",
            "N",
            22.0,
            levels,
            trials,
            holds=lambda figures, _: figures["velocity_off"] <= BACK_TO,
            start=levels.index(22.0),
        )
        for name, title, trials in (
            ("standing", "standing", standing),
            ("in_place", "in place", partial(walking, 0.0)),
            ("walking", "at 0.8 m/s", partial(walking, 0.8)),
        )
    ]


def _steady_force(time: float, newtons: float) -> dict[str, Any]:
    """A force on the pelvis to the left of where the robot looks at the start."""
    return push(time, newtons * FORCE_TIME, 90.0, FORCE_TIME)


def _payloads() -> list[Row]:
    def trials(speed: float, budget: Budget, mass: float) -> list[Trial]:
        window = steady(budget, speed, 0.5 * budget.seconds)
        return [
            walk(budget, seed, window, vx=speed, payload=_payload(seed, mass))
            for seed in budget.each_seed()
        ]

    levels = [2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 15.0]
    return [
        Row(
            f"payload.{name}",
            f"unknown payload {OFF_CENTRE:g} m off centre {title}, "
            f"speed error up to {SPEED_ERROR:g} m/s",
            "kg",
            8.0,
            levels,
            partial(trials, speed),
            holds=partial(_keeps, speed),
            start=levels.index(8.0),
        )
        for name, title, speed in (
            ("in_place", "in place", 0.0),
            ("walking", "at 0.5 m/s", 0.5),
            ("fast", "at 1 m/s", 1.0),
        )
    ]


def _payload(seed: int, mass: float) -> dict[str, float]:
    """Fore, left, aft or right of the centre, as the seed says."""
    angle = 0.5 * math.pi * (seed - 1)
    return {"mass": mass, "x": OFF_CENTRE * math.cos(angle), "y": OFF_CENTRE * math.sin(angle)}


def _keeps(speed: float, figures: Figures, _: float) -> bool:
    return abs(figures["vx"] - speed) <= SPEED_ERROR


def _pushes() -> list[Row]:
    levels = [6.0, 10.0, 14.0, 18.0, 22.0, 26.0, 30.0, 36.0, 42.0, 48.0]
    rows = []
    for name, title, speed, fore, aside in (
        ("in_place", "in place", 0.0, 36.0, 30.0),
        ("slow", "at 0.5 m/s", 0.5, 26.0, 26.0),
        ("fast", "at 1 m/s", 1.0, 22.0, 22.0),
    ):
        for angle in range(0, 360, 30):
            target = fore if angle % 180 == 0 else aside
            rows.append(
                Row(
                    f"push_circle_{name}.{angle}",
                    f"push of 0.05 to 0.4 s {title}, {angle} deg from ahead, 9 of 10 phases",
                    "Ns",
                    target,
                    levels,
                    partial(_pushed, speed, float(angle)),
                    share=0.9,
                    start=levels.index(target),
                )
            )
    return rows


def _pushed(speed: float, angle_deg: float, budget: Budget, impulse: float) -> list[Trial]:
    begin = reached_at(speed) + (SETTLING if speed else 2.0)
    end = begin + 1.0 + AFTER_EVENT
    trials = []
    for index, (delay, seed) in enumerate(budget.each_phase(speed)):
        pushed = push(begin + delay, impulse, angle_deg, PUSH_TIMES[index % len(PUSH_TIMES)])
        trials.append(walk(budget, seed, (end - 1.0, end), vx=speed, pushes=[pushed]))
    return trials


def _costs() -> list[Row]:
    def trials(budget: Budget, speed: float) -> list[Trial]:
        return [walk(budget, seed, steady(budget, speed), vx=speed) for seed in budget.each_seed()]

    return [
        Row(
            f"transport_{name}.{speed:g}",
            f"{title} at {speed:g} m/s",
            unit,
            target,
            (speed,),
            trials,
            figure=lambda figures, _, key=key: figures[key],  # type: ignore[misc]
            at_least=False,
        )
        for name, key, title, unit, targets in (
            # 15 % below 0.29 and 0.26 of work, and below the torque squared of 95 and 99 Nm.
            ("work", "transport_work", "positive work by weight and distance", "", (0.246, 0.221)),
            ("torque", "torque_rms", "RMS of all torques", "Nm", (87.6, 91.3)),
        )
        for speed, target in zip((0.5, 1.0), targets, strict=True)
    ]
