"""A state estimator or controller that begins anew while the robot walks, without a lost tick."""

from __future__ import annotations

import functools

import pytest

from cassie_bags.run.cores import connect, make_cores
from cassie_bags.run.experiment import read_experiment
from cassie_bags.run.seed import resolve
from cassie_bags.run.simulate import ControlLoop, Cores
from cassie_bags.studies.trial import walking_operator
from cassie_bags.studies.workers import in_copies

CORES = ("estimator", "controller")
PHASES = 20
TWO_STEPS, OBSERVED = 0.8, 4.0  # s


def ends_upright(cores: Cores, loop: ControlLoop, restart: tuple[str, int]) -> bool:
    """Whether the robot walks on; `restart` names the core that begins anew, and the phase."""
    core, phase = restart
    ticks = 1e9 / cores.plant.tick_ns
    for _ in range(round(phase / PHASES * TWO_STEPS * ticks)):
        loop.tick()
    getattr(cores, core).reset()
    for _ in range(round(OBSERVED * ticks)):
        loop.tick()
        if cores.plant.pelvis_pose[0][2] < 0.6:
            return False
    return True


@pytest.mark.parametrize(("seed", "speed"), [(1, 0.8), (2, 0.8), (8, 1.2)])
def test_it_walks_on_at_any_phase(seed: int, speed: float) -> None:
    content = {"name": "restart", "seed": seed, "duration": 20.0, "start": "standing"}
    experiment = resolve(read_experiment({**content, "operator": walking_operator(speed)}))
    cores = make_cores(experiment)
    loop = connect(cores, lambda *_: None)
    for _ in range(round(8e9 / cores.plant.tick_ns)):
        loop.tick()
    phases = range(seed % 2, PHASES, 2)
    restarts = [(core, phase) for core in CORES for phase in phases]
    upright = in_copies(functools.partial(ends_upright, cores, loop), restarts, 2)
    assert [restart for restart, good in zip(restarts, upright, strict=True) if not good] == []
