"""Rows of riding a Segway: speed, braking, rest, turns, a slalom, pushes, random leans."""

from __future__ import annotations

from typing import Any

from cassie_bags.run.seed import Stream
from cassie_bags.studies.sweep.course import Budget, push
from cassie_bags.studies.sweep.row import Row
from cassie_bags.studies.trial import Figures, Trial

LET_GO = 10.0
"""When the operator lets go of the Segway; he watches from a second later. In s."""

GO = 16.0
"""When the rider wants to go, having found at rest how it stands on it. In s."""

TOP = 4.0
HELD = 60.0
GATE = 0.15
"""From the middle of a gate: so the Segway, 0.55 m wide, passes one of 0.85 m. In m."""

STEADY = 0.2
"""Error of the speed while it is held. In m/s."""

_TURN = 0.82  # rad/s asked for, of which some per cent may be lacking
_LEANS = {"com_x": 0.1, "com_y": 0.1, "roll": 0.25, "pitch": 0.25}
_HEIGHTS = (0.39, 1.01)


def ride(
    budget: Budget,
    seed: int,
    window: tuple[float, float],
    targets: list[dict[str, Any]],
    **more: Any,
) -> Trial:
    """Cassie is let down onto a Segway, crouches, and rides until the end of the window.

    Args:
        budget: How much to run.
        seed: Robot, and the rider's errors.
        window: Part to measure. In s.
        targets: Of the rider from `GO` on; without them nobody leans it.
        more: Sections of the experiment; `then` holds further steps of the operator.
    """
    scene = {"let_go": LET_GO, "surface": more.pop("surface", "sidewalk")}
    operator: list[dict[str, Any]] = [
        {"t": 0.0, "power": True, "mode": "stand", "height": 0.65},
        {"t": 5.0, "mode": "segway"},
        *more.pop("then", []),
    ]
    content: dict[str, Any] = {
        "scene": "segway",
        "scene_parameters": {**scene, **more.pop("scene_parameters", {})},
        "start": "gantry",
        "duration": window[1],
        "gantry": [
            {"t": 0.02, "action": "hold", "height": 1.35, "speed": 1.0},
            {"t": 1.0, "action": "lower", "height": 0.785, "speed": 0.3},
        ],
        "operator": operator,
        **more,
    }
    if targets:
        start = {"t": LET_GO + 1.0, "speed": 0.0, "heading": 0.0}
        content["rider"] = {"seed": seed, "targets": [start, *targets]}
    return Trial(content, seed, window, None, budget.changes)


def segway_rows() -> list[Row]:
    """All rows of this module."""
    return [*_speeds(), _still(), _turn(), _slalom(), _push(), _alone(), _leans()]


def _speeds() -> list[Row]:
    return [
        Row(
            "segway.speed",
            f"{TOP:g} m/s on a sidewalk within 10 s, greatest error in {HELD:g} s",
            "m/s",
            STEADY,
            (TOP,),
            lambda budget, speed: _fast(budget, speed, "sidewalk"),
            figure=_off,
            at_least=False,
        ),
        Row(
            "segway.grass",
            f"speed on grass, held within {STEADY:g} m/s for {HELD:g} s",
            "m/s",
            TOP,
            [2.0, 2.5, 3.0, 3.5, TOP],
            lambda budget, speed: _fast(budget, speed, "grass"),
            holds=lambda figures, speed: _off(figures, speed) <= STEADY,
            start=4,
        ),
        Row(
            "segway.brake",
            f"time to rest from {TOP:g} m/s",
            "s",
            6.0,
            (TOP,),
            _brake,
            figure=lambda figures, _: figures["stop_time"],
            at_least=False,
        ),
    ]


def _fast(budget: Budget, speed: float, surface: str) -> list[Trial]:
    window = (GO + 10.0, GO + 10.0 + HELD)
    go = [{"t": GO, "speed": speed}]
    return [ride(budget, seed, window, go, surface=surface) for seed in budget.each_seed()]


def _brake(budget: Budget, speed: float) -> list[Trial]:
    stop = GO + 20.0
    course = [{"t": GO, "speed": speed}, {"t": stop, "speed": 0.0}]
    return [ride(budget, seed, (stop, stop + 10.0), course) for seed in budget.each_seed()]


def _off(figures: Figures, speed: float) -> float:
    return max(figures["ride_max"] - speed, speed - figures["ride_min"])


def _still() -> Row:
    def trials(budget: Budget, _: float) -> list[Trial]:
        rest = [{"t": GO, "speed": 0.0}]
        return [ride(budget, seed, (GO, GO + HELD), rest) for seed in budget.each_seed()]

    return Row(
        "segway.still",
        f"way in {HELD:g} s of standing on it",
        "m",
        0.5,
        (0.0,),
        trials,
        figure=lambda figures, _: figures["ride_drift"],
        at_least=False,
    )


def _turn() -> Row:
    def trials(budget: Budget, rate: float) -> list[Trial]:
        return [
            ride(
                budget,
                seed,
                (GO + 12.0, GO + 22.0),
                [{"t": GO, "speed": 1.0}, {"t": GO + 6.0, "turn": rate if seed % 2 else -rate}],
            )
            for seed in budget.each_seed()
        ]

    return Row(
        "segway.turn",
        "turn rate at 1 m/s",
        "rad/s",
        0.8,
        (_TURN,),
        trials,
        holds=lambda figures, _: abs(figures["vx"] - 1.0) <= 0.2,
        figure=lambda figures, _: abs(figures["yaw_rate"]),
    )


def _slalom() -> Row:
    begin, end = GO + 7.0, GO + 30.0

    def trials(budget: Budget, speed: float) -> list[Trial]:
        gates: dict[str, Any] = {"t": begin, "gates": {"count": 10}}
        course = [{"t": GO, "speed": speed}, gates]
        return [ride(budget, seed, (begin, end), course) for seed in budget.each_seed()]

    return Row(
        "segway.slalom",
        "distance from the middle of ten gates 3 m apart, 0.2 m to a side, at 2 m/s",
        "m",
        GATE,
        (2.0,),
        trials,
        figure=lambda figures, _: figures["gate_miss"],
        at_least=False,
    )


def _push() -> Row:
    begin = GO + 9.0

    def trials(budget: Budget, impulse: float) -> list[Trial]:
        return [
            ride(
                budget,
                seed,
                (begin + 6.0, begin + 8.0),
                [{"t": GO, "speed": 2.0}],
                pushes=[push(begin, impulse, 45.0 * (seed - 1))],
            )
            for seed in budget.each_seed()
        ]

    return Row(
        "segway.push",
        "push at 2 m/s, each robot from another of eight directions",
        "Ns",
        8.0,
        [4.0, 6.0, 8.0, 10.0, 12.0],
        trials,
        holds=lambda figures, _: abs(figures["vx"] - 2.0) <= 0.5,
        start=2,
    )


def _alone() -> Row:
    def trials(budget: Budget, speed: float) -> list[Trial]:
        go = [{"t": GO, "vx": speed}]
        window = (GO + 10.0, GO + 40.0)
        return [ride(budget, seed, window, [], then=go) for seed in budget.each_seed()]

    return Row(
        "segway.alone",
        "greatest error of 2 m/s in 30 s by its own estimate, nobody leaning",
        "m/s",
        1.0,
        (2.0,),
        trials,
        figure=_off,
        at_least=False,
    )


def _leans() -> Row:
    end = GO + 300.0

    def trials(budget: Budget, _: float) -> list[Trial]:
        return [
            ride(budget, seed, (end - 1.0, end), [], then=leans(seed, GO, end))
            for seed in budget.each_seed()
        ]

    return Row(
        "segway.leans",
        "robots that bear random leans and heights on it for 5 min",
        "%",
        100.0,
        (0.0,),
        trials,
        counts=True,
    )


def leans(seed: int, begin: float, end: float) -> list[dict[str, Any]]:
    """Operator steps that lean anywhere the message permits, from one moment to another, in s."""
    rng = Stream.LEANS.rng(seed)
    steps: list[dict[str, Any]] = []
    time = begin
    while time < end:
        step = {name: round(float(rng.uniform(-most, most)), 3) for name, most in _LEANS.items()}
        step["height"] = round(float(rng.uniform(*_HEIGHTS)), 3)
        steps.append({"t": round(time, 3), **step})
        time += float(rng.uniform(0.3, 4.0))
    return steps
