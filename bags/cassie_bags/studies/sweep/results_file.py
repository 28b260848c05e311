"""Results of sweeps as Markdown, with the run that measured each; new results replace old ones.

A file of results has a section for each kind of rows, with one table, and a section that lists
the runs. Anything else in the file is kept, so that people can write beside the tables.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from cassie_bags.errors import ExperimentError
from cassie_bags.run.provenance import Origin
from cassie_bags.studies.results import markdown, table_of, with_table
from cassie_bags.studies.sweep.table import StoredRow, reached

SECTIONS = {"stand": "Standing", "segway": "Riding a Segway", "": "Walking"}
"""Heading of a row's section by the beginning of the row's name; the first match counts."""

RUNS = "Runs"
"""Heading of the section that lists the runs; new sections are put above it."""

MEASURED, PAPERS = "measured", "paper's law"
"""Names of the shipped law with the first robots, and of the paper's."""

NOT_NOTED = "-"
"""Text in place of an unknown run."""

_ORDER = ("Walking", "Standing", "Riding a Segway")
_TITLE, _TARGET, _MET, _RUN = "capability", "target", "met", "run"
_RUN_COLUMNS = {
    "date": "date",
    "seeds": "robots",
    "revision": "revision",
    "machine": "machine",
    "versions": "versions",
    "command": "command",
}


@dataclass(frozen=True)
class _Cell:
    """Result of a row with one variant."""

    value: str
    met: str
    origin: Origin | None


@dataclass
class _Line:
    """A line of a table of results."""

    target: str
    cells: dict[str, _Cell] = field(default_factory=dict)


_Lines = dict[str, _Line]


def merge(text: str, rows: Sequence[StoredRow], order: Sequence[str]) -> str:
    """A file of results with rows merged into it; rows that the file has already are replaced.

    In a replaced row, a variant that was not measured again keeps its figure and run.

    Args:
        text: Text of the file, or empty.
        rows: Measured rows.
        order: Titles of all known rows. Lines with other titles are put at the end.

    Raises:
        ExperimentError: if a table of the file cannot be read, naming its section and line.
    """
    runs = _read_runs(text)
    tables = {heading: _read_lines(heading, table_of(text, heading), runs) for heading in _ORDER}
    for row in rows:
        line = tables[section(row.name)].setdefault(row.title, _Line(row.bound))
        line.target = row.bound
        for name, result in row.results.items():
            words, met = " ".join(reached(result)).strip(), "yes" if result.met else "no"
            line.cells[name] = _Cell(words, met, result.origin)
    cells = [cell for lines in tables.values() for x in lines.values() for cell in x.cells.values()]
    used = {cell.origin for cell in cells if cell.origin is not None}
    old = [known for known in runs.values() if known in used]
    new = [cell.origin for cell in cells if cell.origin in used - set(old)]
    numbers = {made: number for number, made in enumerate(dict.fromkeys([*old, *new]), 1) if made}
    for heading, lines in tables.items():
        if lines:
            text = with_table(text, heading, _render(lines, numbers, order), before=RUNS)
    if numbers or table_of(text, RUNS):
        text = with_table(text, RUNS, _render_runs(numbers))
    return text


def section(name: str) -> str:
    """Heading of a row's section, by the row's name."""
    return next(heading for begin, heading in SECTIONS.items() if name.startswith(begin))


def _read_runs(text: str) -> dict[str, Origin]:
    """Runs by their number in the file."""
    runs = {}
    for number, *words in table_of(text, RUNS)[2:]:
        if len(words) != len(_RUN_COLUMNS):
            raise ExperimentError(f"results, {RUNS}, run {number}: {len(words) + 1} cells")
        named = dict(zip(_RUN_COLUMNS, words, strict=True))
        runs[number] = Origin(**{**named, "command": named["command"].strip("`")})
    return runs


def _read_lines(heading: str, table: Sequence[Sequence[str]], runs: Mapping[str, Origin]) -> _Lines:
    if not table:
        return {}
    header, lines = table[0], {}
    if header[:2] != [_TITLE, _TARGET]:
        raise ExperimentError(f"results, {heading}: the table begins with {header[0]}")
    for row in table[2:]:
        where = f"results, {heading}, {row[0]}"
        if len(row) != len(header):
            raise ExperimentError(f"{where}: {len(row)} cells instead of {len(header)}")
        line = lines[row[0]] = _Line(row[1])
        for name, value, met, run in _variants(header, row):
            if run != NOT_NOTED and run not in runs:
                raise ExperimentError(f"{where}: run {run or 'nothing'} is not among the runs")
            if value:
                line.cells[name] = _Cell(value, met, runs.get(run))
    return lines


def _variants(header: Sequence[str], row: Sequence[str]) -> Iterator[tuple[str, str, str, str]]:
    """Name of each variant, its figure, whether the figure meets the target, and the run."""
    name = value = met = ""
    for column, word in zip(header[2:], row[2:], strict=True):
        if column == _MET:
            met = word
        elif column == _RUN:
            yield name, value, met, word if value else NOT_NOTED
        else:
            name, value, met = column, word, ""


def _render(lines: _Lines, numbers: Mapping[Origin, int], order: Sequence[str]) -> list[str]:
    """Lines of a table; the paper's law has no column for whether it meets the target."""
    found = dict.fromkeys(name for line in lines.values() for name in line.cells)
    variants = sorted(found, key=lambda name: (name.startswith(PAPERS), name != MEASURED))
    header = [_TITLE, _TARGET]
    for name in variants:
        header += [name, _RUN] if name.startswith(PAPERS) else [name, _MET, _RUN]
    table = [header]
    places = {title: place for place, title in enumerate(order)}
    for title in sorted(lines, key=lambda title: places.get(title, len(places))):
        row = [title, lines[title].target]
        for name in variants:
            cell = lines[title].cells.get(name)
            met = [] if name.startswith(PAPERS) else [cell.met if cell else ""]
            made = cell.origin if cell else None
            number = str(numbers[made]) if made else NOT_NOTED if cell else ""
            row += [cell.value if cell else "", *met, number]
        table.append(row)
    return markdown(table)


def _render_runs(numbers: Mapping[Origin, int]) -> list[str]:
    table = [[_RUN, *_RUN_COLUMNS.values()]]
    for made, number in numbers.items():
        words = [getattr(made, name) for name in _RUN_COLUMNS]
        table.append([str(number), *words[:-1], f"`{words[-1]}`"])
    return markdown(table)
