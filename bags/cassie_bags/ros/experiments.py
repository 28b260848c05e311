"""Runs experiments and reports on them: one, or many with one page about all of them.

Over DDS the nodes are processes; otherwise the cores run in this process, without ROS.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import itertools
import os
import sys
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from cassie_bags.bag.rosbag2 import contents_of, write_metadata
from cassie_bags.bag.summary import summarize
from cassie_bags.errors import ExperimentError, RunError
from cassie_bags.report.page import Entry, page, run_entry
from cassie_bags.report.text import json_line, table
from cassie_bags.run.bag_observer import bag_observer
from cassie_bags.run.cores import (
    check_one_process,
    check_parameters,
    check_plant,
    make_loop,
    tick_count,
)
from cassie_bags.run.experiment import load_experiment, packaged_experiments
from cassie_bags.run.judge import RunResult, evaluate
from cassie_bags.run.progress import progress_bar
from cassie_bags.run.provenance import versions
from cassie_bags.run.seed import resolve, write_resolved
from cassie_bags.run.simulate import Observer, Store
from cassie_bags.run.simulate import run as run_loop
from cassie_bags.run.yaml_file import consistent
from cassie_bags.studies.workers import ThisProcess, Workers, ctrl_c_at_the_end, workers
from cassie_gaits.errors import CassieError
from cassie_msgs.experiment.file import Experiment
from cassie_msgs.tunables import ParameterError

NOT_RUN = "the run did not come to its end"


def run(arguments: argparse.Namespace) -> int:
    """Run the experiments of a command line; returns the exit code."""
    if arguments.all and arguments.files:
        raise ExperimentError("--all runs those of the package: name no file")
    if not arguments.all and not arguments.files:
        raise ExperimentError("name an experiment file, or --all for those of the package")
    several = arguments.all or len(arguments.files) > 1 or arguments.seeds
    return _run_many(arguments) if several else _run_one(arguments)


def _run_one(arguments: argparse.Namespace) -> int:
    changes = consistent(arguments.set)
    experiment = resolve(load_experiment(arguments.files[0], changes, arguments.seed))
    _check(arguments.files[0], experiment, in_process=arguments.in_process)
    outcome = run_experiment(
        experiment,
        arguments.out,
        in_process=arguments.in_process,
        stack=arguments.stack,
        physics_thread=len(os.sched_getaffinity(0)) > 1,
    )
    if arguments.out is not None:
        film = not arguments.no_video
        outcome, _ = write_results(
            outcome, arguments.out, pictures=not arguments.no_pictures, film=film
        )
    print(table(outcome), file=sys.stderr)
    if arguments.json or not sys.stdout.isatty():
        print(json_line(outcome), flush=True)
    return 0 if outcome.passed else 1


def _run_many(arguments: argparse.Namespace) -> int:
    if arguments.seed is not None or arguments.json:
        option = "--json" if arguments.json else "--seed"
        raise ExperimentError(f"{option} is for one run: several leave result.json each; --seeds N")
    tasks = _tasks(arguments)
    for task in tasks:
        _check(task.file, _experiment(task), in_process=task.in_process)
    entries = _run_all(tasks, arguments)
    failures = [failure for entry in entries for failure in entry["failures"]]
    if any(failure.startswith(NOT_RUN) for failure in failures):
        return 3
    return 1 if failures else 0


def _check(file: Path, experiment: Experiment, *, in_process: bool) -> None:
    """Refuse an experiment that cannot be run, before anything starts.

    Raises:
        ExperimentError: naming the file, the value and what is permitted.
    """
    try:
        check_parameters(experiment)
        if in_process:
            check_one_process(experiment)
        check_plant(experiment)
    except (CassieError, ParameterError) as error:
        raise ExperimentError(f"{file}: {error}") from None


def run_experiment(
    experiment: Experiment,
    out: Path | None,
    *,
    in_process: bool,
    stack: bool = False,
    physics_thread: bool = False,
) -> RunResult:
    """Run a drawn experiment; its files go into `out`, or nowhere if `out` is None.

    Args:
        experiment: Experiment to run.
        out: Folder for the files, or None.
        in_process: Whether all cores run in this process, without nodes.
        stack: Whether estimator and controller share a process, over DDS.
        physics_thread: Whether the physics has a thread of its own; not over DDS.

    Raises:
        RunError: if the run did not end normally.
        CassieError, ParameterError: naming what cannot be used.
    """
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
    if in_process:
        return _in_process(experiment, out, physics_thread)
    if out is not None:
        return _over_dds(experiment, out, stack)
    with tempfile.TemporaryDirectory(prefix="cassie_") as folder:
        return _over_dds(experiment, Path(folder), stack)


def _in_process(experiment: Experiment, folder: Path | None, physics_thread: bool) -> RunResult:
    store = Store()
    bar = progress_bar("tick", items=range(tick_count(experiment)))
    observers: list[Observer] = [store]

    def observe(topic: str, raw: bytes, stamp: int) -> None:
        for observer in observers:
            observer(topic, raw, stamp)

    with stopped_between(bar) as whole, contextlib.ExitStack() as stack:
        if folder is not None:
            observers.append(stack.enter_context(bag_observer(folder / "bag.mcap", experiment)))
        loop = make_loop(experiment, observe, physics_thread=physics_thread)
        wall_time = run_loop(loop, whole)
    for node, (problem, time) in loop.problems.items():
        print(f"{node} at {time:.3f} s: {problem}", file=sys.stderr)
    return evaluate(experiment, store.recording(wall_time), "in-process")


@contextmanager
def stopped_between(ticks: Iterable[int]) -> Iterator[Iterator[int]]:
    """Ticks of a run that Ctrl-C ends only between two ticks: never within a record of the bag."""
    with ctrl_c_at_the_end() as signals:
        yield itertools.takewhile(lambda _: not signals, ticks)


def _over_dds(experiment: Experiment, folder: Path, stack: bool) -> RunResult:
    from cassie_bags.ros.dds_run import run_over_dds

    summary = summarize(run_over_dds(experiment, folder, stack=stack))
    return evaluate(experiment, summary.recording, "dds", lockstep_broken=summary.lockstep_broken)


def write_results(
    outcome: RunResult, folder: Path, *, pictures: bool, film: bool = True
) -> tuple[RunResult, Entry]:
    """Write table, JSON, pictures and page beside the bag.

    Args:
        outcome: Result of the run.
        folder: Folder of the bag.
        pictures: Whether to draw pictures and a page.
        film: Whether to make a video, too.

    Returns:
        The result with the names of these files, and the content of a page about it.
    """
    bag = folder / "bag.mcap"
    files = {"bag": bag, "experiment": folder / "experiment.yaml", "table": folder / "table.txt"}
    write_resolved(outcome.experiment, files["experiment"])
    write_metadata(folder, [contents_of(bag)])
    view = None
    if pictures:
        from cassie_bags.report.pictures import draw
        from cassie_bags.report.view import view_of_bag

        view = view_of_bag(bag, outcome.experiment.name)
        files |= draw(view, folder, film=film) | {"report": folder / "report.html"}
    names = {name: str(path) for name, path in files.items()}
    outcome = dataclasses.replace(outcome, files=names)
    files["table"].write_text(table(outcome) + "\n", encoding="utf-8")
    (folder / "result.json").write_text(json_line(outcome) + "\n", encoding="utf-8")
    entry = run_entry(outcome, view, {})
    if pictures:
        title = f"Cassie: {outcome.experiment.name}"
        files["report"].write_text(page(title, [entry], versions()), encoding="utf-8")
    return outcome, entry


@dataclass(frozen=True)
class Task:
    """One run: file, seed, changes, folder for its files, and options."""

    file: Path
    seed: int | None
    changes: tuple[str, ...]
    folder: Path
    in_process: bool
    stack: bool
    pictures: bool
    film: bool


def run_task(task: Task) -> Entry:
    """Run an experiment and write its files.

    Returns:
        Content of the page about it; if the run did not end normally, the reason instead.
    """
    experiment = _experiment(task)
    try:
        outcome = run_experiment(
            experiment, task.folder, in_process=task.in_process, stack=task.stack
        )
        _, entry = write_results(outcome, task.folder, pictures=task.pictures, film=task.film)
    except (RunError, ValueError, OSError) as error:
        reason = f"{NOT_RUN}: {' '.join(str(error).split())}"
        content = {"name": experiment.name, "seed": experiment.seed, "passed": False}
        return content | {"failures": [reason]}
    return entry


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
    out = arguments.out or Path("build/experiments")
    return [
        Task(
            file,
            seed,
            changes,
            out / (file.stem if seed is None else f"{file.stem}_{seed}"),
            arguments.in_process,
            arguments.stack,
            not arguments.no_pictures,
            not arguments.no_video,
        )
        for file in files
        for seed in seeds
    ]


def _run_all(tasks: list[Task], arguments: argparse.Namespace) -> list[Entry]:
    """Run all tasks; the page is written again after each run, so that a stop leaves a page."""
    entries_by_task: dict[int, Entry] = {}
    path = tasks[0].folder.parent / "report.html"
    pool: Workers = workers(arguments.jobs, None) if arguments.in_process else ThisProcess()
    bar = progress_bar("run", len(tasks))
    with contextlib.closing(pool), bar:
        for index, content in pool.results(run_task, tasks):
            entries_by_task[index] = content
            entries = [entries_by_task[key] for key in sorted(entries_by_task)]
            path.write_text(page("Cassie: experiments", entries, versions()), "utf-8")
            bar.update()
            verdict = "as expected" if content["passed"] else "; ".join(content["failures"])
            bar.write(f"{content['name']}, seed {content['seed']}: {verdict}", file=sys.stderr)
    print(f"{sum(e['passed'] for e in entries)} of {len(entries)} as expected: {path}")
    return entries
