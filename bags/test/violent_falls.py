"""Violent falls, drawn from seeds: pushed over, switched off, hung up, let down, told to stand."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from cassie_bags.run.cores import connect, make_cores, tick_count
from cassie_bags.run.experiment import read_experiment
from cassie_bags.run.seed import resolve
from cassie_control.estimator.channels import CHANNELS
from cassie_msgs.experiment.file import Experiment
from cassie_msgs.layout import RobotState

FALLEN_HEIGHT = 0.5  # m, of the pelvis
HUNG, LET_DOWN = 7.0, 7.5
"""After the order to hang it up: power on, and the order to let it down. In s."""


@dataclass(frozen=True)
class FallResult:
    """What became of a fall.

    Attributes:
        fell: Whether the pelvis was below half a metre.
        lost: For how long there was no estimate. In s.
        words: What the supervisor said of that at first.
        learned: When channels last went or came back, after the order to hang it up. In s.
        mode: In the end.
        height: Of the pelvis in the end. In m.
        error: Of the estimated height in the end. In m.
        faults: In the end.
    """

    fell: bool
    lost: float
    words: str
    learned: float
    mode: str
    height: float
    error: float
    faults: tuple[str, ...]

    @property
    def stands(self) -> bool:
        """Whether it stands again as if nothing had been."""
        return (
            self.mode == "STAND"
            and abs(self.height - 0.9) < 0.02
            and abs(self.error) < 0.02
            and not self.faults
        )


def draw_fall(seed: int) -> tuple[Experiment, float]:
    """A robot that falls in its own way, and the time at which it is hung up, in s.

    It stands or walks and is pushed one to three times, with 200 to 600 N for 0.2 to 0.5 s. In six
    of ten falls the controller goes on while it lies; in half of them a channel fails for a second
    meanwhile. Power goes off one to four seconds after the first push.
    """
    draw = np.random.default_rng([seed, 19])
    operator: list[dict[str, Any]] = [{"t": 0.0, "power": True, "mode": "stand", "height": 0.95}]
    push = draw.uniform(1.5, 2.5)
    if draw.random() < 0.6:
        push = draw.uniform(4.0, 6.0)
        operator += [
            {"t": 2.2, "mode": "walk"},
            {"t": 3.4, "vx": draw.uniform(-0.4, 0.8), "yaw_rate": draw.uniform(-0.4, 0.4)},
        ]
    off = push + draw.uniform(1.0, 4.0)
    hang = off + draw.uniform(0.2, 2.0)
    content: dict[str, Any] = {
        "name": f"fall_{seed}",
        "seed": seed,
        "start": "standing",
        "duration": hang + LET_DOWN + 5.5,
        "operator": operator,
        "pushes": _pushes(draw, push),
        "gantry": [
            {"t": hang, "hold": 1.2, "speed": 0.5},
            {"t": hang + LET_DOWN, "height": 0.82, "speed": 0.2},
        ],
    }
    operator += [
        {"t": off, "power": False, "mode": "stand", "height": 0.9, "vx": 0.0, "yaw_rate": 0.0},
        {"t": hang + HUNG, "power": True},
    ]
    if draw.random() < 0.6:
        content["supervisor"] = {"fall_tilt": 1.5, "fall_height": 0.1}
    if draw.random() < 0.5:
        fault = {
            "t": push + draw.uniform(0.2, 1.2),
            "duration": 1.0,
            "channel": CHANNELS[draw.integers(len(CHANNELS))][0],
            "kind": str(draw.choice(["off", "stuck", "nan"])),
        }
        content["faults"] = [fault]
    return resolve(read_experiment(_plain(content))), hang


def _pushes(draw: np.random.Generator, first: float) -> list[dict[str, Any]]:
    pushes, t = [], first
    for _ in range(draw.integers(1, 4)):
        force, way = draw.uniform(200.0, 600.0), draw.uniform(-math.pi, math.pi)
        lift = draw.uniform(-0.3, 0.5)
        force = [force * math.cos(way), force * math.sin(way), force * lift]
        pushes.append({"t": t, "duration": draw.uniform(0.2, 0.5), "force": force})
        t += draw.uniform(0.1, 0.6)
    return pushes


def _plain(value: Any) -> Any:
    """Numbers as YAML has them."""
    if isinstance(value, dict):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_plain(entry) for entry in value]
    return value.item() if isinstance(value, np.generic) else value


def fall_and_stand(seed: int) -> FallResult:
    """What becomes of a drawn fall."""
    experiment, hang = draw_fall(seed)
    cores = make_cores(experiment)
    state, fell, lost, last, learned = RobotState(), False, 0, (), 0.0

    def observe(topic: str, raw: bytes, _: int) -> None:
        if topic == RobotState.TOPIC:
            state.load(raw)

    loop = connect(cores, observe)
    for _ in range(tick_count(experiment)):
        loop.tick()
        fell = fell or float(cores.plant.pelvis_pose[0][2]) < FALLEN_HEIGHT
        lost += not np.isfinite(state.q.sum())
        if cores.estimator.faults != last:
            last, learned = cores.estimator.faults, cores.plant.time - hang
    height = float(cores.plant.pelvis_pose[0][2])
    return FallResult(
        fell=fell,
        lost=lost * cores.plant.tick_ns * 1e-9,
        words=loop.problems.get("mode_supervisor", ("", 0.0))[0],
        learned=learned,
        mode=cores.supervisor.status.mode.name,
        height=height,
        error=float(state.q[2]) - height,
        faults=cores.supervisor.status.faults,
    )
