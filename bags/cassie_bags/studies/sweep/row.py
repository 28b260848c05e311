"""A row of the table of capabilities, and how it is measured."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from cassie_bags.run.provenance import Origin
from cassie_bags.studies.sweep.course import Budget
from cassie_bags.studies.trial import Measures, Trial

Figure = Callable[[Measures, float], float]
"""Figure of a trial: a function of the trial's measures and the level."""


@dataclass(frozen=True)
class Capability:
    """What a row is about, and its target.

    Attributes:
        name: Unique name, group.word.
        title: Title for readers.
        unit: Unit of the figure.
        target: Figure to reach. In `unit`.
        at_least: Whether figures above the target are better.
    """

    name: str
    title: str
    unit: str
    target: float
    at_least: bool = field(default=True, kw_only=True)

    @property
    def group(self) -> str:
        """First part of the name."""
        return self.name.partition(".")[0]

    @property
    def bound(self) -> str:
        """The target with its unit, and a sign for the side on which figures must lie."""
        return f"{'≥' if self.at_least else '≤'} {self.target:g} {self.unit}".rstrip()


@dataclass(frozen=True)
class Row(Capability):
    """One capability, a row of the table, and how it is measured.

    The levels are settings of rising difficulty, such as the strength of a push. A level holds
    if at least `share` of its trials hold. From `first` on, harder levels are tried until one
    does not hold. If `first` does not hold, easier levels are tried until one holds.

    Attributes:
        levels: Settings from easy to hard.
        trials: Makes the trials of a level.
        holds: Whether a trial that did not fall holds at a level.
        figure: Figure of a trial, or None if the level itself is the figure.
        share: Share of the trials that must hold.
        counts: Whether the figure is the share of the trials that hold, in percent.
        start: Index of the level to try first; None: that of the target, or else the easiest.
        achieved: Speed that a trial reached, if levels are commanded speeds; else None. In m/s.
    """

    levels: Sequence[float]
    trials: Callable[[Budget, float], list[Trial]]
    holds: Callable[[Measures, float], bool] = lambda measures, level: True
    figure: Figure | None = None
    share: float = 1.0
    counts: bool = False
    start: int | None = None
    achieved: Figure | None = None

    @property
    def first(self) -> int:
        """Index of the level that is tried first."""
        if self.start is not None:
            return self.start
        return self.levels.index(self.target) if self.target in self.levels else 0


@dataclass(frozen=True)
class Level:
    """Result of one level.

    Attributes:
        level: Setting of the level.
        planned: Number of trials of the level.
        run: Number of trials that were run before the level was decided.
        held: Number of trials that held.
        fell: Number of trials that fell.
        worst: Worst figure of the trials that did not fall; NaN if there is none.
        mean: Mean figure of the trials that did not fall; NaN if there is none.
        passed: Whether the level holds.
        missed: Seeds of the trials that did not hold, in the order of completion.
        achieved: Speed of each trial that did not fall, in the order of the trials; None if the
            level commands no speed. In m/s.
        alarmed: Number of run trials with a false alarm: a healthy sensor was rejected.
        seconds: Robot time of all run trials. In s.
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
    """Result of a row.

    Attributes:
        name: Name of the row.
        measured: Figure; NaN if no level holds.
        met: Whether the figure reaches the target.
        levels: Results of all tried levels, in order.
        problem: Reason why the row could not be measured, or empty.
        origin: Origin of the figure; None if unknown.
    """

    name: str
    measured: float
    met: bool
    levels: list[Level] = field(default_factory=list)
    problem: str = ""
    origin: Origin | None = None

    @property
    def open_ended(self) -> bool:
        """Whether every level that was tried holds, so that the limit is beyond these levels."""
        return bool(self.levels) and all(level.passed for level in self.levels)


Results = Callable[[Sequence[Trial]], Iterable[tuple[int, Measures]]]
"""Runs trials; gives index and measures of each on completion."""

Progress = Callable[[str], Any]
"""Gets a text about each completed trial."""


def measure_row(row: Row, budget: Budget, results: Results, progress: Progress) -> RowResult:
    """Measure a row with trials of some extent.

    Raises:
        ExperimentError: if the trials cannot be run; the text names the key or parameter.
    """
    tried: dict[int, Level] = {}

    def holds(index: int) -> bool:
        trials = row.trials(budget, row.levels[index])
        tried[index] = measure_level(row, row.levels[index], trials, results, progress)
        return tried[index].passed

    index, last = row.first, len(row.levels) - 1
    spare = math.inf if budget.beyond is None else budget.beyond
    if holds(index):
        while index < last:
            # The figure of a level at the target may be just short of it: then the next one counts.
            spare -= _meets(row, _figure(row, tried[index]))
            if spare < 0 or not holds(index + 1):
                break
            index += 1
    else:
        while index > 0 and not holds(index - 1):
            index -= 1
    passed = [index for index, level in tried.items() if level.passed]
    best = tried[max(passed)] if passed else None
    measured = _figure(row, best or tried[row.first])
    met = _meets(row, measured) and (row.figure is None or row.counts or best is not None)
    return RowResult(row.name, measured, met, list(tried.values()))


def measure_level(
    row: Row, level: float, trials: Sequence[Trial], results: Results, progress: Progress
) -> Level:
    """Run the trials of a level; stop once the level is decided, unless every trial counts."""
    needed = math.ceil(row.share * len(trials) - 1e-9)
    decides = (row.figure is None or len(row.levels) > 1) and not row.counts
    measured: dict[int, Measures] = {}
    missed: list[int] = []
    for index, measures in results(trials):
        measured[index] = measures
        if measures["fell"] or not row.holds(measures, level):
            missed.append(trials[index].seed)
        held = len(measured) - len(missed)
        progress(f"{row.name} {level:g}: {held}/{len(measured)}")
        if decides and len(missed) > len(trials) - needed:
            break
    upright = {index: each for index, each in measured.items() if not each["fell"]}
    figures = [row.figure(each, level) for each in upright.values()] if row.figure else []
    figures = list(filter(math.isfinite, figures))
    return Level(
        level=level,
        planned=len(trials),
        run=len(measured),
        held=held,
        fell=len(measured) - len(upright),
        worst=(min if row.at_least else max)(figures, default=math.nan),
        mean=sum(figures) / len(figures) if figures else math.nan,
        passed=held >= needed,
        missed=missed,
        achieved=row.achieved and [row.achieved(upright[i], level) for i in sorted(upright)],
        alarmed=sum(each["false_alarms"] > 0.0 for each in measured.values()),
        seconds=sum(each["end"] for each in measured.values()),
    )


def _meets(row: Row, figure: float) -> bool:
    return figure >= row.target - 1e-9 if row.at_least else figure <= row.target + 1e-9


def _figure(row: Row, level: Level) -> float:
    if row.counts:
        return 100.0 * level.held / level.planned
    if row.figure is not None:
        return level.worst
    return level.level if level.passed else math.nan
