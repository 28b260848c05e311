"""Rows of standing: quiet, pushed, on other ground, with delays, and transitions to standing."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from cassie_bags.studies.sweep.course import Budget, push, robots
from cassie_bags.studies.sweep.random_commands import standing_commands
from cassie_bags.studies.sweep.row import Row, at_most, counted
from cassie_bags.studies.trial import Measures, Trial

HEIGHT = 0.9
"""Pelvis height of standing, except in rows about another height. In m."""

SETTLED = 5.0
"""Time at which the robot stands quietly after it was let down. In s."""

AROUND = {"fore": 0.0, "left": 90.0, "aft": 180.0, "right": 270.0}
"""Directions from ahead to the left. In deg."""

DIAGONAL = {"fore_left": 45.0, "aft_left": 135.0, "aft_right": 225.0, "fore_right": 315.0}
"""Diagonal directions, from ahead to the left. In deg."""

_LET_DOWN = {"t": 0.2, "height": 0.8, "speed": 0.5}
_GENTLY = {"t": 0.5, "height": 0.7, "speed": 0.3}
_STILL = 0.02  # m/s
_LASTS = 7.5  # ratio to the budget's measured seconds: five minutes for the default of 40 s
_AFTER = 8.0  # s after an event until the robot is at rest
_SHAKES = 0.02  # m/s, largest speed of the pelvis with delayed commands
_NEAR = 0.015  # m, largest error of a reached height
_LATE = {"torque": 0.002, "set_point": 0.015}


def stand(
    budget: Budget,
    seed: int,
    end: float,
    seconds: float = 3.0,
    *,
    height: float = HEIGHT,
    then: Sequence[Mapping[str, Any]] = (),
    **sections: Any,
) -> Trial:
    """Trial of one robot that is let down from the gantry and measured at the end.

    Args:
        budget: Extent of the runs.
        seed: Seed of the robot.
        end: End of the run. In s.
        seconds: Length of the measured part at the end. In s.
        height: Pelvis height. In m.
        then: Further steps of the operator.
        sections: Other sections of the experiment.
    """
    content = {
        "start": "gantry",
        "gantry": [_LET_DOWN],
        "duration": end,
        "operator": [{"t": 0.0, "power": True, "mode": "stand", "height": height}, *then],
        **sections,
    }
    return Trial(content, seed, (end - seconds, end), None, budget.changes)


def rests(measures: Measures, _: float) -> bool:
    """Whether a robot stands still at the end, without having stepped."""
    return measures["standing"] > 0.0 and measures["end_speed"] < _STILL and not measures["stepped"]


def standing_rows() -> list[Row]:
    """All rows of this module; the long ones last."""
    around = {**AROUND, **DIAGONAL}
    return [
        _push("fore", 10.0),
        _push("aft", 9.0),
        _push("left", 18.0),
        _push("right", 18.0),
        *(_recovery(name, angle) for name, angle in around.items()),
        _height("up", "from 0.39 to 1.01 m", 0.39, 1.01),
        _height("down", "from 1.01 to 0.39 m", 1.01, 0.39),
        _block("left"),
        _block("right"),
        *(row(name, angle) for name, angle in around.items() for row in (_slope, _tilting)),
        _sinking(),
        _drop(),
        counted(
            "stand_in.boot",
            "stands up, booted with the torso hanging at 0.5 m",
            robots(_booted),
            rests,
        ),
        counted("stand_in.from_steps", "stands after stepping in place", robots(_steps), rests),
        _late(),
        _random(),
        _quiet("com_rms", "CoM about its mean, RMS,", 0.003),
        _quiet("creep", "creep of a foot", 0.005),
    ]


def _row(
    name: str,
    title: str,
    unit: str,
    target: float,
    levels: Sequence[float],
    trial: Callable[[Budget, int, float], Trial],
    **more: Any,
) -> Row:
    """A row whose figure is the hardest level at which the robot comes to rest."""
    return Row(f"stand_{name}", title, unit, target, levels, robots(trial), rests, **more)


def _push(name: str, target: float) -> Row:
    return _row(
        f"push.{name}",
        f"push stood without a step, {name}",
        "Ns",
        target,
        [float(n) for n in range(4, 25)],
        lambda budget, seed, impulse: stand(
            budget,
            seed,
            SETTLED + _AFTER,
            _AFTER,
            pushes=[push(SETTLED, impulse, AROUND[name])],
        ),
    )


def _recovery(name: str, angle: float) -> Row:
    return _row(
        f"recovery.{name}",
        f"push stood with steps, {name.replace('_', ' ')}, 9 of 10",
        "Ns",
        25.0,
        [10.0, 15.0, 20.0, 25.0, 30.0, 35.0],
        lambda budget, seed, impulse: stand(
            budget, seed, SETTLED + _AFTER + 4.0, pushes=[push(SETTLED, impulse, angle)]
        ),
        share=0.9,
    )


def _height(name: str, title: str, first: float, then: float) -> Row:
    def trial(budget: Budget, seed: int, _: float) -> Trial:
        steps = [{"t": SETTLED, "height": then}]
        return stand(budget, seed, SETTLED + 5.0, 3.0, height=first, then=steps)

    title = f"height error after 2 s {title}, held 3 s"
    trials = robots(trial)
    return at_most(f"stand_height.{name}", title, "m", _NEAR, trials, "height_off", holds=rests)


def _on(
    scene: str, parameters: Callable[[float], Mapping[str, Any]]
) -> Callable[[Budget, int, float], Trial]:
    """Trials of standing in a scene with parameters by the level."""
    return lambda budget, seed, level: stand(
        budget,
        seed,
        SETTLED + 8.0,
        3.0,
        height=0.85,
        scene=scene,
        scene_parameters=parameters(level),
        gantry=[_GENTLY],
    )


def _block(side: str) -> Row:
    return _row(
        f"block.{side}",
        f"block under the {side} foot",
        "m",
        0.1,
        [0.04, 0.06, 0.08, 0.1, 0.12, 0.14],
        _on("block", lambda height: {"height": height, "side": side}),
    )


def _slope(name: str, angle: float) -> Row:
    def parameters(slope_deg: float) -> Mapping[str, float]:
        ahead, left = _components(angle, slope_deg)
        # Ground that does not rise sideways has no slope under the feet; so it must rise a little.
        return {"rise_deg": ahead, "side_deg": left if abs(left) > 1e-3 else 1e-3}

    return _row(
        f"slope.{name}",
        f"slope that rises {name.replace('_', ' ')}, stood",
        "deg",
        12.0,
        [6.0, 9.0, 12.0, 15.0, 18.0],
        _on("slope", parameters),
    )


def _tilting(name: str, angle: float) -> Row:
    def parameters(slope_deg: float) -> Mapping[str, float]:
        ahead, left = _components(angle, slope_deg)
        rate = 5.0 * max(abs(ahead), abs(left)) / slope_deg
        return {"rise_deg": ahead, "side_deg": left, "start": SETTLED, "rate_deg": rate}

    return _row(
        f"tilting.{name}",
        f"ground that tilts at 5 deg/s, up {name.replace('_', ' ')}",
        "deg",
        10.0,
        [5.0, 10.0, 15.0, 20.0],
        _on("tilting", parameters),
    )


def _components(angle_deg: float, slope_deg: float) -> tuple[float, float]:
    """Rises ahead and to the left of a slope that rises towards an angle from ahead. In deg."""
    angle, slope = math.radians(angle_deg), math.tan(math.radians(slope_deg))
    along = (slope * math.cos(angle), slope * math.sin(angle))
    ahead, left = (math.degrees(math.atan(rise)) for rise in along)
    return ahead, left


def _sinking() -> Row:
    return _row(
        "sinking.sand",
        "depth to which sand gives way under it",
        "m",
        0.06,
        [0.02, 0.04, 0.06, 0.08, 0.1],
        _on("course", lambda depth: {"stretches": [_sand(depth)]}),
    )


def _sand(depth: float) -> Mapping[str, Any]:
    return {"surface": "sand", "sinking": depth, "length": 20.0}


def _drop() -> Row:
    def trial(budget: Budget, seed: int, fall: float) -> Trial:
        # With the legs at 0.97 m of pelvis height the soles hang 1.004 m below the pelvis.
        moves = [{"t": 0.5, "hold": 1.004 + fall, "speed": 0.3}, {"t": 2.5, "release": True}]
        return stand(budget, seed, 8.0, height=0.97, gantry=moves)

    levels = [0.02, 0.05, 0.1, 0.15, 0.2]
    return _row("drop.height", "drop out of the gantry", "m", 0.1, levels, trial)


def _booted(budget: Budget, seed: int, _: float) -> Trial:
    moves = [{"t": 0.3, "hold": 0.5, "speed": 0.5}, {"t": 4.0, "height": 0.4}]
    power = [{"t": 0.1, "power": False}, {"t": 3.0, "power": True}]
    return stand(budget, seed, 12.0, gantry=moves, then=power)


def _steps(budget: Budget, seed: int, _: float) -> Trial:
    modes = [{"t": SETTLED, "mode": "walk"}, {"t": SETTLED + 5.0, "mode": "stand"}]
    return stand(budget, seed, SETTLED + 14.0, height=0.95, then=modes)


def _late() -> Row:
    def trial(budget: Budget, seed: int, _: float) -> Trial:
        pushes = [push(SETTLED, 5.0, 45.0)]
        return stand(budget, seed, SETTLED + _AFTER, delays=_LATE, pushes=pushes)

    return counted(
        "stand_late.both",
        "stands, pushed by 5 Ns, with torques 2 ms and set-points 15 ms later",
        robots(trial),
        lambda measures, level: rests(measures, level) and measures["shaking"] < _SHAKES,
    )


def _random() -> Row:
    def trial(budget: Budget, seed: int, _: float) -> Trial:
        end = SETTLED + _LASTS * budget.seconds
        return stand(budget, seed, end, then=standing_commands(seed, SETTLED, end))

    title = "bears heights, CoM shifts and leans at random for 5 min"
    return counted("stand_random.commands", title, robots(trial))


def _quiet(name: str, title: str, target: float) -> Row:
    def trial(budget: Budget, seed: int, _: float) -> Trial:
        seconds = _LASTS * budget.seconds
        return stand(budget, seed, SETTLED + seconds, seconds)

    title = f"{title} in 5 min of quiet standing"
    return at_most(f"stand_quiet.{name}", title, "m", target, robots(trial), name)
