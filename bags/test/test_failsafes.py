"""Fail-safes: each row once, with the state drawn; the README's table is that of the rows."""

from __future__ import annotations

from pathlib import Path

import pytest

from cassie_bags.cli.failsafes import main
from cassie_bags.studies.failsafes import table
from cassie_bags.studies.failsafes.participants import UnsafeError
from cassie_bags.studies.failsafes.rows import ON_FOOT, ROWS
from cassie_bags.studies.failsafes.table import Case, cases, run_case, with_table

README = Path(__file__).parents[2] / "cassie_control" / "README.md"


@pytest.mark.parametrize(
    "case",
    [
        Case(row.name, row.states[number % min(len(row.states), len(ON_FOOT))], 100)
        for number, row in enumerate(ROWS)
    ],
    ids=lambda case: f"{case.row}-{case.state}",
)
def test_the_robot_does_what_the_table_promises(case: Case) -> None:
    assert run_case(case) == ""


def test_a_rider_whose_link_is_lost_stays_on_the_segway() -> None:
    assert run_case(Case("link_lost", "ride", 100)) == ""


def test_every_row_is_played_in_each_of_its_states() -> None:
    assert len(cases(ROWS, 20)) == 20 * sum(len(row.states) for row in ROWS)


def test_a_broken_promise_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def play_falling(run, rng, state):
        run.push((0.0, 900.0, 0.0), 0.3)
        run.run(3.0)

    row = next(row for row in ROWS if row.name == "link_lost")
    broken = type(row)(**{**vars(row), "test": play_falling})
    monkeypatch.setattr(table, "ROWS", (broken,))
    assert run_case(Case("link_lost", "stand", 0)).startswith("fell at")
    with pytest.raises(UnsafeError):
        raise UnsafeError("the error that `run_case` turns into words")


def test_the_readme_has_the_rows_as_they_are() -> None:
    text = README.read_text(encoding="utf-8")
    assert with_table(text) == text
    with pytest.raises(ValueError, match="are missing"):
        with_table("no table")


def test_a_torque_of_a_toe_that_its_drive_cannot_give_moves_no_foot():
    """The contact force rests on it: spikes of 200 Nm threw down robot 8, stepping in place."""
    assert run_case(Case("torque_differs", "step in place", 7)) == ""


def test_the_command_tells_each_row_as_soon_as_it_is_played(capsys) -> None:
    assert main(["power_on_refused", "--phases", "1", "--jobs", "1"]) == 0
    title, row, total = capsys.readouterr().out.splitlines()
    assert title.split() == ["row", "state", "safe"]
    assert row.split() == ["power_on_refused", "stand", "1", "of", "1"]
    assert total.endswith("1 of 1 runs as the table promises")
