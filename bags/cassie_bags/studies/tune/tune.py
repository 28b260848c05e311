"""Tuning from a command line: search until Ctrl-C or the last generation, then report."""

from __future__ import annotations

import argparse
import contextlib
import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import chain, islice
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from tqdm import tqdm

from cassie_bags.bag.rows import FloatArray
from cassie_bags.errors import ExperimentError
from cassie_bags.run.progress import progress_bar
from cassie_bags.run.provenance import versions
from cassie_bags.run.yaml_file import apply_changes, spelled_out
from cassie_bags.studies.tune.objective import DEFAULT, Objective, load_objective
from cassie_bags.studies.tune.search import Search
from cassie_bags.studies.tune.space import Parameter, parameters, values
from cassie_bags.studies.workers import Workers, all_results, workers
from cassie_msgs.structured import unstructure
from cassie_msgs.tunables import flatten

HELD_OUT_FROM = 1_000_001
"""First seed of the held-out robots, which the search does not use."""

START_SCORE, FOUND_SCORE = "held out, to begin with", "held out, found"


@dataclass(frozen=True)
class Score:
    """Score of a set of parameters on a set of seeds: mean cost of a run, falls, runs."""

    cost: float
    fell: int
    runs: int

    def __str__(self) -> str:
        return f"cost {self.cost:.3f}, {self.fell} of {self.runs} fell"


@dataclass(frozen=True)
class Task:
    """Searched parameters and their objective, with `seeds` robots in each generation."""

    space: Sequence[Parameter]
    objective: Objective
    seeds: int
    changes: tuple[str, ...]

    def purpose(self) -> str:
        """Text that is equal for two searches of the same problem."""
        names = [(p.name, p.start, p.low, p.high) for p in self.space]
        what = [names, unstructure(self.objective), self.seeds, self.changes]
        return json.dumps(what, sort_keys=True)


def run(arguments: argparse.Namespace) -> int:
    """Search until the last generation or Ctrl-C, then report; returns the exit code."""
    task = _task(arguments)
    arguments.out.mkdir(parents=True, exist_ok=True)
    state, scores = arguments.out / "search.pickle", {}
    with (
        contextlib.closing(workers(arguments.jobs, arguments.scheduler)) as pool,
        progress_bar("run") as bar,
    ):
        if arguments.resume:
            search = Search.load(state, task.purpose())
        else:
            size = len(task.space)
            search = Search.begin(size, arguments.seed, arguments.step, arguments.population)
            search.save(state, task.purpose())
        try:
            _advance(task, search, pool, bar, arguments.generations, state)
            if arguments.held_out:
                scores = _held_out(task, search, pool, bar, arguments.held_out)
        except KeyboardInterrupt:
            bar.write("stopped; what was found is kept, --resume goes on", file=sys.stderr)
    _report(task, search, scores, arguments)
    return 0


def _task(arguments: argparse.Namespace) -> Task:
    """Task of a command line; its errors are reported before the robot is loaded."""
    content: dict[str, Any] = {}
    changes = spelled_out(arguments.set)
    apply_changes(content, changes)
    given = content.get("controller") or {}
    if not isinstance(given, Mapping):
        raise ExperimentError(f"controller = {given!r} is not a mapping")
    space = parameters(arguments.parameters, flatten(given), arguments.factor)
    if len(space) < 2:
        raise ExperimentError(f"only {space[0].name} is to be searched: two or more are needed")
    objective = load_objective(arguments.objective or DEFAULT)
    task = Task(space, objective, arguments.robots, changes)
    from cassie_bags.studies.run_trial import experiment_of

    for trial in objective.trials(values(space, np.zeros(len(space))), [1], task.changes):
        experiment_of(trial)
    return task


def _report(
    task: Task, search: Search, scores: Mapping[str, Score], arguments: argparse.Namespace
) -> None:
    """Write and print the results of a search.

    The files are tuned.yaml, a `controller:` section for experiments; tuned_node.yaml, the same
    values as a parameter file of the node; and tuned.json, with the origin of the values.
    """
    found = values(task.space, search.found)
    comments = "".join(f"# {name}: {result}\n" for name, result in scores.items())
    node = {"gait_controller": {"ros__parameters": found}}
    for name, content in {"tuned": {"controller": found}, "tuned_node": node}.items():
        path = arguments.out / f"{name}.yaml"
        path.write_text(comments + yaml.safe_dump(content), "utf-8")
    provenance = {
        "parameters": [{**asdict(p), "found": found[p.name]} for p in task.space],
        "scores": {name: asdict(score) for name, score in scores.items()},
        "history": [asdict(generation) for generation in search.history],
        "settings": {
            "objective": unstructure(task.objective),
            "robots of a generation": task.seeds,
            "seed": arguments.seed,
            "changes": list(task.changes),
            "population": search.population,
        },
        "versions": versions(),
    }
    (arguments.out / "tuned.json").write_text(json.dumps(provenance, indent=1), "utf-8")
    width = max(len(parameter.name) for parameter in task.space)
    print(f"{'parameter':{width}}  {'from':>10}  {'found':>10}  unit")
    for p in task.space:
        print(f"{p.name:{width}}  {p.start:10.4g}  {found[p.name]:10.4g}  {p.unit}")
    print(f"after {len(search.history)} generations of {search.population}")
    for name, result in scores.items():
        print(f"{name}: {result}")
    if scores and scores[FOUND_SCORE].cost >= scores[START_SCORE].cost:
        print("no better than what it began from on robots held out: stay with that")
    kept = arguments.out / "tuned.yaml"
    print(f"kept in {kept}; use it with --set @{kept}")


def _advance(
    task: Task, search: Search, pool: Workers, bar: tqdm, generations: int, state: Path
) -> None:
    """Run generations up to a number; each has robots of its own, and is stored when done."""
    while len(search.history) < generations:
        first = 1 + task.seeds * len(search.history)
        robots = range(first, first + task.seeds)

        def evaluate(candidates: Sequence[FloatArray], robots: range = robots) -> list[float]:
            return [result.cost for result in score(task, candidates, robots, pool, bar)]

        generation = search.advance(evaluate)
        search.save(state, task.purpose())
        bar.write(
            f"generation {generation.number} of {generations}: best {generation.best:.3f}, "
            f"middle {generation.middle:.3f}, step {generation.step:.2f}",
            file=sys.stderr,
        )


def _held_out(task: Task, search: Search, pool: Workers, bar: tqdm, count: int) -> dict[str, Score]:
    """Scores of the initial and of the found parameters, on robots that the search did not use."""
    seeds = range(HELD_OUT_FROM, HELD_OUT_FROM + count)
    candidates = [np.zeros(len(task.space)), search.found]
    before, after = score(task, candidates, seeds, pool, bar)
    return {START_SCORE: before, FOUND_SCORE: after}


def score(
    task: Task,
    candidates: Sequence[FloatArray],
    seeds: range,
    pool: Workers,
    bar: tqdm,
) -> list[Score]:
    """Score candidates on all courses, with all runs in parallel.

    Args:
        task: Searched parameters and their objective.
        candidates: Coordinates of each candidate. Shape (size,).
        seeds: Seeds of the robots.
        pool: Workers that compute the runs.
        bar: Progress bar, which advances with each run.
    """
    from cassie_bags.studies.run_trial import run_trial

    each = [
        task.objective.trials(values(task.space, candidate), seeds, task.changes)
        for candidate in candidates
    ]
    results = iter(all_results(pool, run_trial, list(chain.from_iterable(each)), bar))
    scores = []
    for trials in each:
        measured = list(islice(results, len(trials)))
        costs = [task.objective.cost_of(*pair) for pair in zip(trials, measured, strict=True)]
        fell = sum(int(measures["fell"]) for measures in measured)
        scores.append(Score(float(np.mean(np.sort(costs))), fell, len(costs)))
    return scores
