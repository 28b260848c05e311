"""Runs a trial in process, ends it as soon as it is decided, and measures it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from cassie_bags.bag.rows import FloatArray, Rows, stamps
from cassie_bags.run.cores import check_parameters, connect, make_cores, tick_count
from cassie_bags.run.experiment import read_experiment
from cassie_bags.run.simulate import RecentStore, Store
from cassie_bags.run.yaml_file import apply_changes
from cassie_bags.signals.falls import FALLEN_HEIGHT, FALLEN_TILT
from cassie_bags.signals.riding import RIDE_MEASURES, measure_ride
from cassie_bags.signals.track import Track, make_track
from cassie_bags.signals.window import (
    EFFORT_MEASURES,
    WINDOW_MEASURES,
    measure_effort,
    measure_window,
)
from cassie_bags.studies.trial import Measures, Trial
from cassie_msgs.experiment.file import Experiment
from cassie_msgs.layout import ControllerStatus, RobotMode, RobotState
from cassie_sim.plant import Plant
from cassie_sim.poses import lowest_sole

CHECK_TICKS = 25
"""Ticks between checks for a fall, which cost time."""

MEASURES = (
    *("fell", "end", "ahead", "end_speed", "standing", "false_alarms"),
    *WINDOW_MEASURES,
    *EFFORT_MEASURES,
    *RIDE_MEASURES,
)
"""Names of the measures of a trial; see `run_trial`."""

_AT_REST = 1.0  # s, time over which the speed at the end is averaged
_FALLING = 1.0  # s before the end of a fall in which alarms do not count as false


def experiment_of(trial: Trial) -> Experiment:
    """The drawn experiment of a trial, at the written times.

    Raises:
        ExperimentError: naming the key, its value and what is permitted.
    """
    content = {key: _copy(value) for key, value in trial.content.items()}
    apply_changes(content, trial.changes)
    experiment = read_experiment({"name": "trial", **content, "seed": trial.seed})
    experiment = dataclasses.replace(experiment, drawn=True)
    check_parameters(experiment)
    return experiment


def run_trial(trial: Trial) -> Measures:
    """Run a trial until its end, a fall, or the distance `ahead`; then its second run, if any.

    Returns:
        Measures by name: fell (0 or 1), end (s), ahead (m), end_speed (m/s), standing (0 or 1), and
        false_alarms, the number of healthy channels that were rejected at any time. Those of the
        window are from `measure_window`, `measure_effort` and `measure_ride`, NaN if the run ended
        before the window did. Measures of the reference run have the prefix "reference_".

    Raises:
        ExperimentError: naming the key, its value and what is permitted.
    """
    measures = _measures_of(trial)
    if trial.reference is not None:
        changes = (*trial.changes, *trial.reference)
        changed = dataclasses.replace(trial, changes=changes, reference=None)
        measures |= {f"reference_{name}": value for name, value in _measures_of(changed).items()}
    return measures


def _measures_of(trial: Trial) -> Measures:
    experiment = experiment_of(trial)
    cores = make_cores(experiment)
    store = Store() if trial.history is None else RecentStore(trial.history)
    loop = connect(cores, store)
    fell = False
    start = _heading_line(cores.plant)
    for tick in range(tick_count(experiment)):
        loop.tick()
        if tick % CHECK_TICKS == 0:
            fell = has_fallen(cores.plant)
            if fell or (trial.ahead is not None and abs(_ahead(cores.plant, start)) >= trial.ahead):
                break
    fell = fell or has_fallen(cores.plant)
    recording = store.recording(0.0)
    track = make_track(recording)
    end = float(track.time[-1])
    alarms = unbelieved_channels(recording.rows(RobotState), end - _FALLING * fell)
    mass = float(cores.plant.model.body("pelvis").subtreemass[0])
    return {
        "fell": float(fell),
        "end": end,
        "ahead": _ahead(cores.plant, start),
        "end_speed": _end_speed(track),
        "standing": float(track.mode[-1] == RobotMode.STAND),
        "false_alarms": 0.0 if experiment.scenario.faults else float(alarms),
        **measure_window(track, recording.rows(ControllerStatus), trial.window),
        **measure_effort(track, trial.window, mass),
        **measure_ride(recording, experiment.rider, trial.window),
    }


def unbelieved_channels(states: Rows, until: float) -> int:
    """Number of sensor channels that were rejected at any time before `until` (s)."""
    masks = states["sensor_faults"][stamps(states) < until]
    return int(np.bitwise_or.reduce(masks, axis=None, initial=0)).bit_count()


def has_fallen(plant: Plant) -> bool:
    """Whether the robot has fallen: see `falls.FALLEN_TILT` and `falls.FALLEN_HEIGHT`.

    The soles' height is that of the last physics step: to compute it again would change the run.
    """
    position, (w, x, y, z) = plant.pelvis_pose
    if w * w - x * x - y * y + z * z < math.cos(FALLEN_TILT):
        return True
    return bool(position[2] - lowest_sole(plant.model, plant.data) < FALLEN_HEIGHT)


def _heading_line(plant: Plant) -> FloatArray:
    """Position and heading of the robot at the start: x, y, cos, sin."""
    (x, y, _), (w, _, _, z) = plant.pelvis_pose
    yaw = 2.0 * math.atan2(z, w)
    return np.array([x, y, math.cos(yaw), math.sin(yaw)])


def _ahead(plant: Plant, line: FloatArray) -> float:
    x, y, _ = plant.pelvis_pose[0]
    return float((x - line[0]) * line[2] + (y - line[1]) * line[3])


def _end_speed(track: Track) -> float:
    last = track.time >= track.time[-1] - _AT_REST
    moved = track.position[last][-1, :2] - track.position[last][0, :2]
    return float(np.linalg.norm(moved)) / _AT_REST


def _copy(value: Any) -> Any:
    """A copy to which changes may be applied."""
    if isinstance(value, Mapping):
        return {key: _copy(entry) for key, entry in value.items()}
    return [_copy(entry) for entry in value] if isinstance(value, (list, tuple)) else value
