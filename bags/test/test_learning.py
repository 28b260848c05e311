"""Learning torques: what a run teaches, what is kept of it, and what it brings."""

from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pytest
from test_experiment_command import environment

from cassie_bags.errors import ExperimentError
from cassie_bags.signals.window import TRACKING
from cassie_bags.studies.learn_torques import (
    Comparison,
    LearningResult,
    learn,
    merged,
    table,
)
from cassie_bags.studies.run_trial import experiment_of, run_trial
from cassie_bags.studies.sweep.course import comparison, walk
from cassie_bags.studies.trial import ratio_to_reference
from cassie_control.learning.torque_table import JOINTS, save_torques, zero_torques


def outcome(speed: float, torque: float, *, fell: bool = False) -> LearningResult:
    torques = np.full((len(JOINTS), 21), torque)
    torques[JOINTS.index("stance_toe")] = 0.0
    return LearningResult(speed, torques, 20, fell)


def figures(with_it: float, without: float, fell: float = 0.0) -> dict[str, float]:
    found = {
        "fell": fell,
        "reference_fell": 0.0,
        "tracking": with_it,
        "reference_tracking": without,
    }
    found |= dict.fromkeys(TRACKING, with_it)
    return found | {f"reference_{name}": without for name in TRACKING}


def test_the_mean_of_the_robots_that_did_not_fall_is_kept():
    before = zero_torques((0.0, 0.5))
    given = [outcome(0.5, 2.0), outcome(0.5, 4.0), outcome(0.5, 99.0, fell=True)]
    given.append(outcome(0.0, 7.0, fell=True))
    found = merged(before, given)
    assert np.unique(found.torques[0]).tolist() == [0.0]
    assert np.unique(found.torques[1]).tolist() == [0.0, 3.0]


def test_errors_are_compared_over_the_robots_that_walked_both_ways():
    found = Comparison(0.5, [figures(0.01, 0.02), figures(0.03, 0.04), figures(9.0, 9.0, fell=1.0)])
    assert found.rms("tracking") == pytest.approx(math.sqrt((0.01**2 + 0.03**2) / 2))
    assert found.rms("reference_tracking") == pytest.approx(math.sqrt((0.02**2 + 0.04**2) / 2))
    assert (found.falls("reference_fell"), found.falls("fell")) == (0, 1)
    assert found.worse
    assert ratio_to_reference(figures(0.01, 0.02)) == pytest.approx(0.5)
    assert math.isnan(ratio_to_reference(figures(0.01, 0.02, fell=1.0)))
    assert "71 %" in table([found])


def test_a_lesson_takes_tracking_error_away():
    learned = zero_torques((0.5,))
    found = learn((0.5, 3), learned, 8.0, ())
    assert not found.fell
    assert found.taught > 12
    assert np.abs(found.torques).max() > 2.0


def test_the_torques_of_the_package_take_three_tenths_of_the_tracking_error_away():
    found = run_trial(comparison(1004, 0.5, 4.0, ()))
    assert ratio_to_reference(found) < 0.7
    assert found["tracking_torso_roll"] < 1.05 * found["reference_tracking_torso_roll"]


def test_a_damaged_file_is_an_error_before_anything_runs(tmp_path):
    path = tmp_path / "bad.json"
    save_torques(zero_torques(), path)
    path.write_text(path.read_text()[:-40])
    words = (f"controller.learned_torques_file={path}",)
    with pytest.raises(ValueError, match=r"learned torques .*bad\.json: line 1 column"):
        experiment_of(walk(1, (0.0, 1.0), changes=words))
    with pytest.raises(ExperimentError, match="learned_torques_file is 3, expected a path"):
        experiment_of(walk(1, (0.0, 1.0), changes=("controller.learned_torques_file=3",)))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--speeds", "3.0"], "--speeds 3 is outside -1 .. 2 m/s"),
        (["--begin", "nowhere.json"], "learned torques nowhere.json: No such file or directory"),
        (["--set", "controller.learning.gain=2"], "learning.gain = 2 is outside 0 .. 1"),
    ],
)
def test_wrong_arguments_are_one_line(words, message):
    done = subprocess.run(
        [sys.executable, "-m", "cassie_bags.cli.learn_torques", *words],
        capture_output=True,
        text=True,
        timeout=600,
        env=environment(),
        check=False,
    )
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.splitlines()) == 1
