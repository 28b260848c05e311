"""The runs that sweeps are made of: stand up, walk, and then what is asked for."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cassie_bags.studies.trial import Trial
from cassie_control.supervisor.config import SupervisorConfig

WALK_AT = 2.0
"""When walking is asked for; it begins about a second later. In s."""

COMMAND_AT = 5.0
"""When speeds are asked for. In s."""

SETTLING = 5.0
"""Time between reaching a speed and measuring. In s."""

PUSH_TIME = 0.1
"""How long a push lasts. In s."""

AFTER_EVENT = 6.0
"""Time in which the robot must not fall after a push. In s."""

PAPER_LAW = f"@{Path(__file__).with_name('paper_law.yaml')}"
"""Change to the paper's own law, with gains of the drives with which it walks."""

_WITHOUT_LEARNED = "controller.learned_torques=none"
_LIMITS = SupervisorConfig()


@dataclass(frozen=True)
class Budget:
    """How much to run.

    Attributes:
        seeds: Robots that each setting is tried on: those of seeds 1 to this.
        phases: Moments over two steps at which events are tried.
        seconds: Length of the part that speeds are measured over. In s.
        beyond: Levels tried beyond one whose figure meets the target; None: until one does not
            hold.
        changes: `key=value` words for every run.
    """

    seeds: int = 10
    phases: int = 10
    seconds: float = 40.0
    beyond: int | None = None
    changes: tuple[str, ...] = ()

    def each_seed(self) -> range:
        """The seeds."""
        return range(1, self.seeds + 1)

    def each_phase(self, speed: float) -> list[tuple[float, int]]:
        """Delays that spread over two steps at a speed (s), each with a seed."""
        stride = 2.0 * step_time(speed)
        return [
            (stride * index / self.phases, 1 + index % self.seeds) for index in range(self.phases)
        ]


Trials = Callable[[Budget, float], list[Trial]]
"""Trials of a level."""


def robots(trial: Callable[[Budget, int, float], Trial]) -> Trials:
    """One trial for each robot.

    Args:
        trial: Makes it from budget, seed and level.
    """
    return lambda budget, level: [trial(budget, seed, level) for seed in budget.each_seed()]


def mirrored(seed: int, value: float) -> float:
    """A value to the left for robots with odd seeds, to the right for the others."""
    return value if seed % 2 else -value


def tenths(first: int, last: int) -> list[float]:
    """Levels in steps of 0.1, as a person writes them: 1.2 and not 1.2000000000000002."""
    return [n / 10 for n in range(first, last + 1)]


def step_time(speed: float) -> float:
    """Nominal duration of a step. In s."""
    from cassie_gaits.gait_library_file import default_library_path, load_library  # loads Numba

    return load_library(default_library_path()).interpolate(speed)[2]


def reached_at(speed: float) -> float:
    """When the commanded speed has come up to `speed` (m/s). In s."""
    return COMMAND_AT + abs(speed) / _LIMITS.acceleration


def walk(budget: Budget, seed: int, window: tuple[float, float], **commanded: Any) -> Trial:
    """Walking as commanded from `COMMAND_AT` to the end of the window.

    Args:
        budget: How much to run.
        seed: Robot.
        window: Part to measure. In s.
        command: vx, vy, yaw_rate of the operator; other words are sections of the experiment,
            `ahead` and `kept` are the trial's.
    """
    ahead, kept = commanded.pop("ahead", None), commanded.pop("kept", None)
    command: dict[str, float] = {
        key: commanded.pop(key) for key in ("vx", "vy", "yaw_rate") if key in commanded
    }
    operator: list[dict[str, Any]] = [
        {"t": 0.0, "power": True, "mode": "stand", "height": _LIMITS.walk_height},
        {"t": WALK_AT, "mode": "walk"},
    ]
    if command:
        operator.append({"t": COMMAND_AT, **command})
    operator += commanded.pop("then", [])
    content: dict[str, Any] = {
        "start": "standing",
        "duration": window[1],
        "operator": operator,
        "supervisor": opened_limits(command),
        **commanded,
    }
    return Trial(content, seed, window, ahead, budget.changes, kept=kept)


def comparison(seed: int, speed: float, seconds: float, changes: tuple[str, ...]) -> Trial:
    """Walking at a speed with learned torques and, beside, without."""
    window = steady(Budget(), speed, seconds)
    trial = walk(Budget(changes=changes), seed, window, vx=speed)
    return Trial(trial.content, seed, window, None, trial.changes, (_WITHOUT_LEARNED,))


def opened_limits(command: Mapping[str, float]) -> dict[str, float]:
    """Limits of the supervisor that let a command pass, where the usual ones would not."""
    vx = command.get("vx", 0.0)
    needed = {
        "vx_forward": max(vx, 0.0),
        "vx_backward": max(-vx, 0.0),
        "vy_limit": abs(command.get("vy", 0.0)),
        "yaw_rate_limit": abs(command.get("yaw_rate", 0.0)),
    }
    return {name: value for name, value in needed.items() if value > getattr(_LIMITS, name)}


def steady(budget: Budget, speed: float, seconds: float | None = None) -> tuple[float, float]:
    """The window in which a commanded speed is measured. In s."""
    start = reached_at(speed) + SETTLING
    return start, start + (budget.seconds if seconds is None else seconds)


def push(
    time: float, impulse: float, angle_deg: float, duration: float = PUSH_TIME
) -> dict[str, Any]:
    """A push on the pelvis.

    Args:
        time: When it begins. In s.
        impulse: In Ns.
        angle_deg: Direction of the force from ahead, to the left. In deg.
        duration: In s.
    """
    force, angle = impulse / duration, math.radians(angle_deg)
    return {
        "t": time,
        "duration": duration,
        "force": [force * math.cos(angle), force * math.sin(angle), 0.0],
    }
