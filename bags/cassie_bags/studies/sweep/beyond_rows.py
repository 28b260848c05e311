"""Rows on level ground whose targets the shipped law does not promise."""

from __future__ import annotations

import math
from typing import Any

from cassie_bags.studies.sweep.beyond_ground_rows import FIVE_KILOMETRES, HISTORY
from cassie_bags.studies.sweep.course import (
    AFTER_EVENT,
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
from cassie_bags.studies.sweep.row import Row, at_most
from cassie_bags.studies.sweep.standing_rows import SETTLED, stand
from cassie_bags.studies.sweep.walking_rows import SLIP, pushed, top_speed, turning
from cassie_bags.studies.trial import Measures, Trial

ANGLES = range(0, 360, 30)
"""Directions of pushes, from ahead to the left. In deg."""

PUSH_TIMES = (0.05, 0.1, 0.2, 0.4)
"""Durations of pushes from all directions, in turn. In s."""

FORCE_TIME = 3.0
"""Duration of a steady force. In s."""

BACK_WITHIN = 2.0
"""Time after a steady force within which the commanded velocity must be reached again. In s."""

BACK_TO = 0.1
"""Largest error of the velocity then, as a mean over two steps. In m/s."""

EVERYTHING = {"vx": 1.0, "vy": 0.2, "yaw_rate": 0.4}
"""Fast command with all speeds at once. In m/s, m/s, rad/s."""

OFF_CENTRE = 0.05
"""Distance of a payload from the pelvis's centre of mass. In m."""

SPEED_ERROR = 0.03
"""Largest speed error with a payload. In m/s."""

FAR_SPEED = 1.65
"""Speed of the five kilometres on level ground. In m/s."""


def beyond_rows() -> list[Row]:
    """All rows of this module."""
    return [
        top_speed("fastest.forward", "fastest speed forward", 1.0, tenths(12, 24), 2.2),
        top_speed("fastest.backward", "fastest speed backward", -1.0, tenths(6, 13), 1.2),
        _far(),
        _quarter_turn(),
        _everything(),
        _force("standing", "standing", _forced_standing),
        _force("in_place", "in place", _forced_walking(0.0)),
        _force("walking", "at 0.8 m/s", _forced_walking(0.8)),
        _payload("in_place", "in place", 0.0),
        _payload("walking", "at 0.5 m/s", 0.5),
        _payload("fast", "at 1 m/s", 1.0),
        *(_push("in_place", "in place", 0.0, angle, 36.0, 30.0) for angle in ANGLES),
        *(_push("slow", "at 0.5 m/s", 0.5, angle, 26.0, 26.0) for angle in ANGLES),
        *(_push("fast", "at 1 m/s", 1.0, angle, 22.0, 22.0) for angle in ANGLES),
        # 15 % below the works of 0.29 and 0.26, and below the squared torques of 95 and 99 Nm.
        _cost("work", "positive work by weight and distance", "", 0.5, 0.246, "transport_work"),
        _cost("work", "positive work by weight and distance", "", 1.0, 0.221, "transport_work"),
        _cost("torque", "RMS of all torques", "Nm", 0.5, 87.6, "torque_rms"),
        _cost("torque", "RMS of all torques", "Nm", 1.0, 91.3, "torque_rms"),
    ]


def _far() -> Row:
    def trial(budget: Budget, seed: int, speed: float) -> Trial:
        end = reached_at(speed) + 1.2 * FIVE_KILOMETRES / speed
        return walk(
            budget, seed, (end - 1.0, end), vx=speed, ahead=FIVE_KILOMETRES, history=HISTORY
        )

    return at_most(
        "far.level",
        f"time for five kilometres on level ground at {FAR_SPEED:g} m/s",
        "min",
        53.0,
        robots(trial),
        lambda measures, _: measures["end"] / 60.0,
        FAR_SPEED,
        holds=lambda measures, _: measures["ahead"] >= FIVE_KILOMETRES,
    )


def _quarter_turn() -> Row:
    levels = tenths(6, 12)
    return Row(
        "turn.quarter",
        f"steps of a quarter turn while it turns in place, side-slip below {SLIP:g} m/s",
        "",
        4.0,
        levels,
        turning(0.0),
        holds=lambda measures, _: measures["vy_slip"] <= SLIP,
        figure=lambda measures, _: (
            0.5 * math.pi * measures["step_rate"] / abs(measures["yaw_rate"])
        ),
        at_least=False,
        start=levels.index(1.1),
    )


def _everything() -> Row:
    def trial(budget: Budget, seed: int, _: float) -> Trial:
        window = steady(budget, EVERYTHING["vx"], 0.5 * budget.seconds)
        sideways, turn = 1 - 2 * (seed // 2 % 2), 1 - 2 * (seed % 2)
        vy, yaw_rate = sideways * EVERYTHING["vy"], turn * EVERYTHING["yaw_rate"]
        return walk(budget, seed, window, vx=EVERYTHING["vx"], vy=vy, yaw_rate=yaw_rate)

    def missed(measures: Measures, _: float) -> float:
        errors = [abs(abs(measures[name]) / value - 1.0) for name, value in EVERYTHING.items()]
        return 100.0 * max(errors)

    title = "largest error of 1 m/s, 0.2 m/s sideways and 0.4 rad/s at once"
    return at_most("speed.everything", title, "%", 5.0, robots(trial), missed, 1.0)


def _force(name: str, title: str, trials: Trials) -> Row:
    return Row(
        f"steady_force.{name}",
        f"force to the side for {FORCE_TIME:g} s {title}, "
        f"within {BACK_TO:g} m/s of the command {BACK_WITHIN:g} s later",
        "N",
        22.0,
        [6.0, 10.0, 14.0, 18.0, 22.0, 26.0, 30.0, 36.0, 42.0],
        trials,
        holds=lambda measures, _: measures["velocity_off"] <= BACK_TO,
    )


def _forced_standing(budget: Budget, newtons: float) -> list[Trial]:
    end = SETTLED + FORCE_TIME + BACK_WITHIN + AFTER_EVENT
    return [
        stand(budget, seed, end, AFTER_EVENT, pushes=[_to_side(SETTLED, mirrored(seed, newtons))])
        for seed in budget.each_seed()
    ]


def _forced_walking(speed: float) -> Trials:
    def trials(budget: Budget, newtons: float) -> list[Trial]:
        made = []
        for index, (delay, seed) in enumerate(budget.each_phase(speed)):
            begin = reached_at(speed) + SETTLING + delay
            back = begin + FORCE_TIME + BACK_WITHIN
            force = _to_side(begin, mirrored(index + 1, newtons))
            made.append(walk(budget, seed, (back, back + AFTER_EVENT), vx=speed, pushes=[force]))
        return made

    return trials


def _to_side(time: float, newtons: float) -> dict[str, Any]:
    """A force on the pelvis to the left of the robot's heading at the start."""
    return push(time, newtons * FORCE_TIME, 90.0, FORCE_TIME)


def _payload(name: str, title: str, speed: float) -> Row:
    def trial(budget: Budget, seed: int, mass: float) -> Trial:
        # Ahead, left, behind or right of the centre, by the seed.
        angle = 0.5 * math.pi * (seed - 1)
        x, y = OFF_CENTRE * math.cos(angle), OFF_CENTRE * math.sin(angle)
        window = steady(budget, speed, 0.5 * budget.seconds)
        return walk(budget, seed, window, vx=speed, payload={"mass": mass, "x": x, "y": y})

    return Row(
        f"payload.{name}",
        f"unknown payload {OFF_CENTRE:g} m off centre {title}, "
        f"speed error up to {SPEED_ERROR:g} m/s",
        "kg",
        8.0,
        [2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 15.0],
        robots(trial),
        holds=lambda measures, _: abs(measures["vx"] - speed) <= SPEED_ERROR,
    )


def _push(name: str, title: str, speed: float, angle: int, fore: float, aside: float) -> Row:
    return Row(
        f"push_circle_{name}.{angle}",
        f"push of 0.05 to 0.4 s {title}, {angle} deg from ahead, 9 of 10 phases",
        "Ns",
        fore if angle % 180 == 0 else aside,
        [6.0, 10.0, 14.0, 18.0, 22.0, 26.0, 30.0, 36.0, 42.0, 48.0],
        pushed(speed, float(angle), PUSH_TIMES),
        share=0.9,
    )


def _cost(name: str, title: str, unit: str, speed: float, target: float, figure: str) -> Row:
    title = f"{title} at {speed:g} m/s"
    return at_most(f"transport_{name}.{speed:g}", title, unit, target, straight, figure, speed)
