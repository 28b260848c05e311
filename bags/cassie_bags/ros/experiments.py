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

_OUT = Path("build/experiments")  # folder of several runs


@dataclass(frozen=True)
class Task:
    """One run of a command line.

    Attributes:
        file: File of the experiment.
        seed: Seed in place of the file's.
        folder: Folder for the files of the run; None for no files.
        arguments: All arguments of the command line.
    """

    file: Path
    seed: int | None
    folder: Path | None
    arguments: argparse.Namespace

    def experiment(self) -> Experiment:
        """The experiment, drawn.

        Raises:
            ExperimentError: naming the file, the value and what is permitted, before anything runs.
        """
        experiment = resolve(load_experiment(self.file, self.arguments.set, self.seed))
        try:
            check_parameters(experiment)
            if self.arguments.in_process:
                check_one_process(experiment)
            check_plant(experiment)
        except (CassieError, ParameterError) as error:
            raise ExperimentError(f"{self.file}: {error}") from None
        return experiment


def run(arguments: argparse.Namespace) -> int:
    """Run the experiments of a command line; returns the exit code."""
    if arguments.all and arguments.files:
        raise ExperimentError("--all runs those of the package: name no file")
    if not arguments.all and not arguments.files:
        raise ExperimentError("name an experiment file, or --all for those of the package")
    several = arguments.all or len(arguments.files) > 1 or arguments.seeds
    consistent(arguments.set)
    return _run_many(arguments) if several else _run_one(arguments)


def _run_one(arguments: argparse.Namespace) -> int:
    task = Task(arguments.files[0], arguments.seed, arguments.out, arguments)
    result = _result(task, task.experiment(), physics_thread=len(os.sched_getaffinity(0)) > 1)
    if task.folder is not None:
        result, _ = _write_results(result, task.folder, arguments)
    print(table(result), file=sys.stderr)
    if arguments.json or not sys.stdout.isatty():
        print(json_line(result), flush=True)
    return 0 if result.passed else 1


def _run_many(arguments: argparse.Namespace) -> int:
    if arguments.seed is not None or arguments.json:
        option = "--json" if arguments.json else "--seed"
        raise ExperimentError(f"{option} is for one run: several leave result.json each; --seeds N")
    tasks = _tasks(arguments)
    for task in tasks:
        task.experiment()
    failures = [failure for entry in _run_all(tasks, arguments) for failure in entry["failures"]]
    if any(failure.startswith(NOT_RUN) for failure in failures):
        return 3
    return 1 if failures else 0


def _result(task: Task, experiment: Experiment, *, physics_thread: bool = False) -> RunResult:
    """Run a drawn experiment.

    Args:
        task: The task with folder and options.
        experiment: Experiment of the task.
        physics_thread: Whether the physics has a thread of its own; not over DDS.

    Raises:
        RunError: if the run did not end normally.
        CassieError, ParameterError: naming what cannot be used.
    """
    if task.folder is not None:
        task.folder.mkdir(parents=True, exist_ok=True)
    if task.arguments.in_process:
        return _in_process(experiment, task.folder, physics_thread)
    from cassie_bags.ros.dds_run import run_over_dds

    with contextlib.ExitStack() as stack:
        folder = task.folder
        if folder is None:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="cassie_")))
        summary = summarize(run_over_dds(experiment, folder, stack=task.arguments.stack))
    return evaluate(experiment, summary.recording, "dds", lockstep_broken=summary.lockstep_broken)


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


def _write_results(
    result: RunResult, folder: Path, arguments: argparse.Namespace
) -> tuple[RunResult, Entry]:
    """Write table, JSON, and unless refused pictures and a page beside the bag of a run.

    Returns:
        The result with the names of these files, and the content of a page about it.
    """
    bag = folder / "bag.mcap"
    files = {"bag": bag, "experiment": folder / "experiment.yaml", "table": folder / "table.txt"}
    write_resolved(result.experiment, files["experiment"])
    write_metadata(folder, [contents_of(bag)])
    view = None
    if not arguments.no_pictures:
        from cassie_bags.report.pictures import draw
        from cassie_bags.report.view import view_of_bag

        view = view_of_bag(bag, result.experiment.name)
        files |= draw(view, folder, film=not arguments.no_video)
        files["report"] = folder / "report.html"
    names = {name: str(path) for name, path in files.items()}
    result = dataclasses.replace(result, files=names)
    files["table"].write_text(table(result) + "\n", encoding="utf-8")
    (folder / "result.json").write_text(json_line(result) + "\n", encoding="utf-8")
    entry = run_entry(result, view, {})
    if view is not None:
        title = f"Cassie: {result.experiment.name}"
        files["report"].write_text(page(title, [entry], versions()), encoding="utf-8")
    return result, entry


def _run_task(task: Task) -> Entry:
    """Run an experiment and write its files.

    Returns:
        Content of the page about it; if the run did not end normally, the reason instead.
    """
    experiment = resolve(load_experiment(task.file, task.arguments.set, task.seed))
    assert task.folder is not None
    try:
        return _write_results(_result(task, experiment), task.folder, task.arguments)[1]
    except (RunError, ValueError, OSError) as error:
        reason = f"{NOT_RUN}: {' '.join(str(error).split())}"
        content = {"name": experiment.name, "seed": experiment.seed, "passed": False}
        return content | {"failures": [reason]}


def _tasks(arguments: argparse.Namespace) -> list[Task]:
    files = arguments.files or packaged_experiments()
    stems = [file.stem for file in files]
    for file in files:
        if stems.count(file.stem) > 1:
            raise ExperimentError(f"two files are called {file.stem}: they would share a folder")
    seeds: Iterable[int | None] = range(1, arguments.seeds + 1) if arguments.seeds else (None,)
    out = arguments.out or _OUT
    return [
        Task(file, seed, out / (file.stem if seed is None else f"{file.stem}_{seed}"), arguments)
        for file in files
        for seed in seeds
    ]


def _run_all(tasks: list[Task], arguments: argparse.Namespace) -> list[Entry]:
    """Run all tasks; the page is written again after each run, so that a stop leaves a page."""
    entries_by_task: dict[int, Entry] = {}
    path = (arguments.out or _OUT) / "report.html"
    pool: Workers = workers(arguments.jobs, None) if arguments.in_process else ThisProcess()
    bar = progress_bar("run", len(tasks))
    with contextlib.closing(pool), bar:
        for index, content in pool.results(_run_task, tasks):
            entries_by_task[index] = content
            entries = [entries_by_task[key] for key in sorted(entries_by_task)]
            path.write_text(page("Cassie: experiments", entries, versions()), "utf-8")
            bar.update()
            verdict = "as expected" if content["passed"] else "; ".join(content["failures"])
            bar.write(f"{content['name']}, seed {content['seed']}: {verdict}", file=sys.stderr)
    print(f"{sum(e['passed'] for e in entries)} of {len(entries)} as expected: {path}")
    return entries
