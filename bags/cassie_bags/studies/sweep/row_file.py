"""Rows as data: reads files of rows, and makes the trials of a row.

An entry of a file is one row, or several rows under `rows`; what stands beside `rows` holds for
each of them. `each` repeats an entry: it has lists of values, and their names are placeholders.
A row has the keys of `_Head` and `_Run`, one motion, and sections of the experiment file.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any

from cassie_bags.errors import ExperimentError
from cassie_bags.run.yaml_file import read_mapping
from cassie_bags.studies.sweep.course import PUSH_TIME, Budget, push, reached_at, step_time
from cassie_bags.studies.sweep.figures import FIGURES, figure_of
from cassie_bags.studies.sweep.formula import filled, resolved
from cassie_bags.studies.sweep.motions import MOTIONS, Motion
from cassie_bags.studies.sweep.row import Figure, Row
from cassie_bags.studies.trial import Measures, Trial
from cassie_gaits.errors import CassieError
from cassie_gaits.robot import WEIGHT
from cassie_msgs.experiment.expectation import Bound
from cassie_msgs.experiment.file import Experiment
from cassie_msgs.structured import (
    field_value,
    path_of,
    refuse_unknown,
    shown,
    structure,
    structure_entry,
)
from cassie_msgs.tunables import ParameterError, tunable

_STRIDE_SPEED = 0.4  # m/s, speed of the two steps over which obstacles are spread

TRIAL_NAMES = (
    *("level", "seed", "index", "seconds", "phase"),
    *("speed", "reached", "stride", "shift", "fore", "left", "weight"),
)
"""Placeholders of a trial, which a list of `each` may not have as its name."""

_MOST_LEVELS = _MOST_ROWS = 1000
_WITHOUT = ("name", "about", "seed", "drawn", "duration", "start", "expect")
SECTIONS = tuple(key.name for key in fields(Experiment) if key.name not in _WITHOUT)
"""Sections of the experiment file that a row may have."""


@dataclass(frozen=True, kw_only=True)
class _Head:
    """What a row says besides its name, title, target and trials; see `Row`."""

    levels: tuple[float, ...] = tunable((0.0,), description="Settings from easy to hard")
    start: float | None = tunable(None, description="Level that is tried first")
    share: float = tunable(1.0, "", 0.01, 1.0, "Share of the trials that must hold")
    trials: str = tunable(
        "robots",
        choices=("robots", "phases"),
        description="A trial for each robot, or for each time within two steps",
    )
    holds: Mapping[str, Any] = field(default_factory=dict)
    figure: str | None = tunable(None, description="Figure of a trial; without one, the level")
    achieved: str | None = tunable(None, description="Reached speed, if levels are speeds")

    def __post_init__(self) -> None:
        """Refuse a row without levels, and a start that is no level."""
        if not self.levels:
            raise ParameterError("levels must be a list of at least one")
        if self.start is not None and self.start not in self.levels:
            raise ParameterError(f"start = {self.start:g} is not one of the levels")


@dataclass(frozen=True, kw_only=True)
class _Levels:
    """Levels at equal distances."""

    first: float = tunable(MISSING, "", -1e6, 1e6, "First level")
    last: float = tunable(MISSING, "", -1e6, 1e6, "Last level")
    step: float = tunable(MISSING, "", 1e-6, 1e6, "Distance of two levels")

    def values(self) -> list[float]:
        """The levels without rounding errors: 1.2 and not 1.2000000000000002."""
        steps = round((self.last - self.first) / self.step)
        if not 0 <= steps < _MOST_LEVELS:
            raise ParameterError(f"levels: {steps + 1} of them, expected 1 .. {_MOST_LEVELS}")
        return [round(self.first + index * self.step, 9) for index in range(steps + 1)]


@dataclass(frozen=True, kw_only=True)
class _Window:
    """The measured part of a run."""

    seconds: float = tunable(MISSING, "s", 0.1, 1e5, "Length")
    begin: float | None = tunable(None, "s", 0.0, 1e5, "Begin")
    end: float | None = tunable(None, "s", 0.0, 1e5, "End, in place of the begin")

    @property
    def span(self) -> tuple[float, float]:
        """Begin and end. In s."""
        if self.begin is not None and self.end is None:
            return self.begin, self.begin + self.seconds
        if self.end is None or self.begin is not None:
            raise ParameterError("window: expected one of begin and end")
        if self.end < self.seconds:
            raise ParameterError(f"window.end = {self.end:g} s is less than window.seconds")
        return self.end - self.seconds, self.end


@dataclass(frozen=True, kw_only=True)
class _Push:
    """A push on the pelvis."""

    t: float = tunable(MISSING, "s", 0.0, 1e5, "Time at which the push begins")
    impulse: float = tunable(MISSING, "Ns", -1000.0, 1000.0, "Force times time")
    angle_deg: float = tunable(MISSING, "deg", None, None, "Direction from ahead to the left")
    duration: float = tunable(PUSH_TIME, "s", 0.0005, 100.0, "Duration of the push")


@dataclass(frozen=True, kw_only=True)
class _Rising:
    """Where a slope rises: it makes `scene_parameters` of the scenes `slope` and `tilting`."""

    deg: float = tunable(MISSING, "deg", 0.1, 60.0, "Angle of the slope")
    angle_deg: float = tunable(MISSING, "deg", -360.0, 360.0, "Direction from ahead to the left")
    start: float | None = tunable(None, "s", 0.0, 1e5, "Time at which level ground begins to tilt")
    rate_deg: float = tunable(5.0, "deg/s", 0.1, 90.0, "Rate at which it tilts")

    def scene_parameters(self) -> dict[str, float]:
        """Rises ahead and to the left, and the rate of the greater one."""
        angle, slope = math.radians(self.angle_deg), math.tan(math.radians(self.deg))
        along = (slope * math.cos(angle), slope * math.sin(angle))
        ahead, left = (math.degrees(math.atan(rise)) for rise in along)
        if self.start is None:
            # Ground that does not rise sideways has no slope under the feet; so it rises a little.
            return {"rise_deg": ahead, "side_deg": left if abs(left) > 1e-3 else 1e-3}
        rate = self.rate_deg * max(abs(ahead), abs(left)) / self.deg
        return {"rise_deg": ahead, "side_deg": left, "start": self.start, "rate_deg": rate}


@dataclass(frozen=True, kw_only=True)
class _Run:
    """What a row says of its trials, besides the motion and the sections of the experiment."""

    window: _Window | None = None
    push: _Push | None = None
    rising: _Rising | None = None
    ahead: float | None = tunable(None, "m", 0.1, 1e5, "Distance at which a run ends early")
    history: float | None = tunable(None, "s", 1.0, 1e5, "Last part that is held in memory")
    change: str | None = tunable(None, description="key=value for every run")
    reference: str | None = tunable(None, description="key=value for a second run, the reference")


_HEAD = tuple(key.name for key in fields(_Head))
_RUN = tuple(key.name for key in fields(_Run))
_TARGETS = ("at_least", "at_most", "counts")
_AT_ONCE = ("levels", "start", "share", "trials")  # with no placeholder of a trial
KEYS = ("name", "title", "each", "rows", *_TARGETS, *_HEAD, *MOTIONS, *_RUN, *SECTIONS)
"""Keys of an entry."""

_NAME = re.compile(r"\w+\.[\w.+-]+")


class _Data:
    """A row's entry, with the values of its lists in `each` by name."""

    def __init__(self, entry: Mapping[str, Any], names: Mapping[str, Any]) -> None:
        self.names = names
        head = {key: entry[key] for key in _HEAD if key in entry}
        head |= {key: resolved(head[key], names, key) for key in _AT_ONCE if key in head}
        if isinstance(head.get("levels"), Mapping):
            head["levels"] = structure(_Levels, head["levels"], "levels").values()
        self.head = structure(_Head, head)
        self.motion = _only(entry, MOTIONS)
        inside = (self.motion, *_RUN, *SECTIONS)
        self.content = {key: given for key, given in entry.items() if key in inside}

    def trials(self, budget: Budget, level: float) -> list[Trial]:
        """Trials of a level: one for each robot, or at each phase of two steps."""
        if self.head.trials == "robots":
            seeds = range(budget.first, budget.first + budget.seeds)
            return [self.trial(budget, level, seed, seed - 1) for seed in seeds]
        phases = budget.each_phase(self.moved(self.values(budget, level)).forward)
        return [
            self.trial(budget, level, seed, index, phase=delay)
            for index, (delay, seed) in enumerate(phases)
        ]

    def values(
        self, budget: Budget, level: float, seed: int = 1, index: int = 0, **phase: float
    ) -> dict[str, Any]:
        """Values of the placeholders of a trial, but for those about the motion's speed."""
        angle = 0.5 * math.pi * index
        return {
            **self.names,
            **phase,
            "level": level,
            "seed": seed,
            "index": index,
            "seconds": budget.seconds,
            "stride": _stride,
            "shift": lambda: _stride() * (seed - budget.first) / budget.seeds,
            "fore": math.cos(angle),
            "left": math.sin(angle),
            "weight": WEIGHT,
        }

    def trial(self, budget: Budget, level: float, seed: int, index: int, **phase: float) -> Trial:
        """The trial with a number, by which values are taken in turn."""
        names = self.values(budget, level, seed, index, **phase)
        motion = self.moved(names)
        names |= {"speed": motion.fastest, "reached": reached_at(motion.fastest)}
        given = {key: resolved(entry, names, key) for key, entry in self.content.items()}
        run = structure(_Run, {key: given[key] for key in _RUN if key in given})
        window = motion.window(budget) if run.window is None else run.window.span
        content: dict[str, Any] = {}
        for key, entry in given.items():
            if key == "push" and run.push is not None:
                content["pushes"] = [push(*dataclasses.astuple(run.push))]
            elif key == "rising" and run.rising is not None:
                content["scene_parameters"] = run.rising.scene_parameters()
            elif key in SECTIONS:
                field_value(Experiment, key, entry)
                content[key] = entry
        then = [*content.pop("operator", ()), *motion.commands(seed, window[1])]
        made = motion.trial(budget, seed, window, then, **content)
        return dataclasses.replace(
            made,
            ahead=made.ahead if run.ahead is None else run.ahead,
            changes=made.changes if run.change is None else (*made.changes, run.change),
            reference=None if run.reference is None else (run.reference,),
            history=run.history,
        )

    def moved(self, names: Mapping[str, Any]) -> Motion:
        """The motion with values for its placeholders."""
        content = resolved(self.content[self.motion], names, self.motion)
        return structure(MOTIONS[self.motion], content, self.motion)

    def holds(self, measures: Measures, level: float) -> bool:
        """Whether a trial that did not fall holds at a level."""
        names = self.values(Budget(), level)
        for name, entry in self.head.holds.items():
            where = path_of("holds", name)
            bound = structure_entry(Bound, resolved(entry, names, where), where)
            if not bound.holds(figure_of(name, measures, level)):
                return False
        return self.moved(names).holds(measures)

    def figure(self, text: str | None) -> Figure | None:
        """Function for a figure: its name, or a formula with names of figures."""
        if text is None:
            return None
        words = str(self.names.get(text[1:], text)) if text.startswith("$") else text
        if "$" not in words:
            return lambda measures, level: figure_of(words, measures, level)

        def formula(measures: Measures, level: float) -> float:
            made = {name: make(measures, level) for name, make in FIGURES.items() if name in words}
            known = {**self.names, "level": level, **measures, **made}
            return float(resolved(words, known, "figure"))

        return formula


def _only(entry: Mapping[str, Any], keys: Iterable[str]) -> str:
    """The one of several keys that an entry has."""
    found = [key for key in keys if key in entry]
    if len(found) != 1:
        raise ParameterError(f"expected one of {', '.join(keys)}")
    return found[0]


def _quantity(given: Any, names: Mapping[str, Any], where: str) -> tuple[float, str]:
    """A number and its unit: `0.03 m/s`."""
    word, _, unit = str(given).partition(" ")
    word = str(resolved(word, names, where))
    if not re.fullmatch(r"-?\d+(\.\d*)?(e-?\d+)?", word):
        raise ParameterError(f"{where} = {shown(given)} is not a number and its unit")
    return float(word), filled(unit, names, where)


def _stride() -> float:
    """Length of two steps. In m."""
    return 2.0 * step_time(_STRIDE_SPEED) * _STRIDE_SPEED


@cache
def shipped_rows(*names: str) -> Sequence[Row]:
    """Rows of files of this package, by the files' names."""
    folder = Path(__file__).with_name("rows")
    return [row for name in names for row in read_rows(folder / f"{name}.yaml")]


def read_rows(path: Path) -> list[Row]:
    """The rows of a file.

    Raises:
        ExperimentError: naming file, row, key, value and what is permitted.
    """
    content = read_mapping(path)
    try:
        rows = list(islice(_rows(content, {}, {}, ""), _MOST_ROWS + 1))
        if len(rows) > _MOST_ROWS:
            raise ParameterError(f"it has more than {_MOST_ROWS} rows")
        return rows
    except ParameterError as error:
        raise ExperimentError(f"{path}: {error}") from None


def checked_rows(path: Path, others: Sequence[Row]) -> list[Row]:
    """The rows of a user's file; all experiments and figures are checked before any of them runs.

    Args:
        path: YAML file.
        others: Rows with whose names and titles theirs must not collide.

    Raises:
        ExperimentError: as `read_rows`, and for what experiments do not permit.
    """
    known = {word for row in others for word in (row.name, row.title)}
    rows = read_rows(path)
    for row in rows:
        try:
            for word in (row.name, row.title):
                if word in known:
                    raise ParameterError(f"there is a row {word} already")
                known.add(word)
            _check(row)
        except (ArithmeticError, CassieError, ParameterError) as error:
            raise ExperimentError(f"{path}: row {row.name}: {error}") from None
    return rows


def _check(row: Row) -> None:
    """Make experiments of all levels, and the figures of a run whose measures are all 1."""
    from cassie_bags.studies.run_trial import MEASURES, experiment_of  # loading takes seconds

    measures = {name: 1.0 for word in MEASURES for name in (word, f"reference_{word}")}
    for level in row.levels:
        for trial in row.trials(Budget(seeds=2, phases=2), level):
            experiment_of(trial)
        row.holds(measures, level)
        for figure in (row.figure, row.achieved):
            if figure is not None:
                figure(measures, level)


def _rows(
    entry: Any, shared: Mapping[str, Any], names: Mapping[str, Any], where: str
) -> Iterator[Row]:
    """Rows of an entry.

    Args:
        entry: Content of the entry.
        shared: Keys that it has from around it.
        names: Placeholders that it has from around it.
        where: Path of the entry, for messages.
    """
    if not isinstance(entry, Mapping):
        raise ParameterError(f"{where} = {shown(entry)} is not a row")
    refuse_unknown(entry, KEYS, where)
    own = {**shared, **{key: entry[key] for key in entry if key not in ("each", "rows")}}
    rows = entry.get("rows")
    if "rows" in entry and not (isinstance(rows, list) and rows):
        raise ParameterError(f"{path_of(where, 'rows')} = {shown(rows)} is not a list of rows")
    for values in _each(entry["each"], path_of(where, "each")) if "each" in entry else [{}]:
        known = {**names, **values}
        if rows is None:
            yield _row(own, known, where)
            continue
        for index, inner in enumerate(rows):
            yield from _rows(inner, own, known, path_of(where, f"rows.{index}"))


def _row(entry: Mapping[str, Any], names: Mapping[str, Any], where: str) -> Row:
    for key in ("name", "title"):
        if not isinstance(entry.get(key), str):
            raise ParameterError(f"{path_of(where, key)} must be given: a text")
    name = filled(entry["name"], names, path_of(where, "name"))
    if not _NAME.fullmatch(name):
        raise ParameterError(f"{path_of(where, 'name')} = {shown(name)} is not group.word")
    try:
        kind = _only(entry, _TARGETS)
        if kind == "counts" and entry[kind] is not True:
            raise ParameterError(f"counts = {shown(entry[kind])} is not true")
        target, unit = (100.0, "%") if kind == "counts" else _quantity(entry[kind], names, kind)
        data = _Data(entry, names)
        head = data.head
        return Row(
            name=name,
            title=filled(entry["title"], names, "title", gap=" "),
            unit=unit,
            target=target,
            levels=head.levels,
            trials=data.trials,
            holds=data.holds,
            figure=data.figure(head.figure),
            share=head.share,
            at_least=kind != "at_most",
            counts=kind == "counts",
            start=None if head.start is None else head.levels.index(head.start),
            achieved=data.figure(head.achieved),
        )
    except ParameterError as error:
        raise ParameterError(f"row {name}: {error}") from None


def _each(lists: Any, where: str) -> list[dict[str, Any]]:
    """Value of each placeholder, for each repetition of an entry."""
    if not isinstance(lists, Mapping) or not all(isinstance(x, list) for x in lists.values()):
        raise ParameterError(f"{where} = {shown(lists)} is not a list of values for each name")
    for name in lists:
        if name in TRIAL_NAMES:
            raise ParameterError(f"{where}.{name}: ${name} is a placeholder of every trial")
    counts = {len(values) for values in lists.values()}
    if len(counts) != 1 or 0 in counts:
        given = ", ".join(f"{name} {len(values)}" for name, values in lists.items()) or "none"
        raise ParameterError(f"{where}: expected lists of one length of 1 or more, got {given}")
    return [dict(zip(lists, values, strict=True)) for values in zip(*lists.values(), strict=True)]
