"""The experiment files that come with the package."""

from __future__ import annotations

from pathlib import Path

import pytest

from cassie_bags.run.cores import check_parameters, library_path
from cassie_bags.run.experiment import load_experiment
from cassie_bags.run.seed import resolve

FILES = sorted((Path(__file__).parents[1] / "experiments").glob("*.yaml"))


@pytest.mark.parametrize("file", FILES, ids=lambda path: path.stem)
def test_each_file_can_be_run_for_any_seed(file: Path):
    for seed in (0, 1, 99):
        experiment = resolve(load_experiment(file, seed=seed))
        check_parameters(experiment)
        assert library_path(experiment).is_file()
        assert experiment.expect.phases[-1].t1 <= experiment.duration


def test_the_demo_expects_what_the_main_job_must_do():
    demo = load_experiment(FILES[0].parent / "demo.yaml")
    bounds = {phase.name: phase.bounds for phase in demo.expect.phases}
    assert demo.expect.fell is False
    assert bounds["walk in place"]["drift"].high <= 0.5
    assert bounds["walk at 0.5 m/s"]["vx"].low >= 0.4
    assert bounds["walk at 0.8 m/s"]["vx"].low >= 0.65
    assert bounds["turn"]["turn_deg"].low >= 75.0
    assert bounds["squat"]["height"].high <= 0.62 + 1e-9
    assert bounds["rise"]["height"].low >= 0.88 - 1e-9


def test_cores_and_reports_know_no_ros_client():
    package = Path(__file__).parents[1] / "cassie_bags"
    for path in package.glob("*.py"):
        assert "import rclpy" not in path.read_text(), path
        assert "from rclpy" not in path.read_text(), path
