"""Sweeps from a command line: rows with every variant; results are stored after each row."""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import shlex
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from cassie_bags.errors import ExperimentError
from cassie_bags.run.progress import progress_bar
from cassie_bags.run.provenance import Origin, origin
from cassie_bags.run.yaml_file import spelled_out
from cassie_bags.studies.results import check_file
from cassie_bags.studies.sweep.course import PAPER_LAW, Budget, walk
from cassie_bags.studies.sweep.results_file import MEASURED, PAPERS, merge
from cassie_bags.studies.sweep.row import Row, RowResult, measure_row
from cassie_bags.studies.sweep.row_file import checked_rows
from cassie_bags.studies.sweep.table import (
    all_rows,
    cell,
    chosen_rows,
    load,
    read_rows,
    save,
    table,
)
from cassie_bags.studies.trial import SEEDS
from cassie_bags.studies.workers import CachedWorkers, Workers, completed, workers

if TYPE_CHECKING:
    from tqdm import tqdm

FULL = {"seeds": SEEDS, "phases": 10, "seconds": 40.0}
QUICK = {"seeds": 3, "phases": 5, "seconds": 15.0}
"""Extent of the runs, by default and with --quick."""


def run(arguments: argparse.Namespace) -> int:
    """Measure rows; returns the exit code."""
    own = [] if arguments.own is None else checked_rows(arguments.own, all_rows())
    every = [*all_rows(), *own]
    if arguments.list:
        for row in every:
            print(f"{row.name:24} {row.title}")
        return 0
    for name, value in (QUICK if arguments.quick else FULL).items():
        if getattr(arguments, name) is None:
            setattr(arguments, name, value)
    arguments.compare = arguments.compare or PAPER_LAW
    rows = chosen_rows(arguments.rows, own)
    if arguments.results is not None:
        _check_mergeable(arguments)
    arguments.out.mkdir(parents=True, exist_ok=True)
    made = origin(command(arguments), seeds(arguments), arguments.now)
    results = _measure(rows, every, arguments, made)
    shipped = results[_variant(arguments, MEASURED)]
    return 0 if all(shipped[row.name].met for row in rows) else 1


def command(arguments: argparse.Namespace) -> str:
    """The command that repeats the measurement, without options that do not change results."""
    measured = {
        "--rows": arguments.own,
        "--seeds": arguments.seeds,
        "--first": None if arguments.first == 1 else arguments.first,
        "--phases": arguments.phases,
        "--seconds": f"{arguments.seconds:g}",
        "--beyond": arguments.beyond,
    }
    compared = {
        "--compare": None if arguments.compare == PAPER_LAW else arguments.compare,
        "--compare-seeds": arguments.compare_seeds,
    }
    options = [*measured.items(), *(("--set", change) for change in arguments.set)]
    options += [] if arguments.no_compare else compared.items()
    words = [word for option in options if option[1] is not None for word in map(str, option)]
    words += ["--no-compare"] * arguments.no_compare
    return shlex.join(["ros2", "run", "cassie_bags", "sweep", *arguments.rows, *words])


def seeds(arguments: argparse.Namespace) -> str:
    """Seeds of the drawn robots, in words."""
    first, every = arguments.first, _span(arguments.first, arguments.seeds)
    fewer = arguments.compare_seeds or arguments.seeds
    if arguments.no_compare or fewer >= arguments.seeds:
        return every
    return f"{every}; {_compared(arguments)} {_span(first, fewer)}"


def _compared(arguments: argparse.Namespace) -> str:
    """Name of the law that is compared."""
    return PAPERS if arguments.compare == PAPER_LAW else str(arguments.compare)


def _span(first: int, count: int) -> str:
    """Seeds in words."""
    return f"{first} to {first + count - 1}" if count > 1 else f"{first}"


def _variant(arguments: argparse.Namespace, name: str) -> str:
    """Name of a variant, which names the robots unless they are the first ones."""
    if arguments.first == 1:
        return name
    robots = f"robots {_span(arguments.first, arguments.seeds)}"
    return robots if name == MEASURED else f"{name}, {robots}"


def _measure(
    rows: list[Row], every: list[Row], arguments: argparse.Namespace, made: Origin
) -> dict[str, dict[str, RowResult]]:
    """Measure rows, each with every variant; all results so far are stored after each row.

    Args:
        rows: Rows to measure.
        every: All known rows, in the order of the table.
        arguments: Arguments of the command.
        made: Origin of the results.
    """
    from cassie_bags.studies.run_trial import experiment_of  # loading robot and law takes seconds

    extent = arguments.seeds, arguments.phases, arguments.seconds, arguments.beyond
    budget = Budget(*extent, spelled_out(arguments.set), arguments.first)
    shipped = _variant(arguments, MEASURED)
    variants = {shipped: budget}
    if not arguments.no_compare:
        few = arguments.compare_seeds or max(budget.seeds, budget.phases)
        variants[_variant(arguments, _compared(arguments))] = dataclasses.replace(
            budget,
            seeds=min(few, budget.seeds),
            phases=min(few, budget.phases),
            changes=(*budget.changes, *spelled_out([arguments.compare])),
        )
    for of_variant in variants.values():
        experiment_of(walk(1, (0.0, 1.0), changes=of_variant.changes))
    file, order = arguments.out / "sweeps.json", [row.title for row in every]
    results: dict[str, dict[str, RowResult]] = {name: {} for name in variants}
    if arguments.resume:
        for name, found in load(file, every, budget).items():
            results.setdefault(name, {}).update(found)
    open_rows = [
        (row, name, of_variant)
        for row in rows
        for name, of_variant in variants.items()
        if row.name not in results[name]
    ]
    try:
        for row, name, result in _measured(open_rows, arguments):
            results[name][row.name] = dataclasses.replace(result, origin=made)
            save(file, every, results, budget)
    finally:
        if measured := [row for row in rows if row.name in results[shipped]]:
            print(table(measured, results))
        if done := [row for row in every if row.name in results[shipped]]:
            (arguments.out / "sweeps.txt").write_text(table(done, results) + "\n", "utf-8")
            stored = read_rows(file)
            text = merge("# Results of sweeps\n", stored, order)
            (arguments.out / "sweeps.md").write_text(text, "utf-8")
            from cassie_bags.studies.sweep.picture import draw  # loading matplotlib takes a second

            draw(arguments.out / "sweeps.png", stored)
    if arguments.results is not None:
        text = merge(_text(arguments.results), read_rows(file), order)
        arguments.results.write_text(text, "utf-8")
    return results


def _check_mergeable(arguments: argparse.Namespace) -> None:
    """Check that these results are for a file of results, and that the file can take them."""
    if arguments.set or arguments.compare != PAPER_LAW:
        raise ExperimentError("--results takes the robot as it is: leave out --set and --compare")
    check_file(arguments.results)
    merge(_text(arguments.results), [], [])


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8") if path.is_file() else "# Results\n"


def _measured(
    open_rows: list[tuple[Row, str, Budget]], arguments: argparse.Namespace
) -> Iterator[tuple[Row, str, RowResult]]:
    """Row, variant and result, as they complete; enough rows at once to keep the workers busy."""
    bar = progress_bar("run")
    pool = CachedWorkers(workers(arguments.jobs, arguments.scheduler))
    lanes = max(1, 2 * pool.count // max(arguments.seeds, arguments.phases))
    # The pool is closed before the threads that wait for the pool.
    with ThreadPoolExecutor(lanes) as threads, contextlib.closing(pool), bar:
        futures = {threads.submit(_row, *entry, pool, bar): entry for entry in open_rows}
        try:
            for future in completed(futures):
                row, name, _ = futures[future]
                yield row, name, future.result()
        finally:
            threads.shutdown(wait=False, cancel_futures=True)


def _row(row: Row, variant: str, budget: Budget, pool: Workers, bar: tqdm) -> RowResult:
    from cassie_bags.studies.run_trial import run_trial

    def progress(word: str) -> None:
        bar.update()
        bar.set_postfix_str(word)

    try:
        result = measure_row(row, budget, partial(pool.results, run_trial), progress)
    except ExperimentError as error:
        result = RowResult(row.name, float("nan"), False, [], " ".join(str(error).split()))
    bar.write(f"{row.title} ({variant}): {cell(result)}", file=sys.stderr)
    return result
