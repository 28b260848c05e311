"""Runs rows of the table of fail-safes and reports those that do not do what it promises."""

from __future__ import annotations

import argparse
import sys
from collections import Counter

from tqdm import tqdm

from cassie_bags.errors import ExperimentError
from cassie_bags.studies.failsafes.rows import ROWS
from cassie_bags.studies.failsafes.table import cases, results, with_table
from cassie_bags.studies.workers import workers
from cassie_msgs.tunables import unknown_name


def run(arguments: argparse.Namespace) -> int:
    """Run the rows, or write their table; returns the exit code."""
    if arguments.list:
        for row in ROWS:
            print(row.name)
        return 0
    names = [row.name for row in ROWS]
    for name in arguments.rows:
        if name not in names:
            raise ExperimentError(unknown_name(name, names, "row"))
    if arguments.write is not None:
        text = arguments.write.read_text(encoding="utf-8")
        arguments.write.write_text(with_table(text), encoding="utf-8")
        return 0
    return _play(arguments)


def _play(arguments: argparse.Namespace) -> int:
    rows = [row for row in ROWS if not arguments.rows or row.name in arguments.rows]
    chosen = cases(rows, arguments.phases, arguments.first)
    planned = Counter((case.row, case.state) for case in chosen)
    safe: Counter[tuple[str, str]] = Counter()
    played: Counter[tuple[str, str]] = Counter()
    print(f"{'row':24}{'state':16}safe", flush=True)
    pool = workers(arguments.jobs, None)
    try:
        with tqdm(total=len(chosen), unit="run", disable=not sys.stderr.isatty()) as bar:
            for case, problem in results(chosen, pool):
                cell = case.row, case.state
                played[cell] += 1
                safe[cell] += not problem
                if problem:
                    bar.write(
                        f"{case.row}, {case.state}, phase {case.phase}: {problem}", sys.stderr
                    )
                if played[cell] == planned[cell]:
                    bar.write(f"{case.row:24}{case.state:16}{safe[cell]} of {played[cell]}")
                bar.update()
    finally:
        pool.close()
    total, good = sum(played.values()), sum(safe.values())
    last = arguments.first + arguments.phases - 1
    print(f"phases {arguments.first} to {last}: {good} of {total} runs as the table promises")
    return 0 if good == total else 1
