"""Step-to-step return maps: the fit, the measurement and the command's errors."""

from __future__ import annotations

import numpy as np
import pytest

from cassie_bags.cli import return_map
from cassie_bags.cli.frame import WRONG_INPUT
from cassie_bags.errors import RunError
from cassie_bags.studies.return_map import experiment_of, in_line, measure
from cassie_bags.studies.return_map_fit import ABOVE_NOISE, Deviations, decay, fit, steps_to_decay

EIGENVALUES = (0.8, 0.5, 0.4, 0.3, 0.2, 0.1)


def synthetic(count=8, steps=14, noise=1e-4, rng=None):
    """Runs of a known map, both parities of the touchdowns started at random."""
    rng = rng or np.random.default_rng(3)
    basis = rng.normal(size=(6, 6))
    matrix = basis @ np.diag(EIGENVALUES) @ np.linalg.inv(basis)
    runs = []
    for _ in range(count):
        values = [rng.normal(size=6), rng.normal(size=6)]
        while len(values) < steps:
            values.append(matrix @ values[-2])
        values = np.array(values) + noise * rng.normal(size=(steps, 6))
        runs.append(Deviations((1.0, 0.0), 0.0, values))
    return matrix, runs


def test_the_fit_finds_a_known_map():
    matrix, runs = synthetic()
    found = fit(runs, noise=2e-4)
    assert found is not None
    np.testing.assert_allclose(found.matrix, matrix, atol=0.02)
    np.testing.assert_allclose(found.eigenvalues, EIGENVALUES, atol=0.02)
    assert found.spread[0] <= 0.8 + 0.01
    assert found.spread[1] >= 0.8 - 0.01
    assert found.residual < 0.01


def test_what_no_map_explains_is_in_the_residual():
    rng = np.random.default_rng(5)
    runs = [Deviations((1.0, 0.0), 0.0, rng.normal(size=(14, 6))) for _ in range(8)]
    found = fit(runs, noise=1e-3)
    assert found is not None
    assert found.residual > 0.5


def test_nothing_is_fitted_to_noise():
    _, runs = synthetic()
    assert fit(runs, noise=10.0) is None
    assert fit([], noise=0.1) is None


def test_decay_counts_the_steps_after_which_it_stays_small():
    values = np.zeros((5, 6))
    values[:, 0] = (1.0, 0.05, 0.2, 0.05, 0.01)
    values[:, 4] = 7.0  # where it is does not count
    run = Deviations((1.0, 0.0), 0.0, values)
    np.testing.assert_allclose(decay([run]), values[:, 0])
    assert steps_to_decay([run]) == 3
    values[4, 0] = 0.3
    assert steps_to_decay([run]) is None


def test_a_run_with_a_step_too_many_is_not_in_line():
    nominal = np.array([0.4, 0.8, 1.2, 1.6])
    assert in_line(nominal + np.array([0.05, 0.04, 0.0, -0.05]), nominal)
    assert not in_line(np.array([0.1, 0.4, 0.8, 1.2]), nominal)


def test_a_push_at_half_speed_is_forgotten():
    found = measure(experiment_of(0.5, 0, None, False), 0.5, 4.0, steps=8)
    assert found.fell == found.dropped == 0
    assert len(found.deviations) == 8
    first = [run.size[0] for run in found.deviations]
    assert min(first) > ABOVE_NOISE * found.noise  # the pushes were felt
    assert decay(found.deviations)[4] < 0.5


def test_a_speed_that_is_not_walked_is_an_error():
    with pytest.raises(RunError, match=r"after 12 s the supervisor asks for 1\.2 m/s"):
        measure(experiment_of(1.7, 0, None, False), 1.7, 4.0)


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["nothing.json"], "nothing.json"),
        (["--speeds", "3"], "3 m/s is outside -1.3 .. 2 of"),
        (["--speeds", "nan"], "nan m/s is outside"),
        (["--impulse", "50"], "50 N s is outside 0.1 .. 10"),
    ],
)
def test_wrong_input_is_named_in_a_line(arguments, reason, capsys):
    assert return_map.main(arguments) == WRONG_INPUT
    error = capsys.readouterr().err
    assert reason in error
    assert error.count("\n") == 1


@pytest.mark.parametrize("arguments", [["--seed", "-1"], ["--jobs", "0"]])
def test_wrong_options_are_refused(arguments, capsys):
    with pytest.raises(SystemExit):
        return_map.main(arguments)
    assert "is not a whole number of" in capsys.readouterr().err
