"""Errors of both estimators on the same sensor samples, on several grounds."""

from __future__ import annotations

import argparse
import functools
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from cassie_bags.bag.recording import Recording
from cassie_bags.bag.rows import FloatArray, Rows, stamps
from cassie_bags.errors import ExperimentError
from cassie_bags.run.experiment import read_experiment
from cassie_bags.run.progress import progress_bar
from cassie_bags.run.seed import resolve
from cassie_bags.signals.estimation import estimation_error
from cassie_bags.signals.leg_geometry import euler_angles, rotation_matrices
from cassie_bags.studies.results import check_results, markdown, put_results
from cassie_bags.studies.trial import walking_operator
from cassie_control.estimator.config import ESTIMATORS, EstimatorConfig
from cassie_msgs.experiment.file import Experiment
from cassie_msgs.layout import RobotState, Sensors
from cassie_msgs.tunables import unknown_name

SECTION = "State estimators"
"""Heading of the estimators' table in a file of results."""


GROUNDS: dict[str, tuple[str, dict[str, Any], float]] = {
    "flat": ("flat", {}, 0.5),
    "low friction": ("flat", {"friction": 0.3}, 0.5),
    "soft": ("sand", {"sinking": 0.03}, 0.3),
}
"""Scene, parameters of the scene and walking speed (m/s), by the name of the ground."""

START, END = 10.0, 40.0
"""Measured part of the run. In s."""

COLUMNS = ("vx m/s", "vy m/s", "vz m/s", "roll deg", "pitch deg", "drift %")


@dataclass(frozen=True)
class Errors:
    """Errors of an estimator on one ground.

    Attributes:
        ground, estimator: Names of ground and estimator.
        velocity: RMS error of the pelvis's velocity in the heading frame. Shape (3,), in m/s.
        tilt: RMS error of roll and pitch. Shape (2,), in rad.
        drift: Error of the horizontal displacement over the walked distance.
    """

    ground: str
    estimator: str
    velocity: FloatArray
    tilt: FloatArray
    drift: float


def experiment_on(ground: str, seed: int) -> Experiment:
    """Experiment of walking straight ahead on one of `GROUNDS`."""
    scene, parameters, speed = GROUNDS[ground]
    content = {
        "name": ground,
        "seed": seed,
        "scene": scene,
        "scene_parameters": parameters,
        "start": "standing",
        "duration": END,
        "operator": walking_operator(speed, 2.0),
    }
    return resolve(read_experiment(content))


def compare(ground: str, seed: int, show: Callable[[range], Iterable[int]]) -> Iterator[Errors]:
    """Run one ground once, then compute each estimator's errors from the run's samples.

    Args:
        ground: One of `GROUNDS`.
        seed: Seed of the robot.
        show: Passes the ticks on and shows the progress.
    """
    from cassie_bags.run.cores import make_loop, tick_count  # loading the robot takes seconds
    from cassie_bags.run.simulate import Store
    from cassie_bags.run.simulate import run as run_loop

    experiment, store = experiment_on(ground, seed), Store()
    wall_time = run_loop(make_loop(experiment, store), show(range(tick_count(experiment))))
    recording = store.recording(wall_time)
    for name in ESTIMATORS:
        states = replay(recording.rows(Sensors), EstimatorConfig(estimator=name))
        yield errors_of(ground, name, states, recording)


def replay(sensors: Rows, config: EstimatorConfig) -> Rows:
    """States that an estimator computes from recorded samples.

    Args:
        sensors: Rows of `Sensors`.
        config: Parameters of the estimator.

    Returns:
        Rows of `RobotState`.
    """
    from cassie_control.estimator.choice import make_estimator

    period = float(np.median(np.diff(stamps(sensors))))
    core, sample, states = make_estimator(config, period), Sensors(), []
    raw, size = sensors.tobytes(), Sensors.SIZE
    for k in range(len(sensors)):
        sample.load(raw[k * size : (k + 1) * size])
        states.append(core.step(sample).to_bytes())
    return np.frombuffer(b"".join(states), RobotState.DTYPE)


def errors_of(ground: str, name: str, states: Rows, recording: Recording) -> Errors:
    """Errors of states, compared with the truth of the same ticks, from `START` on.

    Args:
        ground, name: Names of the ground and of the estimator.
        states: Rows of `RobotState`.
        recording: Recording of the run.
    """
    inside = stamps(states) >= START
    truth, rows = recording.truth[inside], states[inside]
    world = np.einsum("nij,nj->ni", rotation_matrices(truth["orientation"]), truth["linear"])
    angles = euler_angles(truth["orientation"])
    error = estimation_error(rows, truth["position"], world, angles)
    way = np.linalg.norm(np.diff(truth["position"][:, :2], axis=0), axis=1).sum()
    return Errors(
        ground,
        name,
        np.sqrt(np.square(error.velocity).mean(axis=0)),
        np.sqrt(np.square(error.tilt).mean(axis=0)),
        float(np.linalg.norm(error.position[-1]) / way),
    )


def table(errors: Iterable[Errors]) -> list[str]:
    """Lines of a Markdown table, with one row for each entry."""
    rows = [["ground", "estimator", *COLUMNS]]
    for e in errors:
        velocity, tilt = [f"{v:.4f}" for v in e.velocity], [f"{np.degrees(a):.3f}" for a in e.tilt]
        rows.append([e.ground, e.estimator, *velocity, *tilt, f"{100 * e.drift:.2f}"])
    return markdown(rows)


def run(arguments: argparse.Namespace) -> int:
    """Compare on each ground; returns the exit code."""
    results: list[Errors] = []
    check_results(arguments, "grounds", partial=bool(arguments.grounds))
    for ground in arguments.grounds or GROUNDS:
        if ground not in GROUNDS:
            raise ExperimentError(unknown_name(ground, GROUNDS, "ground"))
    for ground in arguments.grounds or GROUNDS:
        results += compare(ground, arguments.seed, functools.partial(progress_bar, "tick", None))
    print(f"seed {arguments.seed}; RMS errors against the truth", file=sys.stderr)
    print("\n".join(table(results)))
    put_results(arguments, SECTION, table(results), f"estimators --seed {arguments.seed}")
    return 0
