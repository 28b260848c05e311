"""Command `experiment`: run an experiment file, report on it, exit by what it expects."""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import signal
import sys
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from tqdm import tqdm

from cassie_bags.bag.diagnosis import lockstep_broken, problems
from cassie_bags.bag.recording import read_recording
from cassie_bags.bag.rosbag2 import contents_of, write_metadata
from cassie_bags.errors import RunError
from cassie_bags.report.text import json_line, table
from cassie_bags.run.cores import check_parameters, make_loop, tick_count
from cassie_bags.run.experiment import Experiment, load_experiment
from cassie_bags.run.judge import Outcome, evaluate
from cassie_bags.run.observers import BagObserver, both
from cassie_bags.run.provenance import versions
from cassie_bags.run.seed import resolve, write_resolved
from cassie_bags.run.simulate import Store, run
from cassie_bags.run.yaml_file import consistent
from cassie_bags.studies.workers import ctrl_c_at_the_end

if TYPE_CHECKING:
    from cassie_bags.report.page import Entry

PASSED, NOT_AS_EXPECTED, WRONG_INPUT, NO_RUN, STOPPED = 0, 1, 2, 3, 130
"""Exit codes."""


def main() -> int:
    """Entry point of `ros2 run cassie_bags experiment`."""
    arguments = _arguments()
    signal.signal(signal.SIGTERM, _interrupt)
    try:
        changes = consistent(arguments.set)
        experiment = resolve(load_experiment(arguments.file, changes, arguments.seed))
        check_parameters(experiment)
        outcome = run_experiment(
            experiment, arguments.out, in_process=arguments.in_process, stack=arguments.stack
        )
        if arguments.out is not None:
            outcome, _ = keep(outcome, arguments.out, pictures=not arguments.no_pictures)
    except KeyboardInterrupt:
        print("experiment: stopped", file=sys.stderr)
        return STOPPED
    except RunError as error:
        print(f"experiment: error: {error}", file=sys.stderr)
        return NO_RUN
    except (ValueError, OSError) as error:
        print(f"experiment: error: {' '.join(str(error).split())}", file=sys.stderr)
        return WRONG_INPUT
    print(table(outcome), file=sys.stderr)
    if arguments.json or not sys.stdout.isatty():
        print(json_line(outcome), flush=True)
    return PASSED if outcome.passed else NOT_AS_EXPECTED


def run_experiment(
    experiment: Experiment, out: Path | None, *, in_process: bool, stack: bool = False
) -> Outcome:
    """Run a drawn experiment; what it leaves goes into `out`, or nowhere if that is None.

    Over DDS with `stack` estimator and controller share a process.

    Raises:
        RunError: if it did not come to its end.
        CassieError, ParameterError: naming what cannot be used.
    """
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
    if in_process:
        return _in_process(experiment, out)
    if out is not None:
        return _over_dds(experiment, out, stack)
    with tempfile.TemporaryDirectory(prefix="cassie_") as folder:
        return _over_dds(experiment, Path(folder), stack)


def _in_process(experiment: Experiment, folder: Path | None) -> Outcome:
    store = Store()
    ticks = range(tick_count(experiment))
    bar = tqdm(ticks, unit="tick", disable=not sys.stderr.isatty(), leave=False)
    with stopped_between(bar) as whole:
        if folder is None:
            loop = make_loop(experiment, store)
            wall_time = run(loop, whole)
        else:
            with BagObserver(folder / "bag.mcap", experiment) as bag:
                loop = make_loop(experiment, both(store, bag))
                wall_time = run(loop, whole)
    for node, (problem, time) in loop.problems.items():
        print(f"{node} at {time:.3f} s: {problem}", file=sys.stderr)
    return evaluate(experiment, store.recording(wall_time), "in-process")


@contextmanager
def stopped_between(ticks: Iterable[int]) -> Iterator[Iterator[int]]:
    """Ticks between which alone Ctrl-C ends a run: within one it would tear a record of the bag."""
    with ctrl_c_at_the_end() as came:
        yield itertools.takewhile(lambda _: not came, ticks)


def _over_dds(experiment: Experiment, folder: Path, stack: bool) -> Outcome:
    from cassie_bags.ros.dds_run import run_over_dds

    bag = run_over_dds(experiment, folder, stack=stack)
    broken = lockstep_broken(problems(bag))
    return evaluate(experiment, read_recording(bag), "dds", lockstep_broken=broken)


def keep(
    outcome: Outcome, folder: Path, *, pictures: bool, film: bool = True
) -> tuple[Outcome, Entry]:
    """Leave table, JSON, pictures and page beside the bag.

    Returns:
        The outcome with their names, and what a page says of it.
    """
    from cassie_bags.report.page import page, run_entry

    bag = folder / "bag.mcap"
    files = {"bag": bag, "experiment": folder / "experiment.yaml", "table": folder / "table.txt"}
    write_resolved(outcome.experiment, files["experiment"])
    write_metadata(folder, [contents_of(bag)])
    view = None
    if pictures:
        from cassie_bags.report.pictures import draw
        from cassie_bags.report.view import view_of_run

        view = view_of_run(outcome.experiment, bag)
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


def _interrupt(*_: object) -> None:
    raise KeyboardInterrupt


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="experiment",
        description="Run an experiment file with all nodes as processes. Prints a table on stderr "
        "and, where stdout is no terminal, one line of JSON on stdout.",
        epilog="Exit codes: 0 as expected, 1 not as expected, 2 wrong file or arguments, "
        "3 the run did not come to its end, 130 stopped.",
    )
    parser.add_argument("file", type=Path, help="YAML file, see bags/README.md")
    parser.add_argument("--seed", type=int, default=None, help="seed in place of the file's")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="replace a value of the file: controller.walk.law=paper, operator.3.vx=0.6; "
        "or put in those of a file: @tuned.yaml",
    )
    parser.add_argument(
        "--out", type=Path, default=None, help="keep bag, pictures, table and JSON in this folder"
    )
    how = parser.add_mutually_exclusive_group()
    how.add_argument(
        "--stack", action="store_true", help="estimator and controller in one process, over DDS"
    )
    how.add_argument(
        "--in-process",
        action="store_true",
        help="the same cores in one process, without ROS, as fast as it goes",
    )
    parser.add_argument(
        "--json", action="store_true", help="one line of JSON on stdout, also on a terminal"
    )
    parser.add_argument("--no-pictures", action="store_true", help="with --out: no pictures")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
