"""Learning of feed-forward torques over repeated steps, in process: runs, comparison, picture."""

from __future__ import annotations

import argparse
import contextlib
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

from cassie_bags.bag.rows import FloatArray
from cassie_bags.errors import ExperimentError
from cassie_bags.report.figures import BLUE, GREY, drawing
from cassie_bags.report.plain import aligned
from cassie_bags.run.cores import connect, load_learned, make_cores, tick_count
from cassie_bags.run.progress import progress_bar
from cassie_bags.run.provenance import versions
from cassie_bags.run.yaml_file import consistent
from cassie_bags.signals.window import TRACKING
from cassie_bags.studies.run_trial import CHECK_TICKS, experiment_of, has_fallen, run_trial
from cassie_bags.studies.sweep.course import Budget, comparison, steady, walk
from cassie_bags.studies.trial import Measures
from cassie_bags.studies.workers import Workers, all_results, workers
from cassie_control.learning.torque_table import (
    JOINTS,
    SPEEDS,
    LearnedTorques,
    load_torques,
    path_for_library,
    save_torques,
    zero_torques,
)
from cassie_gaits.gait_library import OUTPUTS, Provenance
from cassie_gaits.gait_library_file import default_library_path

LEARNING = "controller.learned_torques=learn"

HELD_OUT_FROM = 1001
"""First seed of the robots that are not used for learning."""

COMPARED = 8.0
"""Measured part of the runs of the comparison. In s."""

FILE = path_for_library(default_library_path()).name

_LENGTHS = ("stance_leg_length", "swing_leg_length")


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
        if tick % CHECK_TICKS == 0 and has_fallen(cores.plant):
            return LearningResult(run.speed, before, learning.taught, True)
    return LearningResult(run.speed, learning.torques[0], learning.taught, False)


def learning_runs(
    learned: LearnedTorques, seeds: Sequence[int], seconds: float, changes: tuple[str, ...]
) -> list[LearningRun]:
    """Learning runs, one for each robot at each speed of the table.

    Args:
        learned: Torques learned before.
        seeds: Seeds of the robots.
        seconds: Time of learning. In s.
        changes: `key=value` words for each run.
    """
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
    both = [r for r in results if not (r["fell"] or r["reference_fell"])]

    def rms(name: str) -> float:
        return math.sqrt(sum(r[name] ** 2 for r in both) / len(both)) if both else math.nan

    return Comparison(
        speed,
        np.array([rms(f"reference_{name}") for name in TRACKING]),
        np.array([rms(name) for name in TRACKING]),
        rms("reference_tracking"),
        rms("tracking"),
        sum(int(r["reference_fell"]) for r in results),
        sum(int(r["fell"]) for r in results),
        len(results),
    )


def run(arguments: argparse.Namespace) -> int:
    """Learn, and compare on held-out robots; returns the exit code."""
    learned = _begin(arguments)
    arguments.out.mkdir(parents=True, exist_ok=True)
    with contextlib.closing(workers(arguments.jobs, arguments.scheduler)) as pool:
        learned = _learn(learned, arguments, pool)
        file = arguments.out / FILE
        save_torques(learned, file)
        comparisons = _compare(learned, file, arguments, pool)
    print(table(comparisons))
    _draw(arguments.out / "learn_torques.png", learned, comparisons)
    print(f"kept in {file}; use it with --set controller.learned_torques_file={file}")
    worse = any(
        c.fell_after > c.fell_before or not c.total_after < c.total_before for c in comparisons
    )
    return 1 if worse else 0


def table(comparisons: Sequence[Comparison]) -> str:
    """Table of the errors without and with learned torques, and of their ratio, by speed."""
    lines = [["m/s", "fell", "all nine", "left", *(name.replace("_", " ") for name in OUTPUTS)]]
    for c in comparisons:
        lines.append(
            [
                f"{c.speed:g}",
                f"{c.fell_before} > {c.fell_after} of {c.runs}",
                f"{c.total_before:.4f} > {c.total_after:.4f}",
                f"{100.0 * c.total_after / c.total_before:.0f} %",
                *(f"{100.0 * share:.0f} %" for share in c.after / c.before),
            ]
        )
    title = "RMS tracking without > with learned torques, and what is left of it, of each output"
    return "\n".join([title, *aligned(lines, left=0)])


def _begin(arguments: argparse.Namespace) -> LearnedTorques:
    """Torques from which learning begins; arguments that cannot be run are refused here."""
    experiment = experiment_of(walk(Budget(changes=consistent(arguments.set)), 1, (0.0, 1.0)))
    load_learned(experiment)
    if arguments.begin is not None:
        return load_torques(arguments.begin)
    speeds = tuple(sorted(set(arguments.speeds or SPEEDS)))
    for speed in speeds:
        if not -1.0 <= speed <= 2.0:
            raise ExperimentError(f"--speeds {speed:g} is outside -1 .. 2 m/s")
    return zero_torques(speeds)


def _learn(learned: LearnedTorques, arguments: argparse.Namespace, pool: Workers) -> LearnedTorques:
    """Rounds of learning; each robot of a round begins with the mean of the last round."""
    seeds = range(1, arguments.seeds + 1)
    changes = tuple(arguments.set)
    print(f"learning by robots of seeds 1 to {arguments.seeds}", file=sys.stderr)
    total = arguments.rounds * arguments.seeds * len(learned.speeds)
    with progress_bar("run", total) as bar:
        for number in range(1, arguments.rounds + 1):
            lessons = learning_runs(learned, seeds, arguments.seconds, changes)
            outcomes = all_results(pool, learn, lessons, bar)
            learned = merged(learned, outcomes)
            steps = sum(o.taught for o in outcomes)
            fell = ", ".join(f"{o.speed:g} m/s" for o in outcomes if o.fell) or "none"
            text = f"round {number} of {arguments.rounds}: {steps} steps; fell: {fell}"
            bar.write(text, file=sys.stderr)
    settings = {
        "seeds": list(seeds),
        "rounds": arguments.rounds,
        "seconds": arguments.seconds,
        "changes": list(changes),
        "begin": None if arguments.begin is None else str(arguments.begin.name),
        "versions": versions(),
    }
    today = arguments.now.date().isoformat()
    origin = Provenance("cassie_bags.learn_torques", "1", today, settings)
    return LearnedTorques(learned.speeds, learned.torques, origin)


def _compare(
    learned: LearnedTorques, file: Path, arguments: argparse.Namespace, pool: Workers
) -> list[Comparison]:
    """Comparison at every speed by held-out robots, with and without learned torques."""
    seeds = range(HELD_OUT_FROM, HELD_OUT_FROM + arguments.held_out)
    changes = (*arguments.set, f"controller.learned_torques_file={file.resolve()}")
    trials = [
        comparison(seed, speed, COMPARED, changes)
        for speed in learned.speeds.tolist()
        for seed in seeds
    ]
    with progress_bar("run", len(trials)) as bar:
        results = all_results(pool, run_trial, trials, bar)
    count = len(seeds)
    return [
        compared(speed, results[n * count : (n + 1) * count])
        for n, speed in enumerate(learned.speeds.tolist())
    ]


def _draw(path: Path, learned: LearnedTorques, comparisons: Sequence[Comparison]) -> None:
    """Draw the RMS error of each output without and with torques, above the torques by phase.

    Args:
        path: PNG file.
        learned: The torques.
        comparisons: Errors at each speed.
    """
    with drawing(path, 11.0, 7.5) as figure:
        parts: Any = figure.subfigures(2, 1)
        _draw_errors(parts[0], comparisons)
        _draw_torques(parts[1], learned)


def _draw_errors(figure: Any, comparisons: Sequence[Comparison]) -> None:
    axes = figure.subplots(1, len(OUTPUTS))
    places = np.arange(len(comparisons))
    for row, (name, plot) in enumerate(zip(OUTPUTS, axes, strict=True)):
        for offset, colour, label, values in (
            (-0.2, GREY, "without", [c.before[row] for c in comparisons]),
            (0.2, BLUE, "learned", [c.after[row] for c in comparisons]),
        ):
            plot.bar(places + offset, 1e3 * np.array(values), 0.4, color=colour, label=label)
        unit = "mm" if name in _LENGTHS else "mrad"
        plot.set_title(f"{name.replace('_', ' ')}\n{unit}", fontsize=8)
        plot.set_xticks(places, [f"{c.speed:g}" for c in comparisons], rotation=90, fontsize=7)
        plot.tick_params(labelsize=7)
    axes[0].legend(fontsize=7, loc="upper left")
    axes[0].set_xlabel("speed in m/s", fontsize=7)


def _draw_torques(figure: Any, learned: LearnedTorques) -> None:
    axes = figure.subplots(2, 5, sharex=True)
    phases = np.linspace(0.0, 1.0, learned.torques.shape[2])
    colours = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.9, len(learned.speeds)))
    for joint, plot in enumerate(axes.flat):
        for speed, colour, torque in zip(
            learned.speeds.tolist(), colours, learned.torques[:, joint], strict=True
        ):
            plot.plot(phases, torque, color=colour, label=f"{speed:g} m/s")
        plot.set_title(f"{JOINTS[joint].replace('_', ' ')}, Nm", fontsize=8)
        plot.tick_params(labelsize=7)
    axes[0, 4].legend(fontsize=6, ncols=2, loc="upper left")
    axes[1, 0].set_xlabel("phase", fontsize=7)
