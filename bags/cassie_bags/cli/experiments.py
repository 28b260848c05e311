"""Command `experiments`: run many experiment files and write one page about them."""

from __future__ import annotations

import argparse
import contextlib
import signal
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from tqdm import tqdm

from cassie_bags.cli.arguments import count
from cassie_bags.cli.experiment import keep, run_experiment
from cassie_bags.errors import ExperimentError, RunError
from cassie_bags.report.page import Entry, page
from cassie_bags.run.cores import check_parameters
from cassie_bags.run.experiment import Experiment, load_experiment, packaged_experiments
from cassie_bags.run.provenance import versions
from cassie_bags.run.seed import resolve
from cassie_bags.run.yaml_file import consistent
from cassie_bags.studies.workers import ThisProcess, Workers, workers

PASSED, NOT_AS_EXPECTED, WRONG_INPUT, NO_RUN, STOPPED = 0, 1, 2, 3, 130
"""Exit codes."""

NOT_RUN = "the run did not come to its end"


@dataclass(frozen=True)
class Task:
    """One run: file, seed, changes, where it leaves its files, and how it is run."""

    file: Path
    seed: int | None
    changes: tuple[str, ...]
    folder: Path
    in_process: bool
    film: bool


def run_task(task: Task) -> Entry:
    """Run an experiment and leave its files.

    Returns:
        What the page says of it; what ended a run before its end is told in its place.
    """
    experiment = _experiment(task)
    try:
        outcome = run_experiment(experiment, task.folder, in_process=task.in_process)
        _, entry = keep(outcome, task.folder, pictures=True, film=task.film)
    except (RunError, ValueError, OSError) as error:
        reason = f"{NOT_RUN}: {' '.join(str(error).split())}"
        content = {"name": experiment.name, "seed": experiment.seed, "passed": False}
        return content | {"failures": [reason]}
    return entry


def main() -> int:
    """Entry point of `ros2 run cassie_bags experiments`."""
    arguments = _arguments()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        tasks = _tasks(arguments)
        for task in tasks:
            check_parameters(_experiment(task))
        entries = _run(tasks, arguments)
    except KeyboardInterrupt:
        print("experiments: stopped", file=sys.stderr)
        return STOPPED
    except RunError as error:
        print(f"experiments: error: {error}", file=sys.stderr)
        return NO_RUN
    except (ValueError, OSError) as error:
        print(f"experiments: error: {' '.join(str(error).split())}", file=sys.stderr)
        return WRONG_INPUT
    failures = [failure for entry in entries for failure in entry["failures"]]
    if any(failure.startswith(NOT_RUN) for failure in failures):
        return NO_RUN
    return NOT_AS_EXPECTED if failures else PASSED


def _experiment(task: Task) -> Experiment:
    return resolve(load_experiment(task.file, task.changes, task.seed))


def _tasks(arguments: argparse.Namespace) -> list[Task]:
    files = arguments.files or packaged_experiments()
    stems = [file.stem for file in files]
    for file in files:
        if stems.count(file.stem) > 1:
            raise ExperimentError(f"two files are called {file.stem}: they would share a folder")
    changes = consistent(arguments.set)
    seeds: Iterable[int | None] = range(1, arguments.seeds + 1) if arguments.seeds else (None,)
    return [
        Task(
            file,
            seed,
            changes,
            arguments.out / (file.stem if seed is None else f"{file.stem}_{seed}"),
            not arguments.dds,
            arguments.video,
        )
        for file in files
        for seed in seeds
    ]


def _run(tasks: list[Task], arguments: argparse.Namespace) -> list[Entry]:
    """Run all tasks; the page is written anew after each, so that a stop leaves one."""
    found: dict[int, Entry] = {}
    crew: Workers = ThisProcess() if arguments.dds else workers(arguments.jobs, None)
    bar = tqdm(total=len(tasks), unit="run", disable=not sys.stderr.isatty(), leave=False)
    with contextlib.closing(crew), bar:
        for index, content in crew.results(run_task, tasks):
            found[index] = content
            entries = [found[key] for key in sorted(found)]
            path = arguments.out / "report.html"
            sweeps = arguments.sweeps if arguments.sweeps.is_dir() else None
            path.write_text(page("Cassie: experiments", entries, versions(), sweeps), "utf-8")
            bar.update()
            verdict = "as expected" if content["passed"] else "; ".join(content["failures"])
            bar.write(f"{content['name']}, seed {content['seed']}: {verdict}", file=sys.stderr)
    print(f"{sum(e['passed'] for e in entries)} of {len(entries)} as expected: {path}")
    return entries


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="experiments",
        description="Run experiment files, those of the package if none is named: bags, pictures "
        "and one page, report.html. In one process for each core, without ROS; the trajectories "
        "are those of --dds to the last bit.",
        epilog="Exit codes: 0 all as expected, 1 not all, 2 wrong file or arguments, 3 a run did "
        "not come to its end, 130 stopped.",
    )
    parser.add_argument("files", nargs="*", type=Path, help="YAML files, see bags/README.md")
    parser.add_argument(
        "--seeds", type=count, default=0, help="run each with seeds 1 to this; 0: the file's own"
    )
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--dds", action="store_true", help="all nodes as processes, one run a time")
    parser.add_argument("--video", action="store_true", help="film each run too")
    parser.add_argument("--jobs", type=count, default=0, help="processes; 0: one for each core")
    parser.add_argument("--out", type=Path, default=Path("build/experiments"))
    parser.add_argument(
        "--sweeps",
        type=Path,
        default=Path("build/sweeps"),
        help="results of the sweeps to show too, where there are some",
    )
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
