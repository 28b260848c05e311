"""Both estimators on one walk, against the truth: what the command prints, and its errors."""

from __future__ import annotations

import math

import pytest

from cassie_bags.cli import estimators as command
from cassie_bags.cli.frame import OK, WRONG_INPUT
from cassie_bags.studies import estimators
from cassie_bags.studies.estimators import compare


@pytest.fixture(scope="module")
def flat():
    """Errors of each estimator by its name, on flat ground."""
    return {errors.estimator: errors for errors in compare("flat", 2, lambda ticks: ticks)}


def test_the_filter_knows_velocity_tilt_and_place_while_walking(flat):
    errors = flat["invariant"]
    assert errors.velocity.max() < 0.01
    assert errors.tilt.max() < math.radians(0.3)
    assert errors.drift < 0.01


def test_it_is_better_than_the_velocity_of_the_loaded_leg(flat):
    assert flat["invariant"].velocity[0] < 0.2 * flat["kinematic"].velocity[0]
    assert flat["invariant"].tilt.max() < 0.5 * flat["kinematic"].tilt.max()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["flt"], "unknown ground flt: did you mean flat?"),
        (["--seed", "-1"], "-1 is not a whole number"),
    ],
)
def test_wrong_arguments_are_named(capsys, arguments, said):
    try:
        code = command.main(arguments)
    except SystemExit as stop:
        code = stop.code
    assert code == WRONG_INPUT
    assert said in capsys.readouterr().err


def test_the_table_has_a_row_for_each_estimator(monkeypatch, capsys, flat):
    monkeypatch.setattr(estimators, "compare", lambda *_: list(flat.values()))
    assert command.main(["flat", "--seed", "2"]) == OK
    out = capsys.readouterr().out
    for name, errors in flat.items():
        (row,) = (line for line in out.splitlines() if name in line)
        assert f"{errors.velocity[0]:.4f}" in row
