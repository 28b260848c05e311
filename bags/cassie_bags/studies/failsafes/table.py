"""Runs the rows at random times, and writes them as a table."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cassie_bags.run.experiment import read_experiment
from cassie_bags.run.seed import resolve
from cassie_bags.studies.failsafes.people import UnsafeError
from cassie_bags.studies.failsafes.rows import ROWS, SPEEDS, Row
from cassie_bags.studies.workers import Workers
from cassie_msgs.experiment.file import Experiment

BEGIN, END = "<!-- fail-safes: begin -->", "<!-- fail-safes: end -->"
"""Lines of a README before and after the table."""

_LET_GO = 10.0  # s, time at which the operator lets go of the Segway


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


def cases(rows: Sequence[Row], phases: int, first: int = 0) -> list[Case]:
    """All runs of some rows, `phases` runs for each state."""
    return [
        Case(row.name, state, phase)
        for row in rows
        for state in row.states
        for phase in range(first, first + phases)
    ]


def play(case: Case) -> str:
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
        row.play(run, rng, case.state)
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
        content |= {
            "scene": "segway",
            "scene_parameters": {"let_go": _LET_GO},
            "start": "gantry",
            "gantry": [
                {"t": 0.02, "hold": 1.35, "speed": 1.0},
                {"t": 1.0, "height": 0.785, "speed": 0.3},
            ],
            "operator": [
                {"t": 0.0, "power": True, "mode": "stand", "height": 0.65},
                {"t": 5.0, "mode": "segway"},
            ],
            "rider": {"targets": [{"t": 11.0, "speed": 0.0, "heading": 0.0}]},
        }
    elif SPEEDS[case.state] is not None:
        content["operator"] += [{"t": 1.5, "mode": "walk"}, {"t": 3.0, "vx": SPEEDS[case.state]}]
    return resolve(read_experiment({**content, **sections}))


def results(chosen: Sequence[Case], pool: Workers) -> Iterator[tuple[Case, str]]:
    """Each case and its problem, empty if there is none, in the order of completion."""
    for index, problem in pool.results(play, chosen):
        yield chosen[index], problem


def markdown(rows: Sequence[Row] = ROWS) -> str:
    """The rows as a table for a README."""
    lines = [
        "| what happens | tried while it | acts within | what the robot does | how to go on |",
        "|---|---|---|---|---|",
    ]
    lines += [
        f"| {row.trigger} | {', '.join(_VERBS[state] for state in row.states)} | {row.time} | "
        f"{row.action} | {row.recovery} |"
        for row in rows
    ]
    return "\n".join(lines)


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
    return f"{before}{BEGIN}\n{markdown()}\n{END}{after}"
