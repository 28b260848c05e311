"""Metrics of a run: over the whole run and over each of its phases.

Velocities are those of the pelvis origin in the heading frame, from the true pose.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from cassie_bags.bag.recording import Recording
from cassie_bags.bag.rows import BoolArray, FloatArray
from cassie_bags.signals.falls import fall_time
from cassie_bags.signals.riding import gate_miss
from cassie_bags.signals.track import Track
from cassie_gaits.drive_limits import TORQUE_LIMITS
from cassie_gaits.names import DRIVES
from cassie_msgs.experiment.expectation import PHASE_METRICS, TRACKED, Phase
from cassie_msgs.experiment.script import RiderScript
from cassie_msgs.layout import ControllerStatus

_TRACKED_UNITS = {"vx": "m/s", "vy": "m/s", "yaw_rate": "rad/s", "height": "m"}

UNITS = {
    f"{name}{ending}": unit
    for name, unit in _TRACKED_UNITS.items()
    for ending in ("", "_rms", "_mean", "_mean_error", "_rms_error")
} | {
    **dict.fromkeys(("roll_deg", "pitch_deg", "turn_deg", "sole_pitch_deg", "tilt_deg"), "deg"),
    **dict.fromkeys(("drift", "distance", "height_min", "height_max", "gate_miss"), "m"),
    **dict.fromkeys(("speed_peak", "vx_min", "vx_max"), "m/s"),
    **dict.fromkeys(("fall_time", "duration"), "s"),
    **dict.fromkeys(("peak_torque_ratio", "steps", "real_time_factor", "missed_share"), ""),
}
"""Unit by metric, of a run or of a phase; empty for a number or a ratio."""


@dataclass(frozen=True)
class PhaseMetrics:
    """`expectation.PHASE_METRICS` of a phase, and the means of the commanded set-points."""

    phase: Phase
    reached: bool
    values: dict[str, float]
    commanded: dict[str, float]


@dataclass(frozen=True)
class Metrics:
    """Metrics of a run.

    Attributes:
        fell: Whether the robot fell.
        fall_time: Time of the fall. In s, or None.
        run: `expectation.RUN_METRICS` by name.
        peak_torque: Largest torque of each drive by name. In Nm.
        phases: Metrics of each phase, in the order of the request.
    """

    fell: bool
    fall_time: float | None
    run: dict[str, float]
    peak_torque: dict[str, float]
    phases: tuple[PhaseMetrics, ...]


def measure(
    recording: Recording,
    track: Track,
    phases: Iterable[Phase],
    rider: RiderScript | None = None,
) -> Metrics:
    """Measure a run.

    Args:
        recording: Recording of the run.
        track: Signals of the run.
        phases: Parts of the run to be measured.
        rider: The rider's section of the experiment, with the gates to be passed.
    """
    fell_at = fall_time(track)
    peak = np.abs(track.sensors["drive_torque"]).max(axis=0)
    run = _tracking(track) | _journey(track)
    run["fall_time"] = math.nan if fell_at is None else fell_at
    run["peak_torque_ratio"] = float((peak / TORQUE_LIMITS).max())
    status = recording.rows(ControllerStatus)
    run["steps"] = float(status["step_count"].max()) if len(status) else math.nan
    run["gate_miss"] = gate_miss(recording, rider)
    wall_time = recording.wall_time
    run["real_time_factor"] = run["duration"] / wall_time if wall_time > 0.0 else math.nan
    last = track.sensors[-1]
    missed = float(last["missed_ticks"]) / (float(last["seq"]) + 1.0)
    run["missed_share"] = missed if last["wall_paced"] else math.nan
    return Metrics(
        fell=fell_at is not None,
        fall_time=fell_at,
        run=run,
        peak_torque=dict(zip(DRIVES, peak.tolist(), strict=True)),
        phases=tuple(_phase(track, phase) for phase in phases),
    )


def _tracking(track: Track) -> dict[str, float]:
    values = {}
    for name in TRACKED:
        achieved = track.achieved[name][track.carries]
        error = _known(achieved - track.commanded[name][track.carries])
        values[f"{name}_mean"] = _mean(achieved)
        values[f"{name}_mean_error"] = _mean(error)
        values[f"{name}_rms_error"] = _rms(error)
    return values


def _journey(track: Track) -> dict[str, float]:
    start = int(np.argmax(track.carries)) if track.carries.any() else 0
    away = np.linalg.norm(track.position[start:, :2] - track.position[start, :2], axis=1)
    up = track.upright[start:]
    height = track.achieved["height"][start:]
    return {
        "duration": float(track.time[-1] - track.time[0]),
        "drift": float(away.max()),
        "distance": float(away[-1]),
        "tilt_deg": math.degrees(math.acos(float(np.clip(up.min(), -1.0, 1.0)))),
        "height_min": float(height.min()),
        "height_max": float(height.max()),
    }


def _phase(track: Track, phase: Phase) -> PhaseMetrics:
    reached = bool(track.time[-1] >= phase.t1 - 1.5 * track.tick)
    inside = (track.time >= phase.t0 - 1e-9) & (track.time < phase.t1 - 1e-9)
    if not inside.any():
        nothing = dict.fromkeys(PHASE_METRICS, math.nan)
        return PhaseMetrics(phase, False, nothing, dict.fromkeys(TRACKED, math.nan))
    commanded = {name: _mean(_known(track.commanded[name][inside])) for name in TRACKED}
    values = {name: float(track.achieved[name][inside].mean()) for name in TRACKED}
    for name in TRACKED:
        values[f"{name}_rms"] = _rms(_known((track.achieved[name] - track.commanded[name])[inside]))
    yaw, pitch, roll = track.angles[inside].T
    away = np.linalg.norm(track.position[inside, :2] - track.position[inside][0, :2], axis=1)
    values |= {
        "roll_deg": math.degrees(float(roll.mean())),
        "pitch_deg": math.degrees(float(pitch.mean())),
        "drift": float(away.max()),
        "distance": float(away[-1]),
        "turn_deg": math.degrees(float(yaw[-1] - yaw[0])),
        "speed_peak": _speed_peak(track.position[inside, :2], track.tick),
        "vx_min": float(track.achieved["vx"][inside].min()),
        "vx_max": float(track.achieved["vx"][inside].max()),
        "sole_pitch_deg": sole_pitch(track, inside),
    }
    return PhaseMetrics(phase, reached, values, commanded)


def sole_pitch(track: Track, inside: BoolArray) -> float:
    """95th percentile of the pitch, toe up, of the soles of loaded feet. In deg.

    NaN if no foot is loaded.
    """
    loaded = track.foot_load[inside] > 0.5
    pitches = track.sole_pitch[inside][loaded]
    return math.degrees(float(np.percentile(pitches, 95.0))) if len(pitches) else math.nan


def _speed_peak(position: FloatArray, tick: float) -> float:
    """Largest distance covered in a second, as a speed (m/s); NaN for a shorter phase."""
    second = round(1.0 / tick) if tick > 0.0 else 0
    if not 0 < second < len(position):
        return math.nan
    moved = position[second:] - position[:-second]
    return float(np.linalg.norm(moved, axis=1).max() / (second * tick))


def _known(values: FloatArray) -> FloatArray:
    """The values that are not NaN."""
    return values[np.isfinite(values)]


def _mean(values: FloatArray) -> float:
    return float(values.mean()) if len(values) else math.nan


def _rms(values: FloatArray) -> float:
    return float(np.sqrt((values**2).mean())) if len(values) else math.nan
