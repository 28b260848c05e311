"""Effort of a part of a walk: mechanical work and torques of the drives."""

from __future__ import annotations

import math

import numpy as np

from cassie_bags.signals.track import Track
from cassie_gaits.robot import GRAVITY

EFFORT_FIGURES = ("transport_work", "transport_work_abs", "torque_rms")
"""Names of the metrics of `measure_effort`."""

_WALKED = 0.5  # m, least distance for a cost of transport


def measure_effort(track: Track, window: tuple[float, float], mass: float) -> dict[str, float]:
    """Effort in a part of a run, from the torques and velocities that the drives report.

    Args:
        track: Signals of the run.
        window: Start and end. In s.
        mass: Mass of the robot and its load. In kg.

    Returns:
        transport_work: positive mechanical work of the drives over weight and distance;
        transport_work_abs: positive plus absolute negative work over weight and distance;
        torque_rms: RMS over time of the norm of all torques (Nm). All are NaN if the run ended
        before the window did. Both costs are NaN if the robot moved by less than half a metre.
    """
    t0, t1 = window
    inside = (track.time >= t0) & (track.time < t1)
    tick = float(track.time[1] - track.time[0])
    if track.time[-1] < t1 - 1.5 * tick:
        return dict.fromkeys(EFFORT_FIGURES, math.nan)
    sensors = track.sensors[inside]
    torque, power = sensors["drive_torque"], sensors["drive_torque"] * sensors["drive_velocity"]
    ends = track.position[inside][[0, -1], :2]
    moved = float(np.linalg.norm(ends[1] - ends[0]))
    by_weight = tick / (mass * GRAVITY * moved) if moved >= _WALKED else math.nan
    return {
        "transport_work": float(power.clip(0.0).sum()) * by_weight,
        "transport_work_abs": float(np.abs(power).sum()) * by_weight,
        "torque_rms": float(np.sqrt((torque**2).sum(axis=1).mean())),
    }
