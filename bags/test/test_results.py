"""Tables of studies in a file of results, with what they were measured with."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from cassie_bags.cli import faults, return_map
from cassie_bags.cli.frame import WRONG_INPUT
from cassie_bags.run.provenance import Origin
from cassie_bags.studies import faults as faults_study
from cassie_bags.studies import return_map as return_map_study
from cassie_bags.studies.results import put_table, table_of

RESULTS = Path(__file__).resolve().parents[1] / "RESULTS.md"
MADE = Origin("ros2 run cassie_bags x", "2031-05-06", "0123456789", "A CPU, 2 cores", "a 1", "7")


@pytest.fixture
def results(tmp_path: Path) -> Path:
    """A copy of this repository's file of results."""
    return Path(shutil.copy(RESULTS, tmp_path))


@pytest.mark.parametrize("heading", [faults_study.SECTION, return_map_study.SECTION])
def test_a_table_replaces_the_one_of_its_section_and_says_where_it_is_from(
    results: Path, heading: str
):
    before = results.read_text()
    assert len(table_of(before, heading)) > 6
    put_table(results, heading, ["| a | b |", "|---|---|", "| 1 | 2 |"], MADE)
    after = results.read_text()
    assert table_of(after, heading)[::2] == [["a", "b"], ["1", "2"]]
    part = after.partition(f"## {heading}\n")[2].partition("\n## ")[0]
    assert part.count("Measured by ") == 1
    for word in ("`ros2 run cassie_bags x`", "2031-05-06", "0123456789", "A CPU, 2 cores", "a 1"):
        assert word in part
    gone = [line for line in before.splitlines() if line not in after.splitlines()]
    assert all(line.startswith(("|", "Measured by `ros2 run cassie_bags")) for line in gone)
    put_table(results, heading, ["| a | b |", "|---|---|", "| 1 | 2 |"], MADE)
    assert results.read_text() == after


def test_a_file_that_is_not_there_is_made(tmp_path: Path):
    put_table(tmp_path / "R.md", "Something", ["| a |", "|---|", "| 1 |"], MADE)
    text = (tmp_path / "R.md").read_text()
    assert text.startswith("# Results\n\n## Something\n\nMeasured by `ros2 run cassie_bags x`: ")
    assert text.endswith(".\n\n| a |\n|---|\n| 1 |\n")


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (faults, ["drive_position.3"]),
        (faults, ["--kinds", "off"]),
        (return_map, ["--speeds", "0.5"]),
        (return_map, ["dense"]),
    ],
)
def test_a_part_of_a_table_does_not_replace_it(command, words, results: Path, capsys):
    assert command.main([*words, "--results", str(results)]) == WRONG_INPUT
    assert "--results takes all" in capsys.readouterr().err
    assert results.read_text() == RESULTS.read_text()


@pytest.mark.parametrize("command", [faults, return_map])
def test_a_folder_that_is_not_there_is_told_before_anything_is_measured(
    command, tmp_path: Path, capsys
):
    assert command.main(["--results", str(tmp_path / "no" / "R.md")]) == WRONG_INPUT
    assert "there is no such folder" in capsys.readouterr().err
    assert command.main(["--results", str(tmp_path)]) == WRONG_INPUT
    assert f"{tmp_path} is a folder, expected a file" in capsys.readouterr().err
