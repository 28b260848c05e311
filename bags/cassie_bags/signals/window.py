"""Measures of a part of a run: walking, standing, effort, and the estimate against the truth."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cassie_bags.bag.rows import BoolArray, FloatArray, Rows, stamps
from cassie_bags.signals.leg_geometry import in_heading
from cassie_bags.signals.metrics import sole_pitch
from cassie_bags.signals.track import AVERAGED_OVER, Track
from cassie_gaits.gait_library import OUTPUTS
from cassie_gaits.robot import GRAVITY
from cassie_msgs.layout import RobotMode

EFFORT_MEASURES = {
    "transport_work": "positive mechanical work of the drives over weight and distance",
    "transport_work_abs": "positive plus absolute negative work over weight and distance",
    "torque_rms": "Nm, RMS over time of the norm of all torques",
}
"""Measures of `measure_effort` by name."""

STANDING_MEASURES = {
    "com_rms": "m, RMS distance of the CoM's ground projection from its mean",
    "creep": "m, distance from the first second to the last, of the foot that moved more",
    "height_off": "m, largest error of the pelvis height",
    "shaking": "m/s, largest component of the pelvis velocity in the last second",
    "stepped": "whether the robot stepped at all (0 or 1)",
}
"""Measures of `measure_standing` by name."""

TRACKING = tuple(f"tracking_{name}" for name in OUTPUTS)
"""RMS tracking error of each of the nine outputs, by name of the measure."""

WINDOW_MEASURES = {
    "vx": "m/s, mean in the heading frame",
    "vy": "m/s, mean in the heading frame",
    "yaw_rate": "rad/s, mean of the means over two steps",
    "vy_slip": "m/s, largest sideways velocity over two steps",
    "velocity_off": "m/s, largest error of the horizontal velocity over two steps",
    "step_rate": "1/s, touchdowns per second",
    "drift": "m, largest distance from the position at the window's start",
    "drift_of_steps": "m, largest drift of the position over two steps",
    "depth": "m, median depth of the lower sole below the height of the start",
    "sole_pitch": "deg, see `metrics.sole_pitch`",
    **dict.fromkeys(
        ("rmse_vx", "rmse_vy", "rmse_vz"),
        "m/s, RMSE of the estimated velocity in the heading frame",
    ),
    "rmse_tilt": "deg, RMSE of estimated roll or pitch, the larger one",
    "odometry": "error of the estimated displacement over its length",
    "tracking": "rad and m, RMS error of the nine outputs",
    **dict.fromkeys(TRACKING, "rad or m, RMS error of one output"),
    **STANDING_MEASURES,
}
"""Measures of `measure_window` by name. Means over two steps are moving means without the sway."""

_MIN_DISTANCE = 0.5  # m, least distance for a cost of transport
_ENDS = 1.0  # s, over which positions are averaged at both ends of the window


@dataclass(frozen=True)
class EstimationError:
    """Estimate minus truth at each tick.

    Attributes:
        velocity: Error of the pelvis velocity in the true heading frame. Shape (n, 3), in m/s.
        tilt: Error of roll and pitch. Shape (n, 2), in rad.
        position: Error of the horizontal displacement since the first tick, world axes. Shape
            (n, 2), in m.
    """

    velocity: FloatArray
    tilt: FloatArray
    position: FloatArray


def estimation_error(track: Track) -> EstimationError:
    """Errors of the estimated states of a track."""
    q, place = track.state["q"], track.position[:, :2]
    return EstimationError(
        velocity=in_heading(track.state["v"][:, :3] - track.velocity, track.angles[:, 0]),
        tilt=q[:, [5, 4]] - track.angles[:, [2, 1]],
        position=(q[:, :2] - q[0, :2]) - (place - place[0]),
    )


def measure_window(track: Track, status: Rows, window: tuple[float, float]) -> dict[str, float]:
    """Measures of a part of a run, NaN if the run ended before the part did.

    Args:
        track: Signals of the run.
        status: Rows of `ControllerStatus`.
        window: Start and end. In s.

    Returns:
        `WINDOW_MEASURES`.
    """
    t0, t1 = window
    if (inside := _inside(track, window)) is None:
        return dict.fromkeys(WINDOW_MEASURES, math.nan)
    away = track.position[inside, :2] - track.position[inside][0, :2]
    vx, vy, yaw_rate = (track.achieved[name][inside] for name in ("vx", "vy", "yaw_rate"))
    two_steps = round(AVERAGED_OVER / track.tick)
    rows = status[(stamps(status) >= t0) & (stamps(status) < t1)]
    errors = rows["y"][rows["mode"] == RobotMode.WALK]
    squares = (errors**2).mean(axis=0) if len(errors) else np.full(len(OUTPUTS), math.nan)
    return {
        "vx": float(vx.mean()),
        "vy": float(vy.mean()),
        "yaw_rate": _without_sway(yaw_rate, two_steps),
        "vy_slip": _slip(vy, two_steps),
        "velocity_off": _velocity_off(track, inside, two_steps),
        "step_rate": float(np.ptp(rows["step_count"])) / (t1 - t0),
        "drift": float(np.linalg.norm(away, axis=1).max()),
        "drift_of_steps": _drift_of_steps(away, two_steps),
        "depth": -float(np.median(track.sole_height[inside].min(axis=1))),
        "sole_pitch": sole_pitch(track, inside),
        **_estimate_errors(track, inside),
        "tracking": float(np.sqrt(squares.mean())),
        **dict(zip(TRACKING, np.sqrt(squares).tolist(), strict=True)),
        **measure_standing(track, status, inside),
    }


def _inside(track: Track, window: tuple[float, float]) -> BoolArray | None:
    """Whether each sample is in a window (s); None if the run ended before the window did."""
    t0, t1 = window
    ended = track.time[-1] < t1 - 1.5 * track.tick
    return None if ended else (track.time >= t0) & (track.time < t1)


def _over_two_steps(values: FloatArray, width: int) -> FloatArray:
    """Means over every two steps, `width` ticks, which remove the sway of steps."""
    return np.convolve(values, np.full(width, 1.0 / width), mode="valid")


def _slip(vy: FloatArray, width: int) -> float:
    """Largest magnitude of the sideways velocity's mean over two steps. In m/s."""
    return float(np.abs(_over_two_steps(vy, width)).max()) if len(vy) >= width else math.nan


def _velocity_off(track: Track, inside: BoolArray, width: int) -> float:
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


def _estimate_errors(track: Track, inside: BoolArray) -> dict[str, float]:
    """Errors of the estimated velocity, tilt and displacement, compared with the truth."""
    rows, angles = track.state[inside], track.angles[inside]
    yaw, true_yaw = rows["q"][:, 3], angles[:, 0]
    error = in_heading(rows["v"][:, :3], yaw) - in_heading(track.velocity[inside], true_yaw)
    rmse_vx, rmse_vy, rmse_vz = np.sqrt((error**2).mean(axis=0)).tolist()
    tilt = np.degrees(rows["q"][:, [4, 5]] - angles[:, 1:])
    moved = _displacement(track.position[inside], true_yaw)
    off = _displacement(rows["q"][:, :3], yaw) - moved
    return {
        "rmse_vx": rmse_vx,
        "rmse_vy": rmse_vy,
        "rmse_vz": rmse_vz,
        "rmse_tilt": float(np.sqrt((tilt**2).mean(axis=0)).max()),
        "odometry": float(np.linalg.norm(off)) / max(float(np.linalg.norm(moved)), 0.1),
    }


def _displacement(position: FloatArray, yaw: FloatArray) -> FloatArray:
    """Displacement from the first to the last sample, in the first heading. Shape (2,), in m."""
    moved = position[-1] - position[0]
    return in_heading(moved[None], yaw[:1])[0, :2]


def measure_standing(track: Track, status: Rows, inside: BoolArray) -> dict[str, float]:
    """Metrics of standing over a window.

    Args:
        track: Signals of the run.
        status: Rows of `ControllerStatus`.
        inside: Whether each sample of the track is in the window. Shape (n,).

    Returns:
        `STANDING_MEASURES`, NaN if the window is shorter than two seconds.
    """
    time = track.time[inside]
    if not len(time) or time[-1] - time[0] < 2.0 * _ENDS:
        return dict.fromkeys(STANDING_MEASURES, math.nan)
    first, last = time < time[0] + _ENDS, time > time[-1] - _ENDS
    feet = track.legs[inside][:, :, -2:, :2].mean(axis=2)
    moved = np.linalg.norm(feet[last].mean(axis=0) - feet[first].mean(axis=0), axis=1)
    height = track.achieved["height"][inside] - track.commanded["height"][inside]
    walked = status[(stamps(status) >= time[0]) & (stamps(status) <= time[-1])]["stance_leg"] >= 0.0
    return {
        "com_rms": _sway(track, inside, feet.mean(axis=1)),
        "creep": float(moved.max()),
        "height_off": float(np.abs(height).max()),
        "shaking": float(np.abs(track.velocity[inside][last]).max()),
        "stepped": float(walked.any()),
    }


def _sway(track: Track, inside: BoolArray, middle: FloatArray) -> float:
    """RMS distance of the CoM from its mean position, relative to the true feet. In m."""
    cos, sin = np.cos(track.angles[inside, 0]), np.sin(track.angles[inside, 0])
    x, y, _ = track.state["com_position"][inside].T
    place = middle + np.stack([cos * x - sin * y, sin * x + cos * y], axis=1)
    return float(np.sqrt(((place - place.mean(axis=0)) ** 2).sum(axis=1).mean()))


def measure_effort(track: Track, window: tuple[float, float], mass: float) -> dict[str, float]:
    """Effort in a part of a run, from the torques and velocities that the drives report.

    Args:
        track: Signals of the run.
        window: Start and end. In s.
        mass: Mass of the robot and its load. In kg.

    Returns:
        `EFFORT_MEASURES`. All are NaN if the run ended before the window did. Both costs are NaN
        if the robot moved by less than half a metre.
    """
    if (inside := _inside(track, window)) is None:
        return dict.fromkeys(EFFORT_MEASURES, math.nan)
    sensors = track.sensors[inside]
    torque, power = sensors["drive_torque"], sensors["drive_torque"] * sensors["drive_velocity"]
    ends = track.position[inside][[0, -1], :2]
    moved = float(np.linalg.norm(ends[1] - ends[0]))
    by_weight = track.tick / (mass * GRAVITY * moved) if moved >= _MIN_DISTANCE else math.nan
    return {
        "transport_work": float(power.clip(0.0).sum()) * by_weight,
        "transport_work_abs": float(np.abs(power).sum()) * by_weight,
        "torque_rms": float(np.sqrt((torque**2).sum(axis=1).mean())),
    }
