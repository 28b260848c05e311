"""Learning of feed-forward torques from a command line: rounds, comparison, table, picture."""

from __future__ import annotations

import argparse
import contextlib
import datetime
import sys
from collections.abc import Sequence
from pathlib import Path

from tqdm import tqdm

from cassie_bags.errors import ExperimentError
from cassie_bags.run.cores import load_learned
from cassie_bags.run.provenance import versions
from cassie_bags.run.yaml_file import consistent
from cassie_bags.studies.learn import (
    Comparison,
    compared,
    comparisons,
    learn,
    learning_runs,
    merged,
)
from cassie_bags.studies.learn_picture import draw
from cassie_bags.studies.run_trial import experiment_of, run_trial
from cassie_bags.studies.sweep.course import Budget, walk
from cassie_bags.studies.workers import Workers, workers
from cassie_control.learning.torque_table import (
    SPEEDS,
    LearnedTorques,
    load_torques,
    path_for_library,
    save_torques,
    zero_torques,
)
from cassie_gaits.gait_library import OUTPUTS, Provenance
from cassie_gaits.gait_library_file import default_library_path

HELD_OUT_FROM = 1001
"""First seed of the robots that are not used for learning."""

FILE = path_for_library(default_library_path()).name


def run(arguments: argparse.Namespace) -> int:
    """Learn, and compare on held-out robots; returns the exit code."""
    learned = _begin(arguments)
    arguments.out.mkdir(parents=True, exist_ok=True)
    with contextlib.closing(workers(arguments.jobs, arguments.scheduler)) as pool:
        learned = _learn(learned, arguments, pool)
        file = arguments.out / FILE
        save_torques(learned, file)
        found = _compare(learned, file, arguments, pool)
    print(table(found))
    draw(arguments.out / "learn_torques.png", learned, found)
    print(f"kept in {file}; use it with --set controller.learned_torques_file={file}")
    worse = any(c.fell_after > c.fell_before or not c.total_after < c.total_before for c in found)
    return 1 if worse else 0


def table(found: Sequence[Comparison]) -> str:
    """Table of the errors without and with learned torques, and of their ratio, by speed."""
    head = ["m/s", "fell", "all nine", "left", *(name.replace("_", " ") for name in OUTPUTS)]
    lines = [head]
    for c in found:
        lines.append(
            [
                f"{c.speed:g}",
                f"{c.fell_before} > {c.fell_after} of {c.runs}",
                f"{c.total_before:.4f} > {c.total_after:.4f}",
                f"{100.0 * c.total_after / c.total_before:.0f} %",
                *(f"{100.0 * share:.0f} %" for share in c.after / c.before),
            ]
        )
    widths = [max(len(line[i]) for line in lines) for i in range(len(head))]
    rows = ["  ".join(map(str.rjust, line, widths)) for line in lines]
    title = "RMS tracking without > with learned torques, and what is left of it, of each output"
    return "\n".join([title, *rows])


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
    with tqdm(total=total, unit="run", disable=not sys.stderr.isatty(), leave=False) as bar:
        for number in range(1, arguments.rounds + 1):
            outcomes = []
            round_ = learning_runs(learned, seeds, arguments.seconds, changes)
            for _, outcome in pool.results(learn, round_):
                outcomes.append(outcome)
                bar.update()
            learned = merged(learned, outcomes)
            steps = sum(o.taught for o in outcomes)
            fell = ", ".join(f"{o.speed:g} m/s" for o in outcomes if o.fell) or "none"
            said = f"round {number} of {arguments.rounds}: {steps} steps; fell: {fell}"
            bar.write(said, file=sys.stderr)
    settings = {
        "seeds": list(seeds),
        "rounds": arguments.rounds,
        "seconds": arguments.seconds,
        "changes": list(changes),
        "begin": None if arguments.begin is None else str(arguments.begin.name),
        "versions": versions(),
    }
    today = datetime.date.today().isoformat()
    origin = Provenance("cassie_bags.learn_torques", "1", today, settings)
    return LearnedTorques(learned.speeds, learned.torques, origin)


def _compare(
    learned: LearnedTorques, file: Path, arguments: argparse.Namespace, pool: Workers
) -> list[Comparison]:
    """Comparison at every speed by held-out robots, with and without learned torques."""
    seeds = range(HELD_OUT_FROM, HELD_OUT_FROM + arguments.held_out)
    changes = (*arguments.set, f"controller.learned_torques_file={file.resolve()}")
    trials = comparisons(learned, seeds, arguments.measured, changes)
    results = {}
    with tqdm(total=len(trials), unit="run", disable=not sys.stderr.isatty(), leave=False) as bar:
        for index, measures in pool.results(run_trial, trials):
            results[index] = measures
            bar.update()
    count = len(seeds)
    return [
        compared(speed, [results[i] for i in range(n * count, (n + 1) * count)])
        for n, speed in enumerate(learned.speeds.tolist())
    ]
