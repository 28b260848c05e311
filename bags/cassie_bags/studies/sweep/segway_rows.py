"""Rows of riding a Segway: speed, braking, rest, turns, a slalom, pushes, random leans."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from cassie_bags.studies.sweep.course import Budget, Trials, mirrored, push, robots
from cassie_bags.studies.sweep.random_commands import riding_commands
from cassie_bags.studies.sweep.row import Row, at_most, counted
from cassie_bags.studies.trial import Measures, Trial
from cassie_gaits.robot import WEIGHT

LET_GO = 10.0
"""Time at which the operator lets go of the Segway; the rider begins a second later. In s."""

GO = 16.0
"""Time at which the rider starts; before, the rider finds at rest how the robot stands. In s."""

TOP = 4.0
HELD = 60.0
GATE = 0.15
"""Distance from the middle of a gate: the Segway, 0.55 m wide, passes a gate of 0.85 m. In m."""

STEADY = 0.2
"""Largest error of a held speed. In m/s."""

NOMINAL = (600.0, 80.0)
"""The paper's gains of one foot, in Nm/m and Nms/m."""

QUIET = 0.5
"""Largest RMS of the platform's pitch with gains of the feet. In deg."""

_WATCHED = 12.0  # s after the operator has let go
_TURN = 0.82  # rad/s, commanded; the achieved rate may be some per cent less


def ride(
    budget: Budget,
    seed: int,
    window: tuple[float, float],
    targets: list[dict[str, Any]],
    *,
    surface: str = "sidewalk",
    softness: float | None = None,
    then: Sequence[Mapping[str, Any]] = (),
    **sections: Any,
) -> Trial:
    """Trial: Cassie is let down onto a Segway, crouches, and rides until the end of the window.

    Args:
        budget: Extent of the runs.
        seed: Seed of the robot, and of the rider's errors.
        window: Part to measure. In s.
        targets: Targets of the rider from `GO` on; if empty, there is no rider.
        surface: Surface of the ground.
        softness: Softness of the platform by the nominal one; None: the nominal one.
        then: Further steps of the operator.
        sections: Other sections of the experiment.
    """
    scene: dict[str, Any] = {"let_go": LET_GO, "surface": surface}
    if softness is not None:
        scene["softness"] = softness
    operator: list[dict[str, Any]] = [
        {"t": 0.0, "power": True, "mode": "stand", "height": 0.65},
        {"t": 5.0, "mode": "segway"},
        *map(dict, then),
    ]
    content: dict[str, Any] = {
        "scene": "segway",
        "scene_parameters": scene,
        "start": "gantry",
        "duration": window[1],
        "gantry": [
            {"t": 0.02, "action": "hold", "height": 1.35, "speed": 1.0},
            {"t": 1.0, "action": "lower", "height": 0.785, "speed": 0.3},
        ],
        "operator": operator,
        **sections,
    }
    if targets:
        start = {"t": LET_GO + 1.0, "speed": 0.0, "heading": 0.0}
        content["rider"] = {"seed": seed, "targets": [start, *targets]}
    return Trial(content, seed, window, None, budget.changes)


def segway_rows() -> list[Row]:
    """All rows of this module."""
    return [
        at_most(
            "segway.speed",
            f"{TOP:g} m/s on a sidewalk within 10 s, greatest error in {HELD:g} s",
            "m/s",
            STEADY,
            _held("sidewalk"),
            _off,
            TOP,
        ),
        Row(
            "segway.grass",
            f"speed on grass, held within {STEADY:g} m/s for {HELD:g} s",
            "m/s",
            TOP,
            [2.0, 2.5, 3.0, 3.5, TOP],
            _held("grass"),
            holds=lambda measures, speed: _off(measures, speed) <= STEADY,
        ),
        at_most(
            "segway.brake",
            f"time to rest from {TOP:g} m/s",
            "s",
            6.0,
            robots(_brakes),
            "stop_time",
            TOP,
        ),
        at_most(
            "segway.still",
            f"way in {HELD:g} s of standing on it",
            "m",
            0.5,
            robots(_rests),
            "ride_drift",
        ),
        Row(
            "segway.turn",
            "turn rate at 1 m/s",
            "rad/s",
            0.8,
            (_TURN,),
            robots(_turns),
            holds=lambda measures, _: abs(measures["vx"] - 1.0) <= 0.2,
            figure=lambda measures, _: abs(measures["yaw_rate"]),
        ),
        at_most(
            "segway.slalom",
            "distance from the middle of ten gates 3 m apart, 0.2 m to a side, at 2 m/s",
            "m",
            GATE,
            robots(_weaves),
            "gate_miss",
            2.0,
        ),
        Row(
            "segway.push",
            "push at 2 m/s, each robot from another of eight directions",
            "Ns",
            8.0,
            [4.0, 6.0, 8.0, 10.0, 12.0],
            robots(_pushed),
            holds=lambda measures, _: abs(measures["vx"] - 2.0) <= 0.5,
        ),
        at_most(
            "segway.alone",
            "greatest error of 2 m/s in 30 s by its own estimate, nobody leaning",
            "m/s",
            1.0,
            robots(_alone),
            _off,
            2.0,
        ),
        counted(
            "segway.leans",
            "robots that bear random leans and heights on it for 5 min",
            robots(_leans),
        ),
    ]


def _held(surface: str) -> Trials:
    window = (GO + 10.0, GO + 10.0 + HELD)
    return robots(
        lambda budget, seed, speed: ride(
            budget, seed, window, [{"t": GO, "speed": speed}], surface=surface
        )
    )


def _off(measures: Measures, speed: float) -> float:
    return max(measures["ride_max"] - speed, speed - measures["ride_min"])


def _brakes(budget: Budget, seed: int, speed: float) -> Trial:
    stop = GO + 20.0
    targets = [{"t": GO, "speed": speed}, {"t": stop, "speed": 0.0}]
    return ride(budget, seed, (stop, stop + 10.0), targets)


def _rests(budget: Budget, seed: int, speed: float) -> Trial:
    return ride(budget, seed, (GO, GO + HELD), [{"t": GO, "speed": speed}])


def _turns(budget: Budget, seed: int, rate: float) -> Trial:
    targets = [{"t": GO, "speed": 1.0}, {"t": GO + 6.0, "turn": mirrored(seed, rate)}]
    return ride(budget, seed, (GO + 12.0, GO + 22.0), targets)


def _weaves(budget: Budget, seed: int, speed: float) -> Trial:
    begin = GO + 7.0
    gates: dict[str, Any] = {"t": begin, "gates": {"count": 10}}
    targets = [{"t": GO, "speed": speed}, gates]
    return ride(budget, seed, (begin, GO + 30.0), targets)


def _pushed(budget: Budget, seed: int, impulse: float) -> Trial:
    begin = GO + 9.0
    pushes = [push(begin, impulse, 45.0 * (seed - 1))]
    window = (begin + 6.0, begin + 8.0)
    return ride(budget, seed, window, [{"t": GO, "speed": 2.0}], pushes=pushes)


def _alone(budget: Budget, seed: int, speed: float) -> Trial:
    return ride(budget, seed, (GO + 10.0, GO + 40.0), [], then=[{"t": GO, "vx": speed}])


def _leans(budget: Budget, seed: int, _: float) -> Trial:
    end = GO + 300.0
    return ride(budget, seed, (end - 1.0, end), [], then=riding_commands(seed, GO, end))


def shaking_rows() -> list[Row]:
    """Rows on gains of the feet that shake a free Segway: the paper's oscillation and its cure.

    The paper's nominal gains are 600 Nm per m of CoM x and 80 Nms for each foot. With the standing
    controller the Segway oscillated; with lower gains it did not. Here both laws stand while a
    rider keeps the Segway in place, on platforms that are stiffer and softer than the nominal one.
    """
    rows = []
    for softness, title in ((0.5, "stiff"), (1.0, "nominal"), (2.0, "soft")):
        rows += [
            Row(
                f"segway_shaking.{law}_{title}",
                f"gains of the feet by the nominal ones, law of {law}, {title} platform, "
                f"pitch up to {QUIET:g} deg RMS",
                "",
                1.0,
                [0.45, 0.6, 0.8, 1.0],
                robots(_shaken(law, softness)),
                holds=lambda measures, _: measures["platform_rms"] <= QUIET,
            )
            for law in ("standing", "riding")
        ]
        rows.append(
            at_most(
                f"segway_shaking.shipped_{title}",
                f"RMS of the platform's pitch with the shipped gains, {title} platform",
                "deg",
                QUIET,
                robots(_shaken("shipped", softness)),
                "platform_rms",
                1.0,
            )
        )
    return rows


def _shaken(law: str, softness: float) -> Callable[[Budget, int, float], Trial]:
    """Trials of standing on a Segway after it is let go, with gains by the level."""

    def trial(budget: Budget, seed: int, factor: float) -> Trial:
        kd = 2.0 * factor * NOMINAL[1]
        # Both laws have a stiffness for the weight; the set gain is added to it.
        kp = max(0.0, 2.0 * factor * NOMINAL[0] - WEIGHT)
        gains = {"kp_com_x": kp, "kd_com_x": kd}
        standing = {**gains, "settled_kd_com_x": kd}
        section = {"standing": {"stand": standing}, "riding": {"segway": gains}, "shipped": {}}[law]
        made = ride(
            budget,
            seed,
            (LET_GO + 1.0, LET_GO + 1.0 + _WATCHED),
            [{"t": GO, "speed": 0.0}],
            surface="floor",
            softness=softness,
            controller=section,
        )
        if law != "standing":
            return made
        content = dict(made.content)
        content["operator"] = content["operator"][:1]  # it never rides, but leans as far and fast
        content["supervisor"] = {"com_x_limit": 0.07, "shift_rate": 0.3}
        return dataclasses.replace(made, content=content)

    return trial
