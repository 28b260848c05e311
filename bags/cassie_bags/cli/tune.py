"""Command `tune`: search for controller parameters that walk well on many grounds and robots."""

from __future__ import annotations

import argparse
import contextlib
import json
import signal
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from tqdm import tqdm

from cassie_bags.cli.arguments import count, number, positive
from cassie_bags.errors import ExperimentError, RunError
from cassie_bags.run.yaml_file import apply_changes, spelled_out
from cassie_bags.studies.trial import experiment_of, run_trial
from cassie_bags.studies.tune.objective import DEFAULT, Objective, load_objective
from cassie_bags.studies.tune.result import Score, table, write_result
from cassie_bags.studies.tune.search import Search
from cassie_bags.studies.tune.space import Parameter, parameters, values
from cassie_bags.studies.workers import Workers, workers
from cassie_msgs.tunables import flatten

FloatArray = npt.NDArray[np.float64]

FOUND, WRONG_INPUT, NO_RUN = 0, 2, 3
"""Exit codes."""

HELD_OUT_FROM = 1_000_001
"""First seed of the robots that the search does not see."""

START_SCORE, FOUND_SCORE = "held out, to begin with", "held out, found"


@dataclass(frozen=True)
class Task:
    """What is searched, and what it is held against; `seeds` robots in each generation."""

    space: Sequence[Parameter]
    objective: Objective
    seeds: int
    changes: tuple[str, ...]

    def purpose(self) -> str:
        """What makes two searches the same."""
        names = [(p.name, p.start, p.low, p.high) for p in self.space]
        what = [names, self.objective.content, self.seeds, self.changes]
        return json.dumps(what, sort_keys=True)


def main() -> int:
    """Entry point of `ros2 run cassie_bags tune`."""
    arguments = _arguments()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        task = _task(arguments)
        arguments.out.mkdir(parents=True, exist_ok=True)
        with contextlib.closing(workers(arguments.jobs, arguments.scheduler)) as crew:
            _tune(task, crew, arguments)
    except RunError as error:
        print(f"tune: error: {error}", file=sys.stderr)
        return NO_RUN
    except KeyboardInterrupt:
        print("tune: stopped before there was anything to keep", file=sys.stderr)
        return 130
    except (ValueError, OSError) as error:
        print(f"tune: error: {' '.join(str(error).split())}", file=sys.stderr)
        return WRONG_INPUT
    return FOUND


def _task(arguments: argparse.Namespace) -> Task:
    content: dict[str, Any] = {}
    changes = spelled_out(arguments.set)
    apply_changes(content, changes)
    given = content.get("controller") or {}
    if not isinstance(given, Mapping):
        raise ExperimentError(f"controller = {given!r} is not a mapping")
    space = parameters(arguments.parameters, flatten(given), arguments.factor)
    if len(space) < 2:
        raise ExperimentError(f"only {space[0].name} is to be searched: two or more are needed")
    objective = load_objective(arguments.objective)
    task = Task(space, objective, arguments.seeds, changes)
    for trial in objective.trials(values(space, np.zeros(len(space))), [1], task.changes):
        experiment_of(trial)
    return task


def _tune(task: Task, crew: Workers, arguments: argparse.Namespace) -> None:
    """Search until the last generation or Ctrl-C, then report on robots held out."""
    state = arguments.out / "search.pickle"
    bar = tqdm(unit="run", disable=not sys.stderr.isatty(), leave=False)
    with bar:
        if arguments.resume:
            search = Search.load(state, task.purpose())
        else:
            size = len(task.space)
            search = Search.begin(size, arguments.seed, arguments.step, arguments.population)
            search.save(state, task.purpose())
        stopped = False
        try:
            _advance(task, search, crew, bar, arguments.generations, state)
        except KeyboardInterrupt:
            stopped = True
            _say(bar, "stopped; what was found is kept, --resume goes on")
        scores: dict[str, Score] = {}
        if not stopped and arguments.held_out:
            scores = _held_out(task, search, crew, bar, arguments.held_out)
    _report(task, search, scores, arguments)


def _report(
    task: Task, search: Search, scores: Mapping[str, Score], arguments: argparse.Namespace
) -> None:
    found = values(task.space, search.found)
    settings = {
        "objective": task.objective.content,
        "robots of a generation": task.seeds,
        "seed": arguments.seed,
        "changes": list(task.changes),
        "population": search.population,
    }
    files = write_result(arguments.out, task.space, found, search, scores, settings)
    print(table(task.space, found))
    print(f"after {len(search.history)} generations of {search.population}")
    for name, result in scores.items():
        print(f"{name}: {result}")
    if scores and scores[FOUND_SCORE].cost >= scores[START_SCORE].cost:
        print("no better than what it began from on robots held out: stay with that")
    print(f"kept in {files['section']}; use it with --set @{files['section']}")


def _advance(
    task: Task, search: Search, crew: Workers, bar: tqdm, generations: int, state: Path
) -> None:
    """Generations up to a number of them, each with robots of its own and kept when it is done."""
    while len(search.history) < generations:
        first = 1 + task.seeds * len(search.history)
        robots = range(first, first + task.seeds)

        def evaluate(candidates: Sequence[FloatArray], robots: range = robots) -> list[float]:
            return [found.cost for found in score(task, candidates, robots, crew, bar)]

        generation = search.advance(evaluate)
        search.save(state, task.purpose())
        _say(
            bar,
            f"generation {generation.number} of {generations}: best {generation.best:.3f}, "
            f"middle {generation.middle:.3f}, step {generation.step:.2f}",
        )


def _held_out(task: Task, search: Search, crew: Workers, bar: tqdm, count: int) -> dict[str, Score]:
    """Where it began and what was found, on robots that the search has not seen."""
    seeds = range(HELD_OUT_FROM, HELD_OUT_FROM + count)
    candidates = [np.zeros(len(task.space)), search.found]
    before, after = score(task, candidates, seeds, crew, bar)
    return {START_SCORE: before, FOUND_SCORE: after}


def score(
    task: Task,
    candidates: Sequence[FloatArray],
    seeds: range,
    crew: Workers,
    bar: tqdm,
) -> list[Score]:
    """Candidates on all courses by the robots of some seeds, all runs at once."""
    trials, owners = [], []
    for index, candidate in enumerate(candidates):
        some = task.objective.trials(values(task.space, candidate), seeds, task.changes)
        trials += some
        owners += [index] * len(some)
    costs: list[list[float]] = [[] for _ in candidates]
    fell = [0] * len(candidates)
    for index, figures in crew.results(run_trial, trials):
        costs[owners[index]].append(task.objective.cost_of(trials[index], figures))
        fell[owners[index]] += int(figures["fell"])
        bar.update()
    return [
        Score(float(np.mean(np.sort(cost))), falls, len(cost))
        for cost, falls in zip(costs, fell, strict=True)
    ]


def _say(bar: tqdm, text: str) -> None:
    bar.write(text, file=sys.stderr)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="tune",
        description="Search for controller parameters by CMA-ES, in process, on local processes "
        "or a Dask cluster. Ctrl-C keeps what was found.",
        epilog="Exit codes: 0 done or stopped with a result, 2 wrong file or arguments, "
        "3 no scheduler.",
    )
    parser.add_argument(
        "parameters",
        nargs="*",
        help="patterns of controller parameters, such as 'walk.joints.*'; the joint, torso and "
        "leg-angle gains if left out",
    )
    parser.add_argument(
        "--objective",
        type=Path,
        default=DEFAULT,
        help="file of courses, model errors and costs (the package's)",
    )
    parser.add_argument(
        "--seeds", type=positive, default=2, help="new robots in each generation (%(default)s)"
    )
    parser.add_argument(
        "--held-out", type=count, default=10, help="other robots to report on (%(default)s)"
    )
    parser.add_argument("--generations", type=count, default=30, help="in all (%(default)s)")
    parser.add_argument("--population", type=_crowd, default=0, help="of a generation; 0: auto (0)")
    parser.add_argument(
        "--factor", type=_factor, default=2.0, help="a value goes up and down by (%(default)s)"
    )
    parser.add_argument(
        "--step", type=_share, default=0.3, help="first step, by the whole reach (%(default)s)"
    )
    parser.add_argument("--seed", type=positive, default=1, help="of the search (%(default)s)")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="for every run; controller parameters given so are where the search begins",
    )
    parser.add_argument("--resume", action="store_true", help="go on with the search in --out")
    parser.add_argument("--jobs", type=positive, default=None, help="processes; one for each core")
    parser.add_argument(
        "--scheduler", default=None, metavar="ADDRESS", help="of a Dask cluster to compute on"
    )
    parser.add_argument(
        "--out", type=Path, default=Path("build/tune"), help="folder to write to (%(default)s)"
    )
    return parser.parse_args()


def _crowd(word: str) -> int:
    if (crowd := count(word)) == 1:
        raise argparse.ArgumentTypeError("1 is not 0 (auto), or 2 or more")
    return crowd


def _factor(word: str) -> float:
    return _between(word, 1.01, 100.0)


def _share(word: str) -> float:
    return _between(word, 0.001, 1.0)


def _between(word: str, low: float, high: float) -> float:
    value = number(word)
    if not low <= value <= high:
        raise argparse.ArgumentTypeError(f"{word} is not {low:g} .. {high:g}")
    return value


if __name__ == "__main__":
    sys.exit(main())
