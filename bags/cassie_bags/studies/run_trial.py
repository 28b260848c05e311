"""Runs a trial in process, ends it as soon as it is decided, and measures it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from cassie_bags.bag.rows import Rows, stamps
from cassie_bags.run.cores import check_parameters, connect, make_cores, tick_count
from cassie_bags.run.experiment import read_experiment
from cassie_bags.run.simulate import RecentStore, Store
from cassie_bags.run.yaml_file import apply_changes
from cassie_bags.signals.effort import measure_effort
from cassie_bags.signals.falls import FALLEN_HEIGHT, FALLEN_TILT
from cassie_bags.signals.metrics import sole_pitch
from cassie_bags.signals.riding import measure_ride
from cassie_bags.signals.standing import STANDING_MEASURES, measure_standing
from cassie_bags.signals.track import AVERAGED_OVER, Track, make_track
from cassie_bags.studies.trial import Measures, Trial
from cassie_gaits.gait_library import OUTPUTS
from cassie_msgs.experiment.file import Experiment
from cassie_msgs.layout import ControllerStatus, RobotMode, RobotState
from cassie_sim.plant import Plant
from cassie_sim.poses import lowest_sole

FloatArray = npt.NDArray[np.float64]

_MEANS = ("vx", "vy", "yaw_rate")
_RMSE = ("rmse_vx", "rmse_vy", "rmse_vz")
TRACKING = tuple(f"tracking_{name}" for name in OUTPUTS)
"""RMS tracking error of each of the nine outputs, by name of the measure."""

WINDOW_MEASURES = (
    *_MEANS,
    "vy_slip",
    "velocity_off",
    "step_rate",
    "drift",
    "drift_of_steps",
    "depth",
    "sole_pitch",
    *_RMSE,
    "odometry",
    "tracking",
    *TRACKING,
    *STANDING_MEASURES,
)
"""Names of the measures of `measure_window`."""

_CHECK_TICKS = 25  # ticks between checks whether the run is decided
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
        before the window did. Measures of the second run have the prefix "beside_".

    Raises:
        ExperimentError: naming the key, its value and what is permitted.
    """
    measures = _measures_of(trial)
    if trial.beside is not None:
        changed = dataclasses.replace(trial, changes=(*trial.changes, *trial.beside), beside=None)
        measures |= {f"beside_{name}": value for name, value in _measures_of(changed).items()}
    return measures


def _measures_of(trial: Trial) -> Measures:
    experiment = experiment_of(trial)
    cores = make_cores(experiment)
    store = Store() if trial.kept is None else RecentStore(trial.kept)
    loop = connect(cores, store)
    fell = False
    start = _heading_line(cores.plant)
    for tick in range(tick_count(experiment)):
        loop.tick()
        if tick % _CHECK_TICKS == 0:
            fell = has_fallen(cores.plant)
            if fell or _is_past(cores.plant, start, trial.ahead):
                break
    fell = fell or has_fallen(cores.plant)
    recording = store.recording(0.0)
    track = make_track(recording)
    measures = {
        "fell": float(fell),
        "end": float(track.time[-1]),
        "ahead": _ahead(cores.plant, start),
        "end_speed": _end_speed(track),
        "standing": float(track.mode[-1] == RobotMode.STAND),
    }
    states = recording.rows(RobotState)
    healthy = not experiment.scenario.faults
    until = float(track.time[-1]) - _FALLING * fell
    measures["false_alarms"] = float(unbelieved_channels(states, until)) if healthy else 0.0
    measures |= measure_window(track, recording.rows(ControllerStatus), trial.window)
    mass = float(cores.plant.model.body("pelvis").subtreemass[0])
    measures |= measure_effort(track, trial.window, mass)
    return measures | measure_ride(recording, experiment.rider, trial.window)


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


def measure_window(track: Track, status: Rows, window: tuple[float, float]) -> Measures:
    """Measures of a part of a run, NaN if the run ended before the part did.

    Args:
        track: Signals of the run.
        status: Rows of `ControllerStatus`.
        window: Start and end. In s.

    Returns:
        Measures by name, also those of `measure_standing`. "Over two steps" means a moving mean,
        which removes the sway.

        - vx, vy (m/s): means in the heading frame.
        - yaw_rate (rad/s): mean of the means over two steps.
        - vy_slip (m/s): largest sideways velocity over two steps.
        - velocity_off (m/s): largest error of the horizontal velocity over two steps.
        - step_rate (1/s): touchdowns per second.
        - drift (m): largest distance from the position at the window's start.
        - drift_of_steps (m): largest drift of the position over two steps.
        - depth (m): median depth of the lower sole below the height of the start.
        - sole_pitch (deg): see `metrics.sole_pitch`.
        - rmse_vx, rmse_vy, rmse_vz (m/s): RMSE of the estimated velocity in the heading frame.
        - odometry: error of the estimated displacement over its length.
        - tracking (rad and m): RMS error of the nine outputs; `TRACKING` has that of each output.
    """
    t0, t1 = window
    inside = (track.time >= t0) & (track.time < t1)
    tick = float(track.time[1] - track.time[0])
    if track.time[-1] < t1 - 1.5 * tick:
        return dict.fromkeys(WINDOW_MEASURES, math.nan)
    away = track.position[inside, :2] - track.position[inside][0, :2]
    measures = {name: float(track.achieved[name][inside].mean()) for name in _MEANS}
    two_steps = round(AVERAGED_OVER / tick)
    measures["yaw_rate"] = _without_sway(track.achieved["yaw_rate"][inside], two_steps)
    measures["vy_slip"] = _slip(track.achieved["vy"][inside], two_steps)
    measures["velocity_off"] = _velocity_off(track, inside, two_steps)
    measures["drift"] = float(np.linalg.norm(away, axis=1).max())
    measures["drift_of_steps"] = _drift_of_steps(away, two_steps)
    measures["depth"] = -float(np.median(track.sole_height[inside].min(axis=1)))
    measures["sole_pitch"] = sole_pitch(track, inside)
    measures |= _estimate(track, inside)
    measures |= measure_standing(track, status, inside)
    rows = status[(stamps(status) >= t0) & (stamps(status) < t1)]
    measures["step_rate"] = float(np.ptp(rows["step_count"])) / (t1 - t0)
    errors = rows["y"][rows["mode"] == RobotMode.WALK]
    squares = (errors**2).mean(axis=0) if len(errors) else np.full(len(OUTPUTS), math.nan)
    measures["tracking"] = float(np.sqrt(squares.mean()))
    measures |= dict(zip(TRACKING, np.sqrt(squares).tolist(), strict=True))
    return measures


def _over_two_steps(values: FloatArray, width: int) -> FloatArray:
    """Means over every two steps, `width` ticks, which remove the sway of steps."""
    return np.convolve(values, np.full(width, 1.0 / width), mode="valid")


def _slip(vy: FloatArray, width: int) -> float:
    """Largest magnitude of the sideways velocity's mean over two steps. In m/s."""
    return float(np.abs(_over_two_steps(vy, width)).max()) if len(vy) >= width else math.nan


def _velocity_off(track: Track, inside: npt.NDArray[np.bool_], width: int) -> float:
    """Largest error of the mean velocity over two steps, from the commanded one. In m/s."""
    if np.count_nonzero(inside) < width:
        return math.nan
    errors = [
        _over_two_steps(track.achieved[name][inside] - track.commanded[name][inside], width)
        for name in ("vx", "vy")
    ]
    return float(np.linalg.norm(errors, axis=0).max())


def _without_sway(values: FloatArray, width: int) -> float:
    """Mean of a window that may start and end at any phase of two steps."""
    return float((_over_two_steps(values, width) if len(values) > 2 * width else values).mean())


def _drift_of_steps(away: FloatArray, width: int) -> float:
    """Largest distance of the moving mean of positions (n, 2) from its start. In m."""
    if len(away) <= width:
        return math.nan
    sums = np.cumsum(np.vstack([np.zeros(2), away]), axis=0)
    means = (sums[width:] - sums[:-width]) / width
    return float(np.linalg.norm(means - means[0], axis=1).max())


def _estimate(track: Track, inside: npt.NDArray[np.bool_]) -> Measures:
    """Errors of the estimated velocity and displacement, compared with the truth."""
    rows = track.state[inside]
    true = _in_heading(track.velocity[inside], track.angles[inside, 0])
    estimated = _in_heading(rows["v"][:, :3], rows["q"][:, 3])
    rmse = np.sqrt(((estimated - true) ** 2).mean(axis=0))
    moved = [_displacement(track.position[inside], track.angles[inside, 0])]
    moved.append(_displacement(rows["q"][:, :3], rows["q"][:, 3]))
    length = float(np.linalg.norm(moved[0]))
    measures = dict(zip(_RMSE, rmse.tolist(), strict=True))
    measures["odometry"] = float(np.linalg.norm(moved[1] - moved[0])) / max(length, 0.1)
    return measures


def _in_heading(velocity: FloatArray, yaw: FloatArray) -> FloatArray:
    x, y, z = velocity.T
    return np.stack([np.cos(yaw) * x + np.sin(yaw) * y, np.cos(yaw) * y - np.sin(yaw) * x, z], 1)


def _displacement(position: FloatArray, yaw: FloatArray) -> FloatArray:
    """Displacement from the first to the last sample, in the first heading. Shape (2,), in m."""
    moved = position[-1] - position[0]
    return _in_heading(moved[None], yaw[:1])[0, :2]


def _heading_line(plant: Plant) -> FloatArray:
    """Position and heading of the robot at the start: x, y, cos, sin."""
    (x, y, _), (w, _, _, z) = plant.pelvis_pose
    yaw = 2.0 * math.atan2(z, w)
    return np.array([x, y, math.cos(yaw), math.sin(yaw)])


def _ahead(plant: Plant, line: FloatArray) -> float:
    x, y, _ = plant.pelvis_pose[0]
    return float((x - line[0]) * line[2] + (y - line[1]) * line[3])


def _is_past(plant: Plant, line: FloatArray, ahead: float | None) -> bool:
    return ahead is not None and abs(_ahead(plant, line)) >= ahead


def _end_speed(track: Track) -> float:
    last = track.time >= track.time[-1] - _AT_REST
    moved = track.position[last][-1, :2] - track.position[last][0, :2]
    return float(np.linalg.norm(moved)) / _AT_REST


def _copy(value: Any) -> Any:
    """A copy to which changes may be applied."""
    if isinstance(value, Mapping):
        return {key: _copy(entry) for key, entry in value.items()}
    return [_copy(entry) for entry in value] if isinstance(value, (list, tuple)) else value
