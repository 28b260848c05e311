"""Learning of feed-forward torques over repeated steps, in process: runs, comparison, picture."""

from __future__ import annotations

import argparse
import contextlib
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice, product
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
from cassie_bags.studies.sweep.course import comparison, steady, walk
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

_COMPARED = 8.0  # s, measured part of the runs of the comparison

FILE = path_for_library(default_library_path()).name

_LENGTHS = ("stance_leg_length", "swing_leg_length")


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


def learn(
    robot: tuple[float, int], learned: LearnedTorques, seconds: float, changes: Sequence[str]
) -> LearningResult:
    """Walk and learn until the end of the run or a fall.

    Torques learned at the robot's speed hold for every speed here. If they varied with the measured
    speed, they would disturb the walk while those of other speeds are not learned yet.

    Args:
        robot: Walking speed, one of the table's (m/s), and seed of the robot.
        learned: Torques learned before.
        seconds: Time of learning. In s.
        changes: `key=value` words for the run.
    """
    speed, seed = robot
    trial = walk(seed, steady(speed, seconds), vx=speed, changes=(*changes, LEARNING))
    experiment = experiment_of(trial)
    cores = make_cores(experiment)
    learning = cores.controller.learning
    before = learned.torques[learned.speeds.tolist().index(speed)]
    learning.begin(LearnedTorques(np.array([speed]), before[None]))
    loop = connect(cores, lambda topic, raw, stamp: None)
    for tick in range(tick_count(experiment)):
        loop.tick()
        if tick % CHECK_TICKS == 0 and has_fallen(cores.plant):
            return LearningResult(speed, before, learning.taught, True)
    return LearningResult(speed, learning.torques[0], learning.taught, False)


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
    """Measures of `comparison` at a speed, in m/s, by each held-out robot.

    "reference_" begins the names of those without learned torques.
    """

    speed: float
    results: Sequence[Measures]

    def rms(self, name: str) -> float:
        """RMS of a measure over the robots that fell in neither run; NaN without any."""
        both = [r[name] for r in self.results if not (r["fell"] or r["reference_fell"])]
        return math.sqrt(sum(error**2 for error in both) / len(both)) if both else math.nan

    def falls(self, name: str) -> int:
        """Number of falls: of "fell" or "reference_fell"."""
        return sum(int(r[name]) for r in self.results)

    @property
    def worse(self) -> bool:
        """Whether learned torques bring more falls or no smaller error."""
        smaller = self.rms("tracking") < self.rms("reference_tracking")
        return self.falls("fell") > self.falls("reference_fell") or not smaller


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
    return 1 if any(comparison.worse for comparison in comparisons) else 0


def table(comparisons: Sequence[Comparison]) -> str:
    """Table of the errors without and with learned torques, and of their ratio, by speed."""
    lines = [["m/s", "fell", "all nine", "left", *(name.replace("_", " ") for name in OUTPUTS)]]
    for c in comparisons:
        before, after = c.rms("reference_tracking"), c.rms("tracking")
        lines.append(
            [
                f"{c.speed:g}",
                f"{c.falls('reference_fell')} > {c.falls('fell')} of {len(c.results)}",
                f"{before:.4f} > {after:.4f}",
                f"{100.0 * after / before:.0f} %",
                *(f"{100.0 * c.rms(n) / c.rms(f'reference_{n}'):.0f} %" for n in TRACKING),
            ]
        )
    title = "RMS tracking without > with learned torques, and what is left of it, of each output"
    return "\n".join([title, *aligned(lines, left=0)])


def _begin(arguments: argparse.Namespace) -> LearnedTorques:
    """Torques from which learning begins; arguments that cannot be run are refused here."""
    load_learned(experiment_of(walk(1, (0.0, 1.0), changes=consistent(arguments.set))))
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
    print(f"learning by robots of seeds 1 to {arguments.seeds}", file=sys.stderr)
    total = arguments.rounds * arguments.seeds * len(learned.speeds)
    with progress_bar("run", total) as bar:
        for number in range(1, arguments.rounds + 1):
            lesson = partial(
                learn, learned=learned, seconds=arguments.seconds, changes=arguments.set
            )
            robots = list(product(learned.speeds.tolist(), seeds))
            outcomes = all_results(pool, lesson, robots, bar)
            learned = merged(learned, outcomes)
            steps = sum(o.taught for o in outcomes)
            fell = ", ".join(f"{o.speed:g} m/s" for o in outcomes if o.fell) or "none"
            text = f"round {number} of {arguments.rounds}: {steps} steps; fell: {fell}"
            bar.write(text, file=sys.stderr)
    settings = {
        "seeds": list(seeds),
        "rounds": arguments.rounds,
        "seconds": arguments.seconds,
        "changes": arguments.set,
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
    speeds = learned.speeds.tolist()
    trials = [comparison(seed, speed, _COMPARED, changes) for speed, seed in product(speeds, seeds)]
    with progress_bar("run", len(trials)) as bar:
        results = iter(all_results(pool, run_trial, trials, bar))
    return [Comparison(speed, list(islice(results, len(seeds)))) for speed in speeds]


def _draw(path: Path, learned: LearnedTorques, comparisons: Sequence[Comparison]) -> None:
    """Draw the RMS error of each output without and with torques, above the torques by phase."""
    with drawing(path, 11.0, 7.5) as figure:
        parts: Any = figure.subfigures(2, 1)
        _draw_errors(parts[0], comparisons)
        _draw_torques(parts[1], learned)


def _draw_errors(figure: Any, comparisons: Sequence[Comparison]) -> None:
    axes = figure.subplots(1, len(OUTPUTS))
    places = np.arange(len(comparisons))
    for row, (name, plot) in enumerate(zip(OUTPUTS, axes, strict=True)):
        for offset, colour, label, prefix in (
            (-0.2, GREY, "without", "reference_"),
            (0.2, BLUE, "learned", ""),
        ):
            errors = [1e3 * c.rms(prefix + TRACKING[row]) for c in comparisons]
            plot.bar(places + offset, errors, 0.4, color=colour, label=label)
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
