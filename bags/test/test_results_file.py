"""Results as Markdown: rows measured again replace, all others keep figure and run."""

from __future__ import annotations

import dataclasses
import datetime
import re
import subprocess
from pathlib import Path

import pytest

from cassie_bags.errors import ExperimentError
from cassie_bags.run.provenance import Origin, machine, origin, revision
from cassie_bags.studies.results import table_of
from cassie_bags.studies.sweep.results_file import NOT_NOTED, SECTIONS, merge, section
from cassie_bags.studies.sweep.table import StoredRow, all_rows, read_rows

HERE = Path(__file__).resolve().parent
RESULTS = (HERE.parent / "RESULTS.md").read_text(encoding="utf-8")


def without_runs(text: str) -> str:
    """Results of which none names the run that measured it."""
    text = re.sub(r"\| (yes|no) \| \d+ \|", r"| \1 | - |", text)
    before, title, rest = text.partition("\n## Runs\n")
    runs, next_title, after = rest.partition("\n## ")
    words = [line for line in runs.splitlines() if not line.startswith("|")]
    return before + title + "\n".join(words).rstrip() + "\n" + next_title + after


def without_others(text: str) -> str:
    """Results without the columns of robots other than the first ones."""
    lines, dropped = [], slice(0)
    for line in text.splitlines():
        cells = line.split("|")
        if not line.startswith("|"):
            dropped = slice(0)
        elif (place := next((k for k, x in enumerate(cells) if x.startswith(" robots 1")), 0)) > 0:
            dropped = slice(place, place + 3)
        del cells[dropped]
        lines.append("|".join(cells))
    return "\n".join(lines) + "\n"


UNNOTED = without_runs(without_others(RESULTS))
ORDER = [row.title for row in all_rows()]
STORED = read_rows(HERE / "sweeps_of_two_robots.json")
"""Rows that `sweep` kept, measured with robots 1 and 2; the file holds the command."""


def missed() -> dict[str, set[str]]:
    """Rows of the results whose target is not reached, by the robots that miss it."""
    names = {row.title: row.name for row in all_rows()}
    found: dict[str, set[str]] = {"1 to 10": set(), "101 to 110": set()}
    for line in RESULTS.splitlines():
        title, *cells = (cell.strip() for cell in line.strip("|").split("|"))
        marks = [cell for cell in cells if cell in ("yes", "no")]
        first = "1 to 10" if len(cells) > 1 and cells[1] else "101 to 110"
        for robots, mark in zip((first, "101 to 110"), marks, strict=False):
            if mark == "no" and title in names:
                found[robots].add(names[title])
    return found


def test_the_readme_says_which_targets_are_not_reached():
    text = " ".join((HERE.parent / "README.md").read_text(encoding="utf-8").split())
    sentence = re.search(r"Not reached are .*?(?= \[Decisions\])", text)[0]
    for robots, rows in missed().items():
        pushes = {row for row in rows if row.startswith("push_circle_")}
        assert f" {len(pushes)} by robots {robots}" in sentence, sorted(pushes)
        for row in rows - pushes:
            group = row.partition(".")[0]
            assert f"`{row}`" in sentence or f"`{group}`" in sentence, row


def stored(name: str) -> StoredRow:
    (found,) = (row for row in STORED if row.name == name)
    return found


def again(row: StoredRow, *, only: str | None = None, **changes: str) -> StoredRow:
    """A row as another run would have kept it, of all variants or of one."""
    results = {
        name: dataclasses.replace(result, origin=dataclasses.replace(result.origin, **changes))
        for name, result in row.results.items()
        if only in (None, name)
    }
    return dataclasses.replace(row, results=results)


def line(text: str, title: str) -> list[str]:
    """Cells of the line of a table that begins with a title."""
    (found,) = (entry for entry in text.splitlines() if entry.startswith(f"| {title} |"))
    return [word.strip() for word in found.strip("|").split("|")]


def run(text: str, number: int) -> list[str]:
    """Cells of the line of a run."""
    return line(text.partition("\n## Runs\n")[2].partition("\n## ")[0], str(number))


def titles(text: str) -> list[str]:
    """Titles of all rows in a file of results, in the order of its sections."""
    found = {heading: table_of(text, heading)[2:] for heading in SECTIONS.values()}
    return [row[0] for heading in sorted(found, key=text.find) for row in found[heading]]


def test_the_results_of_this_repository_are_read_and_written_without_a_change():
    assert merge(RESULTS, [], ORDER) == RESULTS
    assert len(titles(RESULTS)) > 100
    assert set(titles(RESULTS)) <= set(ORDER)


def test_a_row_that_is_measured_again_replaces_the_older_one_and_names_its_run():
    row = stored("speed.+0.5")
    before, after = line(UNNOTED, row.title), line(merge(UNNOTED, [row], ORDER), row.title)
    assert before != after
    assert after[:2] == before[:2]
    assert after[2] == f"{row.results['measured'].measured:.3g} (0 of 2 fell)"
    assert after[3:5] == ["yes", "1"]
    assert after[6] == "1"


def test_all_other_rows_keep_what_they_had():
    row = stored("speed.+0.5")
    before, after = UNNOTED.splitlines(), merge(UNNOTED, [row], ORDER).splitlines()
    assert [entry for entry in before if entry not in after] == [
        entry for entry in before if entry.startswith(f"| {row.title} |")
    ]


def test_each_row_keeps_the_run_that_it_was_measured_with():
    one, other = stored("speed.+0.5"), stored("slope.up")
    text = merge(UNNOTED, [one, other], ORDER)
    text = merge(text, [again(one, date="2031-05-06", revision="0123456789")], ORDER)
    assert line(text, other.title)[4] == "1"
    assert line(text, one.title)[4] == "2"
    made = other.results["measured"].origin
    assert run(text, 1)[:4] == ["1", made.date, made.seeds, made.revision]
    assert run(text, 2)[1:4] == ["2031-05-06", made.seeds, "0123456789"]


def test_a_run_that_no_row_names_any_more_is_left_out():
    row = stored("speed.+0.5")
    text = merge(merge(UNNOTED, [row], ORDER), [again(row, revision="0123456789")], ORDER)
    assert line(text, row.title)[4] == "1"
    assert run(text, 1)[3] == "0123456789"
    with pytest.raises(ValueError, match="not enough values"):
        run(text, 2)


def test_a_law_that_was_not_measured_again_keeps_its_figure_and_run():
    row = stored("speed.+0.5")
    text = merge(UNNOTED, [again(row, only="measured", date="2031-05-06")], ORDER)
    before, after = line(UNNOTED, row.title), line(text, row.title)
    assert after[5:] == before[5:]
    assert after[6] == NOT_NOTED
    assert after[4] == "1"


def test_other_robots_have_a_column_of_their_own_beside_the_first_ones():
    row = stored("speed.+0.5")
    (result, *_) = row.results.values()
    result = dataclasses.replace(
        result, origin=dataclasses.replace(result.origin, seeds="101 to 110"), measured=0.04
    )
    others = dataclasses.replace(
        row, results={"robots 101 to 110": dataclasses.replace(result, met=False)}
    )
    text = merge(merge(UNNOTED, [others], ORDER), [row], ORDER)
    walking = text.partition("## Walking\n")[2].partition("\n## ")[0]
    assert line(walking, "capability")[2:] == [
        "measured", "met", "run", "robots 101 to 110", "met", "run", "paper's law", "run",
    ]  # fmt: skip
    cells = line(text, row.title)
    assert cells[2:4] == [f"{row.results['measured'].measured:.3g} (0 of 2 fell)", "yes"]
    assert cells[5:7] == ["0.04 (0 of 2 fell)", "no"]
    assert run(text, int(cells[7]))[2] == "101 to 110"
    assert merge(text, [], ORDER) == text


def test_rows_stand_in_their_sections_in_the_order_of_the_sweep():
    text = merge("# Results\n", list(reversed(STORED)), ORDER)
    assert titles(text) == [row.title for row in STORED]
    for row in STORED:
        assert row.title in text.partition(f"## {section(row.name)}\n")[2].partition("\n## ")[0]
    assert merge(text, [], ORDER) == text
    assert merge(text, STORED, ORDER) == text


def test_what_people_wrote_beside_the_tables_stays():
    text = "# Results\nWhy.\n\n## Walking\nOf walking.\n\nMore.\n\n## Other\n| a |\n|---|\n| 1 |\n"
    found = merge(text, [stored("speed.+0.5")], ORDER)
    for part in (
        "# Results\nWhy.\n",
        "## Walking\nOf walking.\n\nMore.\n",
        "| a |\n|---|\n| 1 |\n",
    ):
        assert part in found
    assert found.count("## Walking") == 1
    assert merge(found, [], ORDER) == found


def test_a_bar_in_a_command_or_a_problem_splits_no_cell():
    row = again(stored("speed.+0.5"), command="ros2 run cassie_bags sweep --set 'a=x|y'")
    text = merge("", [row], ORDER)
    assert r"x\|y" in text
    assert merge(text, [], ORDER) == text
    problem = dataclasses.replace(row.results["measured"], problem="one | two")
    text = merge("", [dataclasses.replace(row, results={"measured": problem})], ORDER)
    assert merge(text, [], ORDER) == text


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("| speed error at 1 m/s |", "| speed error at 1 m/s | 3 |", "speed error at 1 m/s: 8 cel"),
        ("| capability |", "| figure |", "Walking: the table begins with figure"),
        ("| yes | - | 0.034 ", "| yes | 7 | 0.034 ", "run 7 is not among the runs"),
    ],
)
def test_a_table_that_cannot_be_read_is_named(old: str, new: str, reason: str):
    assert old in UNNOTED
    with pytest.raises(ExperimentError, match=reason):
        merge(UNNOTED.replace(old, new, 1), [stored("speed.+0.5")], ORDER)


def test_an_origin_has_the_day_of_the_clock_that_it_is_given():
    now = datetime.datetime(2030, 1, 2, 23, 59, tzinfo=datetime.timezone.utc)
    made = origin("ros2 run cassie_bags sweep", "1 to 3", now)
    assert (made.command, made.date, made.seeds) == (
        "ros2 run cassie_bags sweep",
        "2030-01-02",
        "1 to 3",
    )
    assert "mujoco " in made.versions
    assert made.machine.endswith(" cores")
    assert made == Origin(**dataclasses.asdict(made))


def test_a_revision_tells_of_changes_and_of_sources_that_git_does_not_track(tmp_path: Path):
    def git(*words: str) -> str:
        command = ["git", "-C", str(tmp_path), "-c", "user.name=n", "-c", "user.email=e@x", *words]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    source = tmp_path / "module.py"
    source.write_text("a = 1\n")
    assert revision(source) == "unknown"
    git("init")
    assert revision(source) == "unknown"
    (tmp_path / "folder").mkdir()
    results = tmp_path / "folder" / "RESULTS.md"
    results.write_text("none\n")
    git("add", ".")
    git("commit", "-m", "one")
    commit = git("rev-parse", "HEAD")
    assert commit.startswith(revision(source))
    assert len(revision(source)) == 10
    results.write_text("one\n")  # a second study of the same sources
    assert len(revision(source)) == 10
    source.write_text("a = 2\n")
    assert revision(source) == f"{commit[:10]} with changes"


def test_a_machine_is_named_by_its_processor(tmp_path: Path):
    told = tmp_path / "cpuinfo"
    told.write_text("processor : 0\nmodel name : Fast CPU: 3 GHz\nprocessor : 1\n")
    assert machine(told).startswith("Fast CPU: 3 GHz, ")
    assert machine(tmp_path / "none").endswith(" cores")
