"""A row of the table of capabilities, and how it is measured."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from cassie_bags.run.provenance import Origin
from cassie_bags.studies.sweep.course import Budget
from cassie_bags.studies.trial import Measures, Trial
from cassie_bags.studies.workers import Workers

Figure = str | Callable[[Measures, float], float]
"""Figure of a trial: its name, or what makes it of the measures of a trial and the level."""


@dataclass(frozen=True)
class Row:
    """One capability.

    The levels are settings of rising difficulty, such as the strength of a push. A level holds
    if at least `share` of its trials do. From `first` on, levels are tried upwards until one
    does not hold; or downwards until one does.

    Attributes:
        name: group.word, unique.
        title: For people.
        unit: Of the figure.
        target: To reach. In `unit`.
        levels: From easy to hard.
        trials: Trials of a level.
        holds: Whether a trial that did not fall holds at a level.
        figure: Figure of a trial, or None if the level itself is the figure.
        share: Of the trials that must hold.
        at_least: Whether more than the target is better.
        counts: The figure is the share of the trials that hold, in percent.
        start: Index of the level to try first; None: that of the target, or else the easiest.
        achieved: Speed that a trial reached, by which its level commands one; None if the levels
            are no speeds. In m/s.
    """

    name: str
    title: str
    unit: str
    target: float
    levels: Sequence[float]
    trials: Callable[[Budget, float], list[Trial]]
    holds: Callable[[Measures, float], bool] = lambda measures, level: True
    figure: Figure | None = None
    share: float = 1.0
    at_least: bool = True
    counts: bool = False
    start: int | None = None
    achieved: Figure | None = None

    @property
    def group(self) -> str:
        """First part of the name."""
        return self.name.partition(".")[0]

    @property
    def first(self) -> int:
        """Index of the level to try first."""
        if self.start is not None:
            return self.start
        return self.levels.index(self.target) if self.target in self.levels else 0


@dataclass(frozen=True)
class Level:
    """What came of one level.

    Attributes:
        level: The setting.
        planned: Trials it has.
        run: Trials that were run before it was decided.
        held: Trials that held.
        fell: Trials that fell.
        worst: Worst figure of those that did not fall; NaN if there is none.
        mean: Their mean.
        passed: Whether the level holds.
        missed: Seeds of the trials that did not hold, in the order they ended.
        achieved: Speed of each trial that did not fall, in the order of the trials; None if the
            level commands no speed. In m/s.
        alarmed: Trials in which a healthy sensor was not believed, of those run.
        seconds: Robot time of those run. In s.
    """

    level: float
    planned: int
    run: int
    held: int
    fell: int
    worst: float
    mean: float
    passed: bool
    missed: Sequence[int] = ()
    achieved: Sequence[float] | None = None
    alarmed: int = 0
    seconds: float = 0.0


@dataclass(frozen=True)
class RowResult:
    """What came of a row.

    Attributes:
        name: Of the row.
        measured: Figure; NaN if no level holds.
        met: Whether it reaches the target.
        levels: All that were tried, in the order they were.
        problem: Why it could not be measured, or empty.
        origin: With what it was measured; None if that was not noted.
    """

    name: str
    measured: float
    met: bool
    levels: list[Level] = field(default_factory=list)
    problem: str = ""
    origin: Origin | None = None

    @property
    def open_ended(self) -> bool:
        """Whether every level that was tried holds, so that the limit lies beyond."""
        return bool(self.levels) and all(level.passed for level in self.levels)


Progress = Callable[[str], Any]
"""Gets a word on each trial that has ended."""


def measure_row(
    row: Row,
    budget: Budget,
    workers: Workers,
    progress: Progress,
    run: Callable[[Trial], Measures],
) -> RowResult:
    """Measure a row.

    Args:
        row: What is measured.
        budget: How much is run.
        workers: Who compute it.
        progress: Told after each trial.
        run: Runs a trial.

    Raises:
        ExperimentError: if its trials cannot be run, naming the key or parameter.
    """
    tried: dict[int, Level] = {}

    def holds(index: int) -> bool:
        tried[index] = measure_level(row, row.levels[index], budget, workers, progress, run)
        return tried[index].passed

    index, last = row.first, len(row.levels) - 1
    spare = math.inf if budget.beyond is None else budget.beyond
    if holds(index):
        while index < last:
            # A level may lie at the target and its figure a hair short of it: the next counts.
            spare -= _meets(row, _figure(row, tried[index]))
            if spare < 0 or not holds(index + 1):
                break
            index += 1
    else:
        while index > 0 and not holds(index - 1):
            index -= 1
    passed = [index for index, level in tried.items() if level.passed]
    best = tried[max(passed)] if passed else None
    measured = _figure(row, best if best is not None else tried[row.first])
    met = _meets(row, measured)
    if row.figure is not None and not row.counts:
        met = met and best is not None
    return RowResult(row.name, measured, met, list(tried.values()))


def measure_level(
    row: Row,
    level: float,
    budget: Budget,
    workers: Workers,
    progress: Progress,
    run: Callable[[Trial], Measures],
) -> Level:
    """Run the trials of a level, until it is decided unless each of them counts."""
    trials = row.trials(budget, level)
    needed = math.ceil(row.share * len(trials) - 1e-9)
    done = held = fell = alarmed = 0
    seconds = 0.0
    figures: list[float] = []
    missed: list[int] = []
    achieved: dict[int, float] = {}
    results = workers.results(run, trials)
    for index, result in results:
        done += 1
        fallen = result["fell"] > 0.0
        good = not fallen and row.holds(result, level)
        held, fell = held + good, fell + fallen
        alarmed += result["false_alarms"] > 0.0
        seconds += result["end"]
        missed += [] if good else [trials[index].seed]
        if row.figure is not None and not fallen:
            figure = value(row.figure, result, level)
            figures += [figure] if math.isfinite(figure) else []
        if row.achieved is not None and not fallen:
            achieved[index] = value(row.achieved, result, level)
        progress(f"{row.name} {level:g}: {held}/{done}")
        decides = row.figure is None or len(row.levels) > 1
        if decides and not row.counts and done - held > len(trials) - needed:
            break
    worst = (min if row.at_least else max)(figures, default=math.nan)
    mean = sum(figures) / len(figures) if figures else math.nan
    passed = held >= needed
    speeds = None if row.achieved is None else [achieved[index] for index in sorted(achieved)]
    counted = len(trials), done, held, fell, worst, mean, passed, missed, speeds, alarmed, seconds
    return Level(level, *counted)


def value(figure: Figure, measures: Measures, level: float) -> float:
    """A figure of a trial."""
    return measures[figure] if isinstance(figure, str) else figure(measures, level)


def _meets(row: Row, figure: float) -> bool:
    return figure >= row.target - 1e-9 if row.at_least else figure <= row.target + 1e-9


def _figure(row: Row, level: Level) -> float:
    if row.counts:
        return 100.0 * level.held / level.planned
    if row.figure is not None:
        return level.worst
    return level.level if level.passed else math.nan
