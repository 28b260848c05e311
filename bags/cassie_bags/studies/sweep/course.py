"""Runs of sweeps: stand up, walk, and then follow the commands of a row."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from cassie_bags.studies.trial import Trial
from cassie_control.supervisor.config import SupervisorConfig

_WALK_AT = 2.0  # s, time of the command to walk; walking begins about a second later

COMMAND_AT = 5.0
"""Time of the commanded speeds. In s."""

SETTLING = 5.0
"""Time between reaching a speed and measuring. In s."""

PUSH_TIME = 0.1
"""Duration of a push. In s."""

PAPER_LAW = f"@{Path(__file__).with_name('paper_law.yaml')}"
"""Change to the paper's own law, with drive gains with which the robot walks."""

_WITHOUT_LEARNED = "controller.learned_torques=none"
_LIMITS = SupervisorConfig()


@dataclass(frozen=True)
class Budget:
    """Extent of the runs.

    Attributes:
        seeds: Number of robots for each setting.
        phases: Number of times within two steps at which events happen.
        seconds: Length of the part over which speeds are measured. In s.
        beyond: Number of levels to try after one that meets the target; None: until one does not
            hold.
        changes: `key=value` words for every run.
        first: Seed of the first robot; the others have the seeds that follow.
    """

    seeds: int = 10
    phases: int = 10
    seconds: float = 40.0
    beyond: int | None = None
    changes: tuple[str, ...] = ()
    first: int = 1

    def each_phase(self, speed: float) -> list[tuple[float, int]]:
        """Delays that are spread over two steps at a speed (s), each with a seed."""
        stride = 2.0 * step_time(speed)
        return [
            (stride * index / self.phases, self.first + index % self.seeds)
            for index in range(self.phases)
        ]


@cache
def step_time(speed: float) -> float:
    """Nominal duration of a step. In s."""
    from cassie_gaits.gait_library_file import default_library_path, load_library  # loads Numba

    return load_library(default_library_path()).interpolate(speed)[2]


def reached_at(speed: float) -> float:
    """Time at which the commanded speed has risen to `speed` (m/s). In s."""
    return COMMAND_AT + abs(speed) / _LIMITS.acceleration


def walk(
    seed: int,
    window: tuple[float, float],
    vx: float | None = None,
    vy: float | None = None,
    yaw_rate: float | None = None,
    *,
    changes: tuple[str, ...] = (),
    then: Sequence[Mapping[str, Any]] = (),
    ahead: float | None = None,
    **sections: Any,
) -> Trial:
    """Trial of walking as commanded from `COMMAND_AT` to the end of the window.

    Args:
        seed: Seed of the robot.
        window: Part to measure. In s.
        vx, vy, yaw_rate: Commanded speeds; without any, the robot steps in place. In m/s and rad/s.
        changes, ahead: See `Trial`.
        then: Further steps of the operator.
        sections: Other sections of the experiment.
    """
    speeds = {"vx": vx, "vy": vy, "yaw_rate": yaw_rate}
    command = {name: speed for name, speed in speeds.items() if speed is not None}
    operator: list[dict[str, Any]] = [
        {"t": 0.0, "power": True, "mode": "stand", "height": _LIMITS.walk_height},
        {"t": _WALK_AT, "mode": "walk"},
    ]
    if command:
        operator.append({"t": COMMAND_AT, **command})
    operator += [dict(step) for step in then]
    content: dict[str, Any] = {
        "start": "standing",
        "duration": window[1],
        "operator": operator,
        "supervisor": opened_limits(command),
        **sections,
    }
    return Trial(content, seed, window, ahead, changes)


def comparison(seed: int, speed: float, seconds: float, changes: tuple[str, ...]) -> Trial:
    """Trial of walking at a speed with learned torques and, as second run, without.

    Args:
        seed: Seed of the robot.
        speed: Commanded speed. In m/s.
        seconds: Measured time. In s.
        changes: `key=value` words for both runs.
    """
    window, learned = steady(speed, seconds), {"learned_torques": "use"}
    trial = walk(seed, window, vx=speed, changes=changes, controller=learned)
    return dataclasses.replace(trial, reference=(_WITHOUT_LEARNED,))


def opened_limits(command: Mapping[str, float]) -> dict[str, float]:
    """Limits of the supervisor that let a command pass where the default limits do not."""
    vx = command.get("vx", 0.0)
    needed = {
        "vx_forward": max(vx, 0.0),
        "vx_backward": max(-vx, 0.0),
        "vy_limit": abs(command.get("vy", 0.0)),
        "yaw_rate_limit": abs(command.get("yaw_rate", 0.0)),
    }
    return {name: value for name, value in needed.items() if value > getattr(_LIMITS, name)}


def steady(speed: float, seconds: float) -> tuple[float, float]:
    """The window in which a commanded speed (m/s) is measured for a time. In s."""
    start = reached_at(speed) + SETTLING
    return start, start + seconds


def push(
    time: float, impulse: float, angle_deg: float, duration: float = PUSH_TIME
) -> dict[str, Any]:
    """A push on the pelvis.

    Args:
        time: Start of the push. In s.
        impulse: Impulse of the push. In Ns.
        angle_deg: Direction of the force, from ahead to the left. In deg.
        duration: Duration of the push. In s.
    """
    force, angle = impulse / duration, math.radians(angle_deg)
    return {
        "t": time,
        "duration": duration,
        "force": [force * math.cos(angle), force * math.sin(angle), 0.0],
    }
