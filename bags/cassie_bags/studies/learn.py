"""Learning of feed-forward torques over repeated steps, in process: the runs and their results."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cassie_bags.run.cores import connect, make_cores, tick_count
from cassie_bags.studies.run_trial import TRACKING, experiment_of, has_fallen
from cassie_bags.studies.sweep.course import Budget, comparison, steady, walk
from cassie_bags.studies.trial import Measures, Trial
from cassie_control.learning.torque_table import LearnedTorques

FloatArray = npt.NDArray[np.float64]

LEARNING = "controller.learned_torques=learn"

_LOOKS = 25  # ticks between checks for a fall


@dataclass(frozen=True)
class LearningRun:
    """One robot that walks at one speed and learns.

    Attributes:
        seed: Seed of the robot.
        speed: Walking speed, one of the table's. In m/s.
        learned: Torques learned before.
        seconds: Time of learning. In s.
        changes: `key=value` words for the run.
    """

    seed: int
    speed: float
    learned: LearnedTorques
    seconds: float
    changes: tuple[str, ...] = ()


@dataclass(frozen=True)
class LearningResult:
    """Result of a learning run.

    Attributes:
        speed: Walking speed. In m/s.
        torques: Learned torques at that speed. Shape (10, n), in Nm.
        taught: Number of steps that it learned from.
        fell: Whether the robot fell; the torques are then those before the run.
    """

    speed: float
    torques: FloatArray
    taught: int
    fell: bool


def learn(run: LearningRun) -> LearningResult:
    """Walk and learn until the end of the run or a fall.

    Torques learned at the run's speed hold for every speed here. If they varied with the measured
    speed, they would disturb the walk while those of other speeds are not learned yet.
    """
    window = steady(Budget(), run.speed, run.seconds)
    changes = (*run.changes, LEARNING)
    trial = walk(Budget(changes=changes), run.seed, window, vx=run.speed)
    experiment = experiment_of(trial)
    cores = make_cores(experiment)
    learning = cores.controller.learning
    row = run.learned.speeds.tolist().index(run.speed)
    before = run.learned.torques[row]
    learning.begin(LearnedTorques(np.array([run.speed]), before[None]))
    loop = connect(cores, lambda topic, raw, stamp: None)
    for tick in range(tick_count(experiment)):
        loop.tick()
        if tick % _LOOKS == 0 and has_fallen(cores.plant):
            return LearningResult(run.speed, before, learning.taught, True)
    return LearningResult(run.speed, learning.torques[0], learning.taught, False)


def learning_runs(
    learned: LearnedTorques, seeds: Sequence[int], seconds: float, changes: tuple[str, ...]
) -> list[LearningRun]:
    """Learning runs, one for each robot at each speed of the table."""
    speeds = learned.speeds.tolist()
    return [
        LearningRun(seed, speed, learned, seconds, changes) for speed in speeds for seed in seeds
    ]


def merged(learned: LearnedTorques, outcomes: Sequence[LearningResult]) -> LearnedTorques:
    """At each speed the mean over the robots that did not fall; without any, the old torques."""
    torques = learned.torques.copy()
    for row, speed in enumerate(learned.speeds.tolist()):
        stood = [o.torques for o in outcomes if o.speed == speed and not o.fell]
        if stood:
            torques[row] = np.mean(stood, axis=0)
    return LearnedTorques(learned.speeds, torques)


def comparisons(
    learned: LearnedTorques, seeds: range, seconds: float, changes: tuple[str, ...]
) -> list[Trial]:
    """Trials at each speed by held-out robots, with learned torques and, as second run, without."""
    return [
        comparison(seed, v, seconds, changes) for v in learned.speeds.tolist() for seed in seeds
    ]


@dataclass(frozen=True)
class Comparison:
    """Tracking errors at a speed over the held-out robots.

    Attributes:
        speed: Walking speed. In m/s.
        before, after: RMS of each output without and with learned torques, over the robots that
            fell in neither run. Shape (9,), in rad and m.
        total_before, total_after: RMS of all nine outputs.
        fell_before, fell_after: Number of falls.
        runs: Number of robots.
    """

    speed: float
    before: FloatArray
    after: FloatArray
    total_before: float
    total_after: float
    fell_before: int
    fell_after: int
    runs: int


def compared(speed: float, results: Sequence[Measures]) -> Comparison:
    """Results of `comparison` at one speed, combined."""
    both = [r for r in results if not (r["fell"] or r["beside_fell"])]

    def rms(name: str) -> float:
        return math.sqrt(sum(r[name] ** 2 for r in both) / len(both)) if both else math.nan

    return Comparison(
        speed,
        np.array([rms(f"beside_{name}") for name in TRACKING]),
        np.array([rms(name) for name in TRACKING]),
        rms("beside_tracking"),
        rms("tracking"),
        sum(int(r["beside_fell"]) for r in results),
        sum(int(r["fell"]) for r in results),
        len(results),
    )
