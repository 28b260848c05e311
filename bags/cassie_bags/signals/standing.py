"""Metrics of standing in a part of a run."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from cassie_bags.bag.rows import Rows, stamps
from cassie_bags.signals.track import Track

STANDING_FIGURES = ("com_rms", "creep", "height_off", "shaking", "stepped")
"""Names of the metrics of `measure_standing`."""

_ENDS = 1.0  # s, over which positions are averaged at both ends of the window


def measure_standing(track: Track, status: Rows, inside: npt.NDArray[np.bool_]) -> dict[str, float]:
    """Metrics of standing over a window.

    Args:
        track: Signals of the run.
        status: Rows of `ControllerStatus`.
        inside: Whether each sample of the track is in the window. Shape (n,).

    Returns:
        Metrics by name, NaN if the window is shorter than two seconds:

        - com_rms (m): RMS distance of the CoM's ground projection from its mean.
        - creep (m): distance from the first second to the last, of the foot that moved more.
        - height_off (m): largest error of the pelvis height.
        - shaking (m/s): largest component of the pelvis velocity in the last second.
        - stepped: whether the robot stepped at all (0 or 1).
    """
    time = track.time[inside]
    if not len(time) or time[-1] - time[0] < 2.0 * _ENDS:
        return dict.fromkeys(STANDING_FIGURES, math.nan)
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


def _sway(track: Track, inside: npt.NDArray[np.bool_], middle: npt.NDArray[np.float64]) -> float:
    """RMS distance of the CoM from its mean position, relative to the true feet. In m."""
    cos, sin = np.cos(track.angles[inside, 0]), np.sin(track.angles[inside, 0])
    x, y, _ = track.state["com_position"][inside].T
    place = middle + np.stack([cos * x - sin * y, sin * x + cos * y], axis=1)
    return float(np.sqrt(((place - place.mean(axis=0)) ** 2).sum(axis=1).mean()))
