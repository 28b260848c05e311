"""Rows of standing: quiet, pushed, on other ground, with late commands, and the ways into it."""

from __future__ import annotations

from functools import partial

from cassie_bags.run.seed import Stream
from cassie_bags.studies.sweep.course import Budget, push
from cassie_bags.studies.sweep.row import Row
from cassie_bags.studies.sweep.standing_course import (
    AROUND,
    DIAGONAL,
    SETTLED,
    hardest,
    rests,
    stand,
)
from cassie_bags.studies.sweep.standing_ground_rows import standing_ground_rows
from cassie_bags.studies.trial import Figures, Trial

_LASTS = 7.5  # of the budget's measured seconds: five minutes of the usual 40 s
_AFTER = 8.0  # s after an event in which it comes to rest
_SHAKES = 0.02  # m/s, of the pelvis, with late commands
_NEAR = 0.015  # m, of a height that is reached
_LATE = {"torque": 0.002, "set_point": 0.015}


def standing_rows() -> list[Row]:
    """All rows of this module; the long ones last."""
    rows = [*_pushes(), *_recoveries(), *_heights(), *standing_ground_rows(), *_ways_in()]
    return [*rows, _late(), _random(), *_quiet()]


def _pushes() -> list[Row]:
    def trials(angle: float, budget: Budget, impulse: float) -> list[Trial]:
        end = SETTLED + _AFTER
        return stand(budget, end, end - SETTLED, pushes=[push(SETTLED, impulse, angle)])

    return [
        hardest(
            f"push.{name}",
            f"push stood without a step, {name}",
            "Ns",
            target,
            [float(n) for n in range(4, 25)],
            partial(trials, AROUND[name]),
            holds=rests,
        )
        for name, target in (("fore", 10.0), ("aft", 9.0), ("left", 18.0), ("right", 18.0))
    ]


def _recoveries() -> list[Row]:
    def trials(angle: float, budget: Budget, impulse: float) -> list[Trial]:
        return stand(budget, SETTLED + _AFTER + 4.0, pushes=[push(SETTLED, impulse, angle)])

    return [
        hardest(
            f"recovery.{name}",
            f"push stood with steps, {name.replace('_', ' ')}, 9 of 10",
            "Ns",
            25.0,
            [10.0, 15.0, 20.0, 25.0, 30.0, 35.0],
            partial(trials, angle),
            share=0.9,
            holds=rests,
        )
        for name, angle in {**AROUND, **DIAGONAL}.items()
    ]


def _heights() -> list[Row]:
    def trials(way: tuple[float, float], budget: Budget, _: float) -> list[Trial]:
        first, then = way
        commanded = [{"t": SETTLED, "height": then}]
        return stand(budget, SETTLED + 5.0, 3.0, height=first, then=commanded)

    return [
        Row(
            f"stand_height.{name}",
            f"height error after 2 s {title}, held 3 s",
            "m",
            _NEAR,
            (0.0,),
            partial(trials, way),
            holds=rests,
            figure=lambda figures, _: figures["height_off"],
            at_least=False,
        )
        for name, title, way in (
            ("up", "from 0.39 to 1.01 m", (0.39, 1.01)),
            ("down", "from 1.01 to 0.39 m", (1.01, 0.39)),
        )
    ]


def _ways_in() -> list[Row]:
    def drops(budget: Budget, fall: float) -> list[Trial]:
        # With the legs at 0.97 m of pelvis height the soles hang 1.004 m below the pelvis.
        moves = [
            {"t": 0.5, "hold": 1.004 + fall, "speed": 0.3},
            {"t": 2.5, "release": True},
        ]
        return stand(budget, 8.0, height=0.97, gantry=moves)

    def boots(budget: Budget, _: float) -> list[Trial]:
        moves = [
            {"t": 0.3, "hold": 0.5, "speed": 0.5},
            {"t": 4.0, "height": 0.4},
        ]
        power = [{"t": 0.1, "power": False}, {"t": 3.0, "power": True}]
        return stand(budget, 12.0, gantry=moves, then=power)

    def stepped(budget: Budget, _: float) -> list[Trial]:
        within_limits = [{"t": SETTLED, "mode": "walk"}, {"t": SETTLED + 5.0, "mode": "stand"}]
        return stand(budget, SETTLED + 14.0, height=0.95, then=within_limits)

    falls = [0.02, 0.05, 0.1, 0.15, 0.2]
    counted = (
        ("boot", "stands up, booted with the torso hanging at 0.5 m", boots),
        ("from_steps", "stands after stepping in place", stepped),
    )
    return [
        hardest("drop.height", "drop out of the gantry", "m", 0.1, falls, drops, holds=rests),
        *(
            Row(f"stand_in.{name}", title, "%", 100.0, (0.0,), trials, rests, counts=True)
            for name, title, trials in counted
        ),
    ]


def _late() -> Row:
    def trials(budget: Budget, _: float) -> list[Trial]:
        pushes = [push(SETTLED, 5.0, 45.0)]
        return stand(budget, SETTLED + _AFTER, delays=_LATE, pushes=pushes)

    return Row(
        "stand_late.both",
        "stands, pushed by 5 Ns, with torques 2 ms and set-points 15 ms later",
        "%",
        100.0,
        (0.0,),
        trials,
        lambda figures, level: rests(figures, level) and figures["shaking"] < _SHAKES,
        counts=True,
    )


def _random() -> Row:
    def trials(budget: Budget, _: float) -> list[Trial]:
        end = SETTLED + _LASTS * budget.seconds
        runs = []
        for seed, trial in zip(budget.each_seed(), stand(budget, end), strict=True):
            operator = [*trial.content["operator"], *random_commands(seed, SETTLED, end)]
            content = {**trial.content, "operator": operator}
            runs.append(Trial(content, seed, trial.window, None, budget.changes))
        return runs

    return Row(
        "stand_random.commands",
        "bears heights, CoM shifts and leans at random for 5 min",
        "%",
        100.0,
        (0.0,),
        trials,
        counts=True,
    )


def random_commands(seed: int, begin: float, end: float) -> list[dict[str, float]]:
    """Steps of an operator who moves sliders and sticks of standing at random, times in s."""
    draw = Stream.STANDING_COMMANDS.rng(seed)
    steps = []
    time = begin
    while time < end:
        step = {"t": round(time, 3), "height": draw.uniform(0.39, 1.01)}
        step |= {"com_x": draw.uniform(-0.05, 0.05), "com_y": draw.uniform(-0.06, 0.06)}
        step |= {"roll": draw.uniform(-0.25, 0.25), "pitch": draw.uniform(-0.25, 0.25)}
        steps.append({key: float(value) for key, value in step.items()})
        time += draw.uniform(0.1, 3.0)
    return steps


def _named(name: str, figures: Figures, _: float) -> float:
    return figures[name]


def _quiet() -> list[Row]:
    def trials(budget: Budget, _: float) -> list[Trial]:
        seconds = _LASTS * budget.seconds
        return stand(budget, SETTLED + seconds, seconds)

    return [
        Row(
            f"stand_quiet.{name}",
            f"{title} in 5 min of quiet standing",
            "m",
            target,
            (0.0,),
            trials,
            figure=partial(_named, name),
            at_least=False,
        )
        for name, title, target in (
            ("com_rms", "CoM about its mean, RMS,", 0.003),
            ("creep", "creep of a foot", 0.005),
        )
    ]
