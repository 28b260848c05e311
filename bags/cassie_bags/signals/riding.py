"""Metrics of a ride on a Segway: speed, stopping, shaking of the platform, gates."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from cassie_bags.bag.recording import Recording
from cassie_bags.bag.rows import FloatArray, Rows, stamps, stamps_ns
from cassie_bags.signals.leg_geometry import euler_angles
from cassie_msgs.experiment.script import Gates, RiderScript, Target
from cassie_teleop.rider import way

_AT_REST = 0.1  # m/s, speed below which a Segway counts as stopped
_SHAKING = 2.0  # s, width of the moving mean that removes slow tilts from the platform's shaking

RIDE_MEASURES = {
    "ride_min": "m/s, smallest forward speed of the chassis",
    "ride_max": "m/s, largest forward speed of the chassis",
    "ride_drift": "m, largest distance of the chassis from its place at the window's start",
    "stop_time": f"s, time until the speed was within {_AT_REST} m/s; infinite if it never was",
    "platform_rms": f"deg, RMS of the platform's pitch about its mean over {_SHAKING} s",
    "gate_miss": "m, largest distance from the middle of a gate, over the whole run",
}
"""Measures of `measure_ride` by name."""


def measure_ride(
    recording: Recording, rider: RiderScript | None, window: tuple[float, float]
) -> dict[str, float]:
    """Metrics of a part of a ride; NaN without a Segway or if the run ended before the part did.

    Args:
        recording: Recording of the run.
        rider: Section `rider` of the experiment.
        window: Start and end. In s.

    Returns:
        `RIDE_MEASURES`.
    """
    rows = recording.segway
    t0, t1 = window
    time = stamps(rows)
    inside = (time >= t0) & (time < t1)
    if not inside.any() or time[-1] < t1 - 0.05:
        return dict.fromkeys(RIDE_MEASURES, math.nan)
    pitch = euler_angles(rows["orientation"])[:, 1]
    speed = (np.cos(pitch) * rows["linear"][:, 0] + np.sin(pitch) * rows["linear"][:, 2])[inside]
    away = rows["position"][inside, :2] - rows["position"][inside][0, :2]
    slow = np.flatnonzero(np.abs(speed) < _AT_REST)
    return {
        "ride_min": float(speed.min()),
        "ride_max": float(speed.max()),
        "ride_drift": float(np.linalg.norm(away, axis=1).max()),
        "stop_time": float(time[inside][slow[0]] - t0) if len(slow) else math.inf,
        "platform_rms": math.degrees(_shaking(pitch[inside], float(time[1] - time[0]))),
        "gate_miss": gate_miss(recording, rider),
    }


def gate_miss(recording: Recording, rider: RiderScript | None) -> float:
    """Largest distance of a Segway from the middle of a gate as it passes the gate.

    Returns:
        Distance in m; infinite if a gate was not reached, NaN without gates.
    """
    if rider is None:
        return math.nan
    ends = [following.t for _, following in pairwise(rider.targets)] + [math.inf]
    distances = [
        distance
        for target, end in zip(rider.targets, ends, strict=True)
        if target.gates is not None
        for distance in _misses(recording, rider, target, target.gates, end)
    ]
    return float(np.nanmax(distances)) if distances else math.nan


def _misses(
    recording: Recording, rider: RiderScript, target: Target, gates: Gates, end: float
) -> Iterator[float]:
    """Distance from the middle of each gate of a course, which ends at a time (s). In m."""
    start, line = _start(recording.truth, rider, target.t)
    rows = recording.segway
    rows = rows[(stamps(rows) >= target.t) & (stamps(rows) < end)]
    cos, sin = math.cos(line), math.sin(line)
    moved = rows["position"][:, :2] - start
    along, left = moved @ np.array([cos, sin]), moved @ np.array([-sin, cos])
    for number in range(gates.count):
        place = gates.first + number * gates.spacing
        beyond = np.flatnonzero(along >= place)
        yield abs(left[beyond[0]] - way(gates, place)) if len(beyond) else math.inf


def _start(truth: Rows, script: RiderScript, time: float) -> tuple[FloatArray, float]:
    """Position and heading of the robot as the rider saw it at the planned start of the course."""
    period = round(1e9 / script.rate)
    look = -(-round(time * 1e9) // period) * period
    seen = (look - round(1e9 * script.delay)) // period * period
    row = truth[np.searchsorted(stamps_ns(truth), seen).clip(0, len(truth) - 1)]
    return row["position"][:2], float(euler_angles(row["orientation"][None])[0, 0])


def _shaking(pitch: FloatArray, period: float) -> float:
    """RMS of a pitch about its moving mean, or about its mean if it is short. In rad."""
    width = round(_SHAKING / period)
    if len(pitch) < 2 * width:
        return float(pitch.std())
    mean = np.convolve(pitch, np.full(width, 1.0 / width), mode="valid")
    rest = pitch[width // 2 : width // 2 + len(mean)] - mean
    return float(np.sqrt((rest**2).mean()))
