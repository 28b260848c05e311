"""Pictures of a run: the left knee's phase portrait, speed tracking and footsteps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import numpy.typing as npt
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from cassie_bags.signals.footsteps import placements
from cassie_bags.signals.metrics import Phase
from cassie_bags.signals.track import AVERAGED_OVER, Track
from cassie_gaits.names import DRIVES
from cassie_msgs.layout import RobotMode

FloatArray = npt.NDArray[np.float64]

DARK, BLUE, ORANGE, GREY = "#222222", "#0072b2", "#d55e00", "#9a9a9a"

_PANELS = (
    ("vx", "forward\n(m/s)"),
    ("vy", "to the left\n(m/s)"),
    ("yaw_rate", "yaw rate\n(rad/s)"),
    ("height", "height\n(m)"),
)

STYLE: dict[str, Any] = {
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "legend.frameon": False,
    "lines.linewidth": 1.0,
    "savefig.dpi": 160,
}


def draw_all(track: Track, phases: Sequence[Phase], title: str, folder: Path) -> dict[str, Path]:
    """Draw every picture into a folder.

    Args:
        track: Signals of the run.
        phases: Phases to mark.
        title: Name of the run.
        folder: Where to; it is made if it is not there.

    Returns:
        The files by name.
    """
    folder.mkdir(parents=True, exist_ok=True)
    drawers: dict[str, Callable[[], Figure]] = {
        "knee_phase_portrait": lambda: knee_phase_portrait(track, title),
        "speed_tracking": lambda: speed_tracking(track, phases, title),
        "footsteps": lambda: footsteps(track, title),
    }
    files = {}
    with matplotlib.rc_context(STYLE):
        for name, drawer in drawers.items():
            files[name] = folder / f"{name}.png"
            drawer().savefig(files[name])
    return files


def knee_phase_portrait(track: Track, title: str) -> Figure:
    """Rate of the left knee over its angle while walking, coloured by the speed asked for."""
    figure, axes = _figure(4.8, 4.2)
    walking = track.mode == RobotMode.WALK
    shown = walking if walking.any() else track.carries | ~track.carries.any()
    knee = DRIVES.index("left_knee")
    angle = track.sensors["drive_position"][:, knee]
    rate = track.sensors["drive_velocity"][:, knee]
    points = np.stack([angle, rate], axis=1)
    segments = np.stack([points[:-1], points[1:]], axis=1)[shown[1:] & shown[:-1]]
    colours = track.commanded["vx"][1:][shown[1:] & shown[:-1]]
    lines = LineCollection(list(segments), linewidths=0.5, alpha=0.8)
    if len(colours) and np.ptp(colours) > 0.0:
        lines.set(array=colours, cmap="viridis")
        figure.colorbar(lines, ax=axes, label="commanded speed (m/s)", shrink=0.8)
    else:
        lines.set(color=BLUE)
    axes.add_collection(lines)
    axes.autoscale_view()
    axes.locator_params(axis="x", nbins=5)
    axes.set(xlabel="left knee angle (rad)", ylabel="left knee rate (rad/s)")
    axes.set_title(f"Left knee, {'walking' if walking.any() else 'standing'}: {title}")
    return figure


def speed_tracking(track: Track, phases: Sequence[Phase], title: str) -> Figure:
    """Commanded and achieved velocities and height over time."""
    figure = Figure(figsize=(9.0, 6.4), layout="constrained")
    panels = figure.subplots(len(_PANELS), 1, sharex=True)
    for axes, (name, label) in zip(panels, _PANELS, strict=True):
        achieved = np.where(track.carries, track.achieved[name], np.nan)
        commanded = np.where(track.carries, track.commanded[name], np.nan)
        if name != "height":
            axes.plot(track.time, achieved, color=BLUE, alpha=0.25, linewidth=0.5)
            achieved = moving_mean(track.time, achieved, AVERAGED_OVER)
        axes.plot(track.time, achieved, color=BLUE, label="achieved")
        axes.plot(track.time, commanded, color=ORANGE, linewidth=1.2, label="commanded")
        axes.set_ylabel(label)
        axes.set_ylim(*_limits(achieved, commanded))
        for index, phase in enumerate(phases):
            shade = 0.18 if index % 2 else 0.09
            axes.axvspan(phase.t0, phase.t1, color=GREY, alpha=shade, linewidth=0)
    end = track.time[-1]
    for phase in (phase for phase in phases if phase.t0 < end):
        middle = 0.5 * (phase.t0 + min(phase.t1, end))
        panels[0].annotate(
            phase.name, (middle, 1.0), xycoords=("data", "axes fraction"), xytext=(0, 3),
            textcoords="offset points", rotation=30, fontsize=7, color=DARK,
        )  # fmt: skip
    panels[-1].set_xlabel("robot time (s)")
    panels[-1].set_xlim(track.time[0], end)
    figure.legend(*panels[1].get_legend_handles_labels(), loc="upper right", ncols=2)
    figure.suptitle(f"Tracking: {title}", x=0.01, ha="left", fontsize=10)
    return figure


def footsteps(track: Track, title: str) -> Figure:
    """Top view of the foot placements with the path of the pelvis."""
    places = np.concatenate([track.position[:, :2], *track.legs[:, :, -1, :2].swapaxes(0, 1)])
    places = places[np.isfinite(places).all(axis=1)]  # damped, the feet are not known
    low, high = places.min(axis=0) - 0.25, places.max(axis=0) + 0.25
    # A straight walk is a long strip: leave room to read it.
    low[1], high[1] = min(low[1], -0.9), max(high[1], 0.9)
    span = high - low
    figure, axes = _figure(9.0, float(np.clip(8.2 * span[1] / span[0] + 1.0, 2.4, 7.4)))
    axes.plot(*track.position[:, :2].T, color=DARK, linewidth=0.8, label="pelvis")
    for leg, (colour, name) in enumerate(((BLUE, "left foot"), (ORANGE, "right foot"))):
        label: str | None = name
        for placement in placements(track):
            if placement.leg == leg:
                ends = np.stack([placement.heel, placement.tip])
                axes.plot(
                    ends[:, 0], ends[:, 1], color=colour, alpha=0.55, linewidth=2.5,
                    solid_capstyle="round", label=label,
                )  # fmt: skip
                label = None
    axes.plot(*track.position[0, :2], "o", color=DARK, markersize=4, label="start")
    axes.set_aspect("equal", adjustable="box")
    axes.set(xlabel="x (m)", ylabel="y (m)", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    figure.legend(*axes.get_legend_handles_labels(), loc="upper right", ncols=4)
    figure.suptitle(f"Footsteps from above: {title}", x=0.01, ha="left", fontsize=10)
    return figure


def moving_mean(time: FloatArray, values: FloatArray, width: float) -> FloatArray:
    """Mean over a window around each sample; NaN where the window holds a NaN.

    Args:
        time: Evenly spaced. Shape (n,), in s.
        values: Shape (n,).
        width: Of the window. In s.
    """
    if len(time) < 3:
        return values
    half = max(1, round(0.5 * width / float(time[1] - time[0])))
    window = 2 * half + 1
    if window > len(values):
        return np.full_like(values, np.nan)
    mean = np.full_like(values, np.nan)
    mean[half:-half] = np.convolve(np.nan_to_num(values), np.ones(window) / window, mode="valid")
    known = np.convolve(np.isfinite(values), np.ones(window), mode="same") > window - 0.5
    return np.where(known, mean, np.nan)


def _limits(*curves: FloatArray) -> tuple[float, float]:
    values = np.concatenate(curves)
    values = values[np.isfinite(values)]
    if not len(values):
        return -1.0, 1.0
    low, high = float(values.min()), float(values.max())
    margin = max(0.1 * (high - low), 0.02)
    return low - margin, high + margin


def _figure(width: float, height: float) -> tuple[Figure, Any]:
    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots()
