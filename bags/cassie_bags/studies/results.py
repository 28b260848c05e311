"""A file of results in Markdown: sections with one table each, written by their commands.

Anything else in the file is kept, so that people can write beside the tables.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from pathlib import Path

from cassie_bags.errors import ExperimentError
from cassie_bags.run.provenance import Origin, origin

_MEASURED = "Measured by "
"""Beginning of the line above a table that names command, date and versions."""


def put_table(path: Path, heading: str, table: Sequence[str], source: Origin) -> None:
    """Write a table, and the origin of its values, into a section of a file of results.

    Args:
        path: File of results; it is made if it does not exist.
        heading: Heading of the section, whose table is replaced.
        table: Lines in Markdown.
        source: Origin of the values.
    """
    text = path.read_text(encoding="utf-8") if path.is_file() else "# Results\n"
    lines = with_table(text, heading, table).splitlines()
    extent = _extent(lines, heading)
    assert extent is not None  # with_table has made the section
    top, begin, _ = extent
    note = f"{_MEASURED}`{source.command}`: {source.date}, revision {source.revision}, "
    note += f"{source.machine}; {source.versions}; robot {source.seeds}."
    above = [line for line in lines[top:begin] if not line.startswith(_MEASURED)]
    while not above[-1]:
        above.pop()
    lines[top:begin] = [*above, "", note, ""]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def check_results(arguments: argparse.Namespace, what: str, *, partial: bool) -> None:
    """Check the option `--results` of a study, whose table replaces that of all.

    Args:
        arguments: Arguments of the study.
        what: What the study measures if nothing is named.
        partial: Whether the arguments name a part of it.

    Raises:
        ExperimentError: if the file cannot get the whole table.
    """
    if arguments.results is not None:
        if partial:
            raise ExperimentError(f"--results takes all {what}: name none")
        check_file(arguments.results)


def put_results(
    arguments: argparse.Namespace, heading: str, table: Sequence[str], words: str
) -> None:
    """Write the table of a study by `put_table` into the file of its option `--results`, if any.

    Args:
        arguments: Arguments of the study, with `seed` and `now`.
        heading, table: See `put_table`.
        words: The command that measures the values again, after `cassie_bags`.
    """
    if arguments.results is not None:
        source = origin(f"ros2 run cassie_bags {words}", str(arguments.seed), arguments.now)
        put_table(arguments.results, heading, table, source)


def check_file(path: Path) -> None:
    """Check that a file of results can be written, before hours are spent on the results.

    Raises:
        ExperimentError: if its folder does not exist, or the path is a folder itself.
    """
    if not path.parent.is_dir():
        raise ExperimentError(f"{path}: there is no such folder")
    if path.is_dir():
        raise ExperimentError(f"{path} is a folder, expected a file of results")


def table_of(text: str, heading: str) -> list[list[str]]:
    """Cells of the first table of a section, with header and rule; empty without a table."""
    lines = text.splitlines()
    extent = _extent(lines, heading)
    table = [] if extent is None else lines[extent[1] : extent[2]]
    cells = [re.split(r"(?<!\\)\|", line.strip())[1:-1] for line in table]
    return [[word.strip().replace(r"\|", "|") for word in row] for row in cells]


def with_table(text: str, heading: str, table: Sequence[str], before: str = "") -> str:
    """A text in which a table replaces the first table of a section.

    Args:
        text: Text with sections.
        heading: Heading of the section, which is made if it does not exist.
        table: Lines in Markdown.
        before: Heading above which a new section is put; the end of the text if there is none.
    """
    lines = text.splitlines()
    extent = _extent(lines, heading)
    if extent is None:
        following = _extent(lines, before)
        place = len(lines) if following is None else following[0]
        gap = [""] if place and lines[place - 1] else []
        end = [] if following is None else [""]
        lines[place:place] = [*gap, f"## {heading}", "", *table, *end]
    else:
        _, begin, end_of_table = extent
        apart = begin == end_of_table  # no table yet: blank lines around the new one
        gap = [""] if apart and lines[begin - 1] else []
        end = [""] if apart and begin < len(lines) else []
        lines[begin:end_of_table] = [*gap, *table, *end]
    return "\n".join(lines) + "\n"


def markdown(table: Sequence[Sequence[str]]) -> list[str]:
    """Markdown lines of a table, whose first row is the header."""
    rows = [[word.replace("|", r"\|") for word in row] for row in table]
    text = [f"|{'|'.join(f' {word} ' if word else ' ' for word in row)}|" for row in rows]
    return [text[0], "|" + "---|" * len(table[0]), *text[1:]]


def _extent(lines: Sequence[str], heading: str) -> tuple[int, int, int] | None:
    """Indices of a section's heading, and of its first table's start and end; None if absent."""
    if f"## {heading}" not in lines:
        return None
    top = lines.index(f"## {heading}")
    below = range(top + 1, len(lines))
    bottom = next((index for index in below if lines[index].startswith("## ")), len(lines))
    begin = next((i for i in range(top, bottom) if lines[i].startswith("|")), bottom)
    end = next((i for i in range(begin, bottom) if not lines[i].startswith("|")), bottom)
    return top, begin, end
