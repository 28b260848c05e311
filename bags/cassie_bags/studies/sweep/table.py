"""All rows, and their results as a table and as JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from cassie_bags.errors import ExperimentError
from cassie_bags.report.plain import aligned, finite
from cassie_bags.run.provenance import Origin, versions
from cassie_bags.studies.sweep.course import Budget
from cassie_bags.studies.sweep.row import Capability, Level, Row, RowResult
from cassie_bags.studies.sweep.row_file import shipped_rows
from cassie_msgs.tunables import unknown_name

Results = Mapping[str, Mapping[str, RowResult]]
"""Result of each row by name of the variant ("measured", "paper's law") and name of the row."""


BEYOND = "beyond"
"""Name of the group of rows whose targets are not promised."""


def all_rows() -> list[Row]:
    """Every row, in the order of the table."""
    return [*promised_rows(), *rows_beyond()]


def promised_rows() -> Sequence[Row]:
    """Rows whose targets the robot is to reach."""
    return shipped_rows("walking", "ground", "loop", "segway", "standing")


def rows_beyond() -> Sequence[Row]:
    """Rows that look for limits, with targets that are not promised."""
    return shipped_rows("beyond", "segway_shaking")


def chosen_rows(names: Sequence[str], own: Sequence[Row] = ()) -> list[Row]:
    """Rows by name or group; if none is named all of `own`, or else all promised rows.

    If a group has promised rows, its name means only these and those of `own`.

    Args:
        names: Names of rows and groups.
        own: Rows of the user.

    Raises:
        ExperimentError: if there is no such row; the message names the nearest one.
    """
    promised, beyond = [*promised_rows(), *own], rows_beyond()
    if not names:
        return list(own or promised)
    rows, groups = [*promised, *beyond], {row.group for row in promised}
    known = {row.name for row in rows} | {row.group for row in rows} | {BEYOND}
    for name in names:
        if name not in known:
            raise ExperimentError(unknown_name(name, known, "row"))
    by_group = {row.name for row in promised if row.group in names}
    by_group |= {row.name for row in beyond if row.group in set(names) - groups}
    by_group |= {row.name for row in beyond if BEYOND in names}
    return [row for row in rows if row.name in names or row.name in by_group]


def table(rows: Sequence[Row], results: Results) -> str:
    """The results as text: target, result of each variant with its falls; then false alarms."""
    lines = [["capability", "target", *results]]
    for row in rows:
        bound = row.bound.replace("≥", ">=").replace("≤", "<=")
        lines.append([row.title, bound, *(cell(found.get(row.name)) for found in results.values())])
    text = aligned(lines, left=len(lines[0]))
    for name, found in results.items():
        levels = [level for row in rows if row.name in found for level in found[row.name].levels]
        alarmed, run = sum(level.alarmed for level in levels), sum(level.run for level in levels)
        hours = sum(level.seconds for level in levels) / 3600.0
        text.append(f"{name}: healthy sensors rejected in {alarmed} of {run} runs, {hours:.1f} h")
    return "\n".join(text)


def cell(result: RowResult | None) -> str:
    """Result of a row, in short."""
    if result is None:
        return "-"
    if result.problem:
        return result.problem
    value, falls = reached(result)
    return f"{value} {'yes' if result.met else 'no'} {falls}"


def reached(result: RowResult) -> tuple[str, str]:
    """The figure of a row, and its falls and false alarms; or the problem, and an empty text."""
    if result.problem:
        return result.problem, ""
    fell = sum(level.fell for level in result.levels)
    runs = sum(level.run for level in result.levels)
    value = "none" if math.isnan(result.measured) else f"{result.measured:.3g}"
    alarmed = sum(level.alarmed for level in result.levels)
    alarms = f", {alarmed} with a false alarm" if alarmed else ""
    return value, f"({fell} of {runs} fell{alarms})"


def save(path: Path, rows: Sequence[Row], results: Results, budget: Budget) -> None:
    """Write the results as JSON, with versions and budget.

    Args:
        path: JSON file.
        rows: All rows; those without a result are left out.
        results: Results by variant and row.
        budget: Extent of the runs.

    Raises:
        OSError: if the file cannot be written.
    """
    stored = []
    for row in rows:
        own = {name: found[row.name] for name, found in results.items() if row.name in found}
        if own:
            fields = row.name, row.title, row.unit, row.target
            stored.append(StoredRow(*fields, own, at_least=row.at_least))
    content = {"versions": versions(), "budget": budget, "rows": stored}
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(finite(content), indent=1, allow_nan=False), encoding="utf-8")


@dataclass(frozen=True)
class StoredRow(Capability):
    """A row as `save` stored it, with results by name of the variant."""

    results: Mapping[str, RowResult]


def read_rows(path: Path) -> list[StoredRow]:
    """All rows that `save` stored, in the order of the file.

    Raises:
        ExperimentError: if the file has other content.
        OSError: if the file cannot be read.
    """
    return _read(path)[0]


def load(path: Path, rows: Sequence[Row], budget: Budget) -> dict[str, dict[str, RowResult]]:
    """Results of `rows` that `save` stored, by variant and row; empty without a file.

    Args:
        path: JSON file.
        rows: Known rows; results of others are left out.
        budget: Extent of the runs, which must be that of the file.

    Raises:
        ExperimentError: if the file has other content, or results of another budget.
    """
    if not path.is_file():
        return {}
    stored, measured_with = _read(path)
    known = {row.name for row in rows}
    found: dict[str, dict[str, RowResult]] = {}
    for row in stored:
        for variant, result in row.results.items() if row.name in known else ():
            found.setdefault(variant, {})[row.name] = result
    if measured_with != json.loads(json.dumps(asdict(budget))):
        raise ExperimentError(f"{path} was measured with other seeds, phases, seconds or changes")
    return found


def _read(path: Path) -> tuple[list[StoredRow], Any]:
    """All stored rows, and the content of the budget."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        return [_row(entry) for entry in content["rows"]], content.get("budget")
    except (AttributeError, KeyError, TypeError, ValueError):
        raise ExperimentError(f"{path} holds no results of sweeps") from None


def _row(content: Mapping[str, Any]) -> StoredRow:
    results = {name: _result(found) for name, found in content["results"].items()}
    return StoredRow(**{**content, "results": results})


def _result(content: Mapping[str, Any]) -> RowResult:
    origin = content.get("origin")
    levels = [
        Level(**{**level, **{name: _number(level[name]) for name in ("worst", "mean")}})
        for level in content["levels"]
    ]
    read = {"measured": _number(content["measured"]), "levels": levels}
    return RowResult(**{**content, **read, "origin": origin and Origin(**origin)})


def _number(value: float | None) -> float:
    return math.nan if value is None else value
