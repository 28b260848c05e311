"""Rows on level ground: speeds, turning, drift, stops and pushes."""

from __future__ import annotations

import dataclasses
from functools import partial

from cassie_bags.studies.sweep.course import (
    AFTER_EVENT,
    COMMAND_AT,
    SETTLING,
    Budget,
    push,
    reached_at,
    steady,
    walk,
)
from cassie_bags.studies.sweep.row import Row
from cassie_bags.studies.trial import Figures, Trial

SPEEDS = (-0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0)
STOP_SPEEDS = (0.0, 0.3, 0.6, 1.0, -0.4)
HELD = 20.0
"""Time for which a top speed is held. In s."""

SLIP = 0.1
"""Sideways velocity that turning may bring. In m/s."""

STOPPED_WITHIN = 12.0
"""Time from asking to stand until the robot must, beyond that of slowing down. In s."""

DRIFT_TIME = 60.0
DIRECTIONS = {
    "fore": 0.0,
    "aft": 180.0,
    "left": 90.0,
    "right": -90.0,
    "fore_left": 45.0,
    "fore_right": -45.0,
    "aft_left": 135.0,
    "aft_right": -135.0,
}
"""Directions of pushes from ahead, to the left. In deg."""


def walking_rows() -> list[Row]:
    """All rows of this module."""
    return [*_speeds(), *_top_speeds(), *_sideways(), *_turns(), *_drifts(), *_stops(), *_pushes()]


def _speeds() -> list[Row]:
    return [
        Row(
            f"speed.{speed:+g}",
            f"speed error at {speed:g} m/s",
            "m/s",
            0.03,
            (speed,),
            _at_speed,
            figure=lambda figures, speed: abs(figures["vx"] - speed),
            at_least=False,
            achieved=lambda figures, _: figures["vx"],
        )
        for speed in SPEEDS
    ]


def _at_speed(budget: Budget, speed: float, seconds: float | None = None) -> list[Trial]:
    window = steady(budget, speed, seconds)
    return [walk(budget, seed, window, vx=speed) for seed in budget.each_seed()]


def _top_speeds() -> list[Row]:
    def row(name: str, sign: float, levels: list[float], target: float) -> Row:
        return Row(
            f"top_speed.{name}",
            f"top speed {name}, held {HELD:g} s",
            "m/s",
            target,
            levels,
            lambda budget, level: _at_speed(budget, sign * level, HELD),
            figure=lambda figures, _: sign * figures["vx"],
            start=_nearest(levels, target),
            achieved=lambda figures, _: sign * figures["vx"],
        )

    return [
        row("forward", 1.0, _tenths(8, 20), 1.6),
        row("backward", -1.0, _tenths(3, 10), 0.9),
    ]


def _sideways() -> list[Row]:
    def trials(budget: Budget, speed: float) -> list[Trial]:
        window = steady(budget, speed, 0.5 * budget.seconds)
        return [walk(budget, seed, window, vy=speed) for seed in budget.each_seed()]

    return [
        Row(
            f"sideways.{name}",
            f"sideways speed error at {speed:+g} m/s",
            "m/s",
            0.05,
            (speed,),
            trials,
            figure=lambda figures, speed: abs(figures["vy"] - speed),
            at_least=False,
            achieved=lambda figures, _: figures["vy"],
        )
        for name, speed in (("left", 0.3), ("right", -0.3))
    ]


def _turns() -> list[Row]:
    def trials(speed: float, budget: Budget, rate: float) -> list[Trial]:
        window = steady(budget, max(speed, 0.5 * rate), 0.5 * budget.seconds)
        return [
            walk(budget, seed, window, vx=speed, yaw_rate=rate if seed % 2 else -rate)
            for seed in budget.each_seed()
        ]

    levels = _tenths(1, 12)
    return [
        Row(
            f"turn.{name}",
            f"turn rate {title}, side-slip below {SLIP:g} m/s",
            "rad/s",
            target,
            levels,
            partial(trials, speed),
            holds=lambda figures, _: figures["vy_slip"] <= SLIP,
            figure=lambda figures, _: abs(figures["yaw_rate"]),
            start=_nearest(levels, target),
        )
        for name, title, speed, target in (
            ("in_place", "in place", 0.0, 0.8),
            ("walking", "at 0.5 m/s", 0.5, 0.5),
        )
    ]


def _drifts() -> list[Row]:
    window = (COMMAND_AT + SETTLING, COMMAND_AT + SETTLING + DRIFT_TIME)

    def trials(changes: tuple[str, ...], budget: Budget, _: float) -> list[Trial]:
        budget = dataclasses.replace(budget, changes=(*budget.changes, *changes))
        return [walk(budget, seed, window) for seed in budget.each_seed()]

    return [
        Row(
            f"drift.{name}",
            f"drift in place in {DRIFT_TIME:g} s, {title} position hold",
            "m",
            target,
            (0.0,),
            partial(trials, changes),
            figure=lambda figures, _: figures["drift_of_steps"],
            at_least=False,
        )
        for name, title, target, changes in (
            ("hold", "with", 0.05, ()),
            ("free", "without", 0.1, ("controller.walk.hold_gain=0",)),
        )
    ]


def _stops() -> list[Row]:
    def trials(budget: Budget, speed: float) -> list[Trial]:
        begin = reached_at(speed) + SETTLING
        end = begin + abs(speed) / 0.3 + STOPPED_WITHIN
        return [
            walk(
                budget,
                seed,
                (end - 1.0, end),
                vx=speed,
                then=[{"t": begin + delay, "mode": "stand", "vx": 0.0}],
            )
            for delay, seed in budget.each_phase(speed)
        ]

    return [
        Row(
            f"stop.{speed:+g}",
            f"walk to stand from {speed:g} m/s, 10 phases",
            "%",
            100.0,
            (speed,),
            trials,
            holds=_stands,
            counts=True,
        )
        for speed in STOP_SPEEDS
    ]


def _stands(figures: Figures, _: float) -> bool:
    return figures["standing"] > 0.0 and figures["end_speed"] < 0.02


def _pushes() -> list[Row]:
    rows = []
    in_place = [2.0 * n for n in range(1, 21)]
    for where, speed, names, fore, aside in (
        ("in_place", 0.0, tuple(DIRECTIONS), 22.0, 12.0),
        ("walking", 0.5, ("fore", "aft", "left", "right"), 18.0, 10.0),
    ):
        for name in names:
            target = fore if name in ("fore", "aft") else aside
            rows.append(
                Row(
                    f"push_{where}.{name}",
                    f"push {where.replace('_', ' ')}, {name.replace('_', ' ')}, 9 of 10 phases",
                    "Ns",
                    target,
                    in_place,
                    partial(_pushed, speed, DIRECTIONS[name]),
                    share=0.9,
                    start=_nearest(in_place, target),
                )
            )
    return rows


def _pushed(speed: float, angle_deg: float, budget: Budget, impulse: float) -> list[Trial]:
    begin = reached_at(speed) + (SETTLING if speed else 2.0)
    end = begin + 1.0 + AFTER_EVENT
    return [
        walk(
            budget,
            seed,
            (end - 1.0, end),
            vx=speed,
            pushes=[push(begin + delay, impulse, angle_deg)],
        )
        for delay, seed in budget.each_phase(speed)
    ]


def _nearest(levels: list[float], value: float) -> int:
    return min(range(len(levels)), key=lambda index: abs(levels[index] - value))


def _tenths(first: int, last: int) -> list[float]:
    """Levels in steps of 0.1, as a person writes them: 1.2 and not 1.2000000000000002."""
    return [n / 10 for n in range(first, last + 1)]
