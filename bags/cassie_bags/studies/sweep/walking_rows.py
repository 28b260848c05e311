"""Rows on level ground: speeds, turning, drift, stops, pushes, and a random radio."""

from __future__ import annotations

import dataclasses

from cassie_bags.studies.sweep.course import (
    AFTER_EVENT,
    COMMAND_AT,
    PUSH_TIME,
    SETTLING,
    Budget,
    Trials,
    mirrored,
    push,
    reached_at,
    robots,
    steady,
    straight,
    tenths,
    walk,
)
from cassie_bags.studies.sweep.random_commands import radio_commands
from cassie_bags.studies.sweep.row import Row, at_most, counted
from cassie_bags.studies.trial import Trial

SPEEDS = (-0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0)
STOP_SPEEDS = (0.0, 0.3, 0.6, 1.0, -0.4)

HELD = 20.0
"""Time for which a top speed is held. In s."""

SLIP = 0.1
"""Largest sideways velocity while turning. In m/s."""

STOPPED_WITHIN = 12.0
"""Time after the command to stand until the robot stands, without the deceleration. In s."""

DRIFT_TIME = 60.0

RADIO_TIME = 7.5
"""Time of random radio commands over the budget's measured seconds: 5 min by default."""

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
"""Directions of pushes, from ahead to the left. In deg."""


def walking_rows() -> list[Row]:
    """All rows of this module."""
    return [
        *(_speed(speed) for speed in SPEEDS),
        top_speed("top_speed.forward", "top speed forward", 1.0, tenths(8, 20), 1.6),
        top_speed("top_speed.backward", "top speed backward", -1.0, tenths(3, 10), 0.9),
        _sideways("left", 0.3),
        _sideways("right", -0.3),
        _turn("in_place", "in place", 0.0, 0.8),
        _turn("walking", "at 0.5 m/s", 0.5, 0.5),
        _drift("hold", "with", 0.05),
        _drift("free", "without", 0.1, "controller.walk.hold_gain=0"),
        *(_stop(speed) for speed in STOP_SPEEDS),
        *(_push("in_place", 0.0, name, 22.0, 12.0) for name in DIRECTIONS),
        *(_push("walking", 0.5, name, 18.0, 10.0) for name in ("fore", "aft", "left", "right")),
        _radio(),
    ]


def _speed(speed: float) -> Row:
    return at_most(
        f"speed.{speed:+g}",
        f"speed error at {speed:g} m/s",
        "m/s",
        0.03,
        straight,
        lambda measures, vx: abs(measures["vx"] - vx),
        speed,
        achieved="vx",
    )


def top_speed(name: str, title: str, sign: float, levels: list[float], target: float) -> Row:
    """A row of speeds that the robot holds.

    Args:
        name, title, levels, target: See `Row`; levels and target are positive. In m/s.
        sign: 1 for forward, -1 for backward.
    """

    def trial(budget: Budget, seed: int, level: float) -> Trial:
        return walk(budget, seed, steady(budget, sign * level, HELD), vx=sign * level)

    return Row(
        name,
        f"{title}, held {HELD:g} s",
        "m/s",
        target,
        levels,
        robots(trial),
        figure=lambda measures, _: sign * measures["vx"],
        achieved=lambda measures, _: sign * measures["vx"],
    )


def _sideways(name: str, speed: float) -> Row:
    def trial(budget: Budget, seed: int, vy: float) -> Trial:
        return walk(budget, seed, steady(budget, vy, 0.5 * budget.seconds), vy=vy)

    return at_most(
        f"sideways.{name}",
        f"sideways speed error at {speed:+g} m/s",
        "m/s",
        0.05,
        robots(trial),
        lambda measures, vy: abs(measures["vy"] - vy),
        speed,
        achieved="vy",
    )


def _turn(name: str, title: str, speed: float, target: float) -> Row:
    return Row(
        f"turn.{name}",
        f"turn rate {title}, side-slip below {SLIP:g} m/s",
        "rad/s",
        target,
        tenths(1, 12),
        turning(speed),
        holds=lambda measures, _: measures["vy_slip"] <= SLIP,
        figure=lambda measures, _: abs(measures["yaw_rate"]),
    )


def turning(speed: float) -> Trials:
    """Trials of turning with the level as rate; robots with even seeds turn right. Speed in m/s."""

    def trial(budget: Budget, seed: int, rate: float) -> Trial:
        window = steady(budget, max(speed, 0.5 * rate), 0.5 * budget.seconds)
        return walk(budget, seed, window, vx=speed, yaw_rate=mirrored(seed, rate))

    return robots(trial)


def _drift(name: str, title: str, target: float, *changes: str) -> Row:
    def trial(budget: Budget, seed: int, _: float) -> Trial:
        begin = COMMAND_AT + SETTLING
        changed = dataclasses.replace(budget, changes=(*budget.changes, *changes))
        return walk(changed, seed, (begin, begin + DRIFT_TIME))

    title = f"drift in place in {DRIFT_TIME:g} s, {title} position hold"
    return at_most(f"drift.{name}", title, "m", target, robots(trial), "drift_of_steps")


def _stop(speed: float) -> Row:
    def trials(budget: Budget, vx: float) -> list[Trial]:
        begin = reached_at(vx) + SETTLING
        end = begin + abs(vx) / 0.3 + STOPPED_WITHIN
        stand = {"mode": "stand", "vx": 0.0}
        return [
            walk(budget, seed, (end - 1.0, end), vx=vx, then=[{"t": begin + delay, **stand}])
            for delay, seed in budget.each_phase(vx)
        ]

    return counted(
        f"stop.{speed:+g}",
        f"walk to stand from {speed:g} m/s, 10 phases",
        trials,
        lambda measures, _: measures["standing"] > 0.0 and measures["end_speed"] < 0.02,
        speed,
    )


def _push(where: str, speed: float, name: str, fore: float, aside: float) -> Row:
    return Row(
        f"push_{where}.{name}",
        f"push {where.replace('_', ' ')}, {name.replace('_', ' ')}, 9 of 10 phases",
        "Ns",
        fore if name in ("fore", "aft") else aside,
        [2.0 * n for n in range(1, 21)],
        pushed(speed, DIRECTIONS[name]),
        share=0.9,
    )


def pushed(speed: float, angle_deg: float, durations: tuple[float, ...] = (PUSH_TIME,)) -> Trials:
    """Trials of pushes at times within two steps, with the level as impulse (Ns).

    Args:
        speed: Walking speed. In m/s.
        angle_deg: Direction of the force, from ahead to the left. In deg.
        durations: Durations of the pushes, in turn. In s.
    """

    def trials(budget: Budget, impulse: float) -> list[Trial]:
        begin = reached_at(speed) + (SETTLING if speed else 2.0)
        end = begin + 1.0 + AFTER_EVENT
        made = []
        for index, (delay, seed) in enumerate(budget.each_phase(speed)):
            event = push(begin + delay, impulse, angle_deg, durations[index % len(durations)])
            made.append(walk(budget, seed, (end - 1.0, end), vx=speed, pushes=[event]))
        return made

    return trials


def _radio() -> Row:
    def trial(budget: Budget, seed: int, _: float) -> Trial:
        end = COMMAND_AT + RADIO_TIME * budget.seconds
        return walk(budget, seed, (end - 1.0, end), then=radio_commands(seed, COMMAND_AT, end))

    title = "robots that bear sticks and switches at random for 5 min"
    return counted("radio.jumps", title, robots(trial))
