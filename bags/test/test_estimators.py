"""Both estimators against the truth, by the rows of the sweep."""

from __future__ import annotations

import pytest

from cassie_bags.studies.run_trial import run_trial
from cassie_bags.studies.sweep.course import Budget
from cassie_bags.studies.sweep.table import chosen_rows
from cassie_bags.studies.trial import Measures

ROWS = {row.name: row for row in chosen_rows(["estimator"])}


def walked(name: str, estimator: str) -> Measures:
    """Measures of robot 2, which walks with one of the estimators."""
    row = ROWS[name]
    changes = (f"estimator.estimator={estimator}",)
    (trial,) = row.trials(Budget(1, 1, 10.0, changes=changes, first=2), row.levels[0])
    measures = run_trial(trial)
    assert not measures["fell"]
    return measures


@pytest.fixture(scope="module")
def flat() -> dict[str, Measures]:
    """Measures on flat ground by estimator."""
    return {name: walked("estimator.vx", name) for name in ("invariant", "kinematic")}


def test_the_filter_knows_velocity_tilt_and_place_while_walking(flat):
    errors = flat["invariant"]
    assert max(errors[f"rmse_{axis}"] for axis in ("vx", "vy", "vz")) < 0.01
    assert errors["rmse_tilt"] < 0.3
    assert errors["odometry"] < 0.01


def test_it_is_better_than_the_velocity_of_the_loaded_leg(flat):
    assert flat["invariant"]["rmse_vx"] < 0.2 * flat["kinematic"]["rmse_vx"]
    assert flat["invariant"]["rmse_tilt"] < 0.5 * flat["kinematic"]["rmse_tilt"]


@pytest.mark.parametrize("ground", ["slippery", "soft"])
def test_the_velocity_stays_within_the_target_on_other_ground(ground: str):
    row = ROWS[f"estimator.{ground}"]
    assert callable(row.figure)
    assert row.figure(walked(row.name, "invariant"), row.levels[0]) <= row.target
