"""What a part of a walk costs: mechanical work and torques of the drives, in figures."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from cassie_bags.signals.track import Track
from cassie_gaits.robot import GRAVITY

FloatArray = npt.NDArray[np.float64]

EFFORT_FIGURES = ("transport_work", "transport_work_abs", "torque_rms")
"""What `measure_effort` gives."""

_WALKED = 0.5  # distance from which a cost of transport is told, in m


def measure_effort(track: Track, window: tuple[float, float], mass: float) -> dict[str, float]:
    """The cost of a part of a run, from the torques and velocities that the drives report.

    Args:
        track: Signals of the run.
        window: From and to. In s.
        mass: Of the robot and what it carries. In kg.

    Returns:
        transport_work: positive mechanical work of the drives by weight and distance;
        transport_work_abs: the same of positive and negative work; torque_rms: RMS over time of
        the norm of all torques (Nm). NaN if the run did not get to the window's end; both costs
        also if it moved by less than half a metre.
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
