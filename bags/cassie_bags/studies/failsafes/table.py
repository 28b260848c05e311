"""Runs the rows at random times, and writes them as a table."""

from __future__ import annotations

import argparse
import contextlib
import sys
import zlib
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cassie_bags.errors import ExperimentError
from cassie_bags.run.experiment import read_experiment
from cassie_bags.run.progress import progress_bar
from cassie_bags.run.seed import resolve
from cassie_bags.studies.failsafes.participants import UnsafeError
from cassie_bags.studies.failsafes.rows import ROWS, SPEEDS, FailSafe
from cassie_bags.studies.results import markdown
from cassie_bags.studies.sweep.course import Budget
from cassie_bags.studies.sweep.motions import Ride
from cassie_bags.studies.workers import workers
from cassie_msgs.experiment.file import Experiment
from cassie_msgs.tunables import unknown_name

BEGIN, END = "<!-- fail-safes: begin -->", "<!-- fail-safes: end -->"
"""Lines of a README before and after the table."""


@dataclass(frozen=True)
class Case:
    """One run of a row.

    Attributes:
        row: Name of the row.
        state: Activity of the robot before, a key of `SPEEDS`.
        phase: Number of the run; it decides robot, time and details.
    """

    row: str
    state: str
    phase: int


def cases(rows: Sequence[FailSafe], phases: int, first: int = 0) -> list[Case]:
    """All runs of some rows, `phases` runs for each state."""
    return [
        Case(row.name, state, phase)
        for row in rows
        for state in row.states
        for phase in range(first, first + phases)
    ]


def run_case(case: Case) -> str:
    """Run a case; returns the problem in words, empty if there is none."""
    from cassie_bags.studies.failsafes.wall_paced import WallPaced  # loading it takes seconds

    row = next(row for row in ROWS if row.name == case.row)
    stream = zlib.crc32(f"{case.row}/{case.state}".encode())
    rng = np.random.default_rng([stream, case.phase])
    begins = (15.0 if case.state == "ride" else 4.5) + float(rng.uniform(0.0, 1.0))
    if case.state == "walk":
        begins += 2.0  # until the speed is reached
    run = WallPaced(_experiment(case, begins, row.sections(rng, begins)))
    try:
        run.run(begins)
        if case.state != "stand" and run.mode.name not in ("WALK", "SEGWAY"):
            return f"did not get to {case.state}: {run.describe()}"
        row.test(run, rng, case.state)
    except UnsafeError as error:
        return str(error)
    return ""


def _experiment(case: Case, begins: float, sections: dict[str, Any]) -> Experiment:
    content: dict[str, Any] = {
        "name": case.row,
        "seed": 1 + case.phase,
        "duration": begins + 60.0,
        "start": "standing",
        "operator": [{"t": 0.0, "power": True, "mode": "stand", "height": 0.95}],
    }
    if case.state == "ride":
        window = 0.0, content["duration"]
        ride = Ride(surface="floor").trial(Budget(), 0, window, (), rider={"targets": []})
        content |= ride.content
    elif SPEEDS[case.state] is not None:
        content["operator"] += [{"t": 1.5, "mode": "walk"}, {"t": 3.0, "vx": SPEEDS[case.state]}]
    return resolve(read_experiment({**content, **sections}))


_VERBS = {
    "stand": "stands",
    "step in place": "steps in place",
    "walk": "walks at 0.8 m/s",
    "ride": "rides",
}


def with_table(text: str) -> str:
    """A README's text with the present table.

    Raises:
        ValueError: if the lines before and after the table are missing.
    """
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise ValueError(f"the lines {BEGIN} and {END} are missing")
    rows = [
        ["what happens", "tried while it", "acts within", "what the robot does", "how to go on"]
    ]
    for row in ROWS:
        states = ", ".join(_VERBS[state] for state in row.states)
        rows.append([row.trigger, states, row.time, row.action, row.recovery])
    table = "\n".join(markdown(rows))
    return f"{before}{BEGIN}\n{table}\n{END}{after}"


def run(arguments: argparse.Namespace) -> int:
    """Run the rows, or write their table; returns the exit code."""
    if arguments.list:
        for row in ROWS:
            print(row.name)
        return 0
    names = [row.name for row in ROWS]
    if unknown := [name for name in arguments.rows if name not in names]:
        raise ExperimentError(unknown_name(unknown[0], names, "row"))
    if arguments.write is not None:
        text = arguments.write.read_text(encoding="utf-8")
        arguments.write.write_text(with_table(text), encoding="utf-8")
        return 0
    return _run_rows(arguments)


def _run_rows(arguments: argparse.Namespace) -> int:
    rows = [row for row in ROWS if not arguments.rows or row.name in arguments.rows]
    chosen = cases(rows, arguments.phases, arguments.first)
    safe: defaultdict[tuple[str, str], list[bool]] = defaultdict(list)
    print(f"{'row':24}{'state':16}safe", flush=True)
    bar = progress_bar("run", len(chosen))
    with contextlib.closing(workers(arguments.jobs, None)) as pool, bar:
        for index, problem in pool.results(run_case, chosen):
            case = chosen[index]
            done = safe[case.row, case.state]
            done.append(not problem)
            if problem:
                bar.write(f"{case.row}, {case.state}, phase {case.phase}: {problem}", sys.stderr)
            if len(done) == arguments.phases:
                bar.write(f"{case.row:24}{case.state:16}{sum(done)} of {len(done)}")
            bar.update()
    total, good = len(chosen), sum(map(sum, safe.values()))
    last = arguments.first + arguments.phases - 1
    print(f"phases {arguments.first} to {last}: {good} of {total} runs as the table promises")
    return 0 if good == total else 1
