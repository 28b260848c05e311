"""A ride on a Segway in figures: its speed, how it stops, how its platform shakes, its gates."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from cassie_bags.bag.recording import Recording
from cassie_bags.bag.rows import Rows, stamps, stamps_ns
from cassie_bags.signals.leg_geometry import euler_angles
from cassie_msgs.experiment.script import Gates, RiderScript, Target
from cassie_teleop.rider import way

FloatArray = npt.NDArray[np.float64]

FIGURES = ("ride_min", "ride_max", "ride_drift", "stop_time", "platform_rms", "gate_miss")
"""What `measure_ride` gives."""

AT_REST = 0.1
"""Speed below which a Segway counts as stopped. In m/s."""

SHAKING = 2.0
"""Time over which the platform's slow tilts are taken out of its shaking. In s."""


def measure_ride(
    recording: Recording, rider: RiderScript | None, window: tuple[float, float]
) -> dict[str, float]:
    """A part of a ride in figures, NaN without a Segway or if the run did not get to its end.

    Args:
        recording: The run.
        rider: Its `rider` section.
        window: From and to. In s.

    Returns:
        Figures by name:

        - ride_min, ride_max (m/s): least and greatest speed forward of the chassis.
        - ride_drift (m): greatest distance of the chassis from where the window began.
        - stop_time (s): until the speed was within `AT_REST`; infinite if it never was.
        - platform_rms (deg): of the platform's pitch about its mean over `SHAKING`.
        - gate_miss (m): greatest distance from the middle of a gate, over the whole run.
    """
    rows = recording.segway
    t0, t1 = window
    time = stamps(rows)
    inside = (time >= t0) & (time < t1)
    if not inside.any() or time[-1] < t1 - 0.05:
        return dict.fromkeys(FIGURES, math.nan)
    pitch = euler_angles(rows["orientation"])[:, 1]
    speed = (np.cos(pitch) * rows["linear"][:, 0] + np.sin(pitch) * rows["linear"][:, 2])[inside]
    away = rows["position"][inside, :2] - rows["position"][inside][0, :2]
    slow = np.flatnonzero(np.abs(speed) < AT_REST)
    return {
        "ride_min": float(speed.min()),
        "ride_max": float(speed.max()),
        "ride_drift": float(np.linalg.norm(away, axis=1).max()),
        "stop_time": float(time[inside][slow[0]] - t0) if len(slow) else math.inf,
        "platform_rms": math.degrees(_shaking(pitch[inside], float(time[1] - time[0]))),
        "gate_miss": gate_miss(recording, rider),
    }


def gate_miss(recording: Recording, rider: RiderScript | None) -> float:
    """Greatest distance of a Segway from the middle of a gate when it is there.

    Returns:
        In m; infinite if a gate was not reached, NaN without gates.
    """
    found = [math.nan]
    if rider is not None:
        ends = [following.t for _, following in pairwise(rider.targets)] + [math.inf]
        for target, end in zip(rider.targets, ends, strict=True):
            if target.gates is not None:
                found += misses(recording, rider, target, target.gates, end)
    return float(np.nanmax(found)) if len(found) > 1 else math.nan


def misses(
    recording: Recording, script: RiderScript, target: Target, gates: Gates, end: float
) -> list[float]:
    """Distance from the middle of each gate of a course that ends at `end` (s). In m."""
    start, line = _start(recording.truth, script, target.t)
    rows = recording.segway
    rows = rows[(stamps(rows) >= target.t) & (stamps(rows) < end)]
    cos, sin = math.cos(line), math.sin(line)
    moved = rows["position"][:, :2] - start
    along, left = moved @ np.array([cos, sin]), moved @ np.array([-sin, cos])
    found = []
    for number in range(gates.count):
        place = gates.first + number * gates.spacing
        beyond = np.flatnonzero(along >= place)
        found.append(abs(left[beyond[0]] - way(gates, place)) if len(beyond) else math.inf)
    return found


def _start(truth: Rows, script: RiderScript, time: float) -> tuple[FloatArray, float]:
    """Where the rider saw the robot when he wanted the course to begin, and its heading."""
    period = round(1e9 / script.rate)
    look = -(-round(time * 1e9) // period) * period
    seen = (look - round(1e9 * script.delay)) // period * period
    row = truth[np.searchsorted(stamps_ns(truth), seen).clip(0, len(truth) - 1)]
    return row["position"][:2], float(euler_angles(row["orientation"][None])[0, 0])


def _shaking(pitch: FloatArray, period: float) -> float:
    """RMS of a pitch about its moving mean; of a shorter one about its mean. In rad."""
    width = round(SHAKING / period)
    if len(pitch) < 2 * width:
        return float(pitch.std())
    mean = np.convolve(pitch, np.full(width, 1.0 / width), mode="valid")
    rest = pitch[width // 2 : width // 2 + len(mean)] - mean
    return float(np.sqrt((rest**2).mean()))
