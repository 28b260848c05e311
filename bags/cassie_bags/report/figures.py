"""Pictures of a run: modes, tracking, outputs, forces, torques, estimate and footsteps."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from cassie_bags.bag.fields import OUTPUTS
from cassie_bags.bag.rows import BoolArray, FloatArray, stamps
from cassie_bags.bag.summary import Interval
from cassie_bags.report.view import View
from cassie_bags.signals.events import Event
from cassie_bags.signals.footsteps import Placement, placements
from cassie_bags.signals.track import AVERAGED_OVER, Track
from cassie_bags.signals.window import estimation_error
from cassie_gaits.drive_limits import TORQUE_LIMITS
from cassie_gaits.names import DRIVES, LEG_DRIVES, LEGS
from cassie_msgs.layout import RobotMode

DARK, BLUE, ORANGE, GREY = "#222222", "#0072b2", "#d55e00", "#9a9a9a"
GREEN, PURPLE, RED = "#117733", "#aa4499", "#cc0000"

EVENT_COLOURS = {
    "push": PURPLE,
    "gantry": GREEN,
    "fault": "#b8860b",
    "node": "#555555",
    "fall": RED,
}
MODE_COLOURS = {
    "off": "#dddddd", "damp": "#f0b8a8", "stand": "#c9dcee", "walk": "#b9dfc4", "segway": "#efe2a6"
}  # fmt: skip

_MIN_SAMPLES = 20  # least number of walking status samples for the outputs over the phase
_PANELS = (
    ("vx", "forward\n(m/s)"),
    ("vy", "to the left\n(m/s)"),
    ("yaw_rate", "yaw rate\n(rad/s)"),
    ("height", "height\n(m)"),
)
_MAX_NAME = 24  # characters of an event's name above the modes
_FAINT: dict[str, Any] = {"alpha": 0.3, "linewidth": 0.5}
_BINS = 25  # bins of the phase
_AFTER_PUSH = 0.5  # s after a push that count as pushed in outputs and phase portrait
_NARROW = 10.0  # ratio of length to width of a walk above which it is drawn in rows
_ROW_LENGTH, _MOST_ROWS = 15.0, 8  # m of a row, and number of rows of footsteps
_MEAN = 0.2  # s, width of the moving mean of the estimator's velocity error

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


@contextmanager
def drawing(path: Path, width: float, height: float) -> Iterator[Figure]:
    """A figure of a size (inches) in our style, for the body of a `with` statement to draw.

    After the body it is written to `path`, whose ending decides the format.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(width, height), layout="constrained")
        yield figure
        figure.savefig(path)


def draw_all(view: View, folder: Path) -> dict[str, Path]:
    """Draw every picture into a folder, which is made if it does not exist.

    Returns:
        The files by name; a picture is left out if the run has no data for it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    files = {}
    with matplotlib.rc_context(STYLE):
        for name, drawer in DRAWERS.items():
            figure = drawer(view)
            if figure is not None:
                files[name] = folder / f"{name}.png"
                figure.savefig(files[name])
    return files


def mode_timeline(view: View) -> Figure:
    """Modes over time, and every event by name."""
    figure = _figure(view, "Modes", 9.0, 2.1)
    axes = figure.subplots()
    draw_modes(axes, view.modes)
    mark(axes, view.events)
    last = -np.inf
    span = float(view.track.time[-1] - view.track.time[0]) or 1.0
    for event in view.events:
        inside = event.t0 <= view.track.time[-1]
        if inside and event.t0 - last > 0.03 * span:  # names that would overlap are left out
            _name_above(axes, event.t0, event.text, EVENT_COLOURS[event.kind])
            last = event.t0
    axes.set(yticks=[], xlabel="robot time (s)", ylim=(0.0, 1.0))
    _limit_time(axes, view)
    return figure


def draw_modes(axes: Any, modes: Iterable[Interval]) -> None:
    """Modes as coloured bars with their names."""
    modes = list(modes)
    span = modes[-1].t1 - modes[0].t0 if modes else 1.0
    for mode in modes:
        axes.axvspan(mode.t0, mode.t1, color=MODE_COLOURS.get(mode.name, GREY), linewidth=0)
        if mode.t1 - mode.t0 > 0.04 * span:
            middle = 0.5 * (mode.t0 + mode.t1)
            axes.text(middle, 0.5, mode.name, ha="center", va="center", fontsize=8, color=DARK)


def _name_above(axes: Any, time: float, name: str, colour: str) -> None:
    axes.annotate(
        shortened(name, _MAX_NAME), (time, 1.0), xycoords=("data", "axes fraction"), xytext=(0, 3),
        textcoords="offset points", rotation=30, fontsize=7, color=colour,
    )  # fmt: skip


def shortened(name: str, longest: int) -> str:
    """At most so many characters of a name, for its place in a picture; tables have all of it."""
    return name if len(name) <= longest else f"{name[: longest - 1]}…"


def mark(axes: Any, events: Iterable[Event]) -> None:
    """Mark events on a plot over time."""
    for event in events:
        colour = EVENT_COLOURS[event.kind]
        if event.t1 > event.t0:
            axes.axvspan(event.t0, event.t1, color=colour, alpha=0.15, linewidth=0)
        axes.axvline(event.t0, color=colour, linewidth=0.8, linestyle="--")


def event_legend(events: Iterable[Event]) -> tuple[list[Line2D], list[str]]:
    """Lines and names for the legend of marked events, one of each kind."""
    kinds = list(dict.fromkeys(event.kind for event in events))
    return [
        Line2D([], [], color=EVENT_COLOURS[kind], linestyle="--", linewidth=0.8) for kind in kinds
    ], kinds


def speed_tracking(view: View) -> Figure:
    """Commanded and achieved velocities and height over time."""
    figure, panels = _over_time(view, "Tracking", len(_PANELS), 6.4)
    for axes, (name, label) in zip(panels, _PANELS, strict=True):
        _draw_tracked(axes, view.track, name, label)
        for index, phase in enumerate(view.phases):
            shade = 0.18 if index % 2 else 0.09
            axes.axvspan(phase.t0, phase.t1, color=GREY, alpha=shade, linewidth=0)
    end = view.track.time[-1]
    for phase in (phase for phase in view.phases if phase.t0 < end):
        _name_above(panels[0], 0.5 * (phase.t0 + min(phase.t1, end)), phase.name, DARK)
    return _explained(figure, panels, view)


def _draw_tracked(axes: Any, track: Track, name: str, label: str) -> None:
    """Commanded and achieved values; also the mean over two steps if they sway with the gait."""
    achieved = np.where(track.carries, track.achieved[name], np.nan)
    commanded = np.where(track.carries, track.commanded[name], np.nan)
    sways = name != "height"
    axes.plot(track.time, achieved, color=BLUE, label="achieved", **(_FAINT if sways else {}))
    if sways:
        mean = moving_mean(track.time, achieved, AVERAGED_OVER)
        axes.plot(track.time, mean, color=BLUE, label=f"mean over {AVERAGED_OVER:g} s")
    axes.plot(track.time, commanded, color=ORANGE, linewidth=1.2, label="commanded")
    axes.set(ylabel=label, ylim=_limits(achieved, commanded))


def overview(view: View) -> Figure:
    """Modes, tracking, foot forces and the largest torque, one above the other."""
    track = view.track
    figure = _figure(view, "Overview", 9.0, 8.4)
    ratios = [0.35, *[1.0] * (len(_PANELS) + 2)]
    modes, *panels = figure.subplots(len(ratios), 1, sharex=True, height_ratios=ratios)
    draw_modes(modes, view.modes)
    modes.set(yticks=[], ylim=(0.0, 1.0))
    for axes, (name, label) in zip(panels, _PANELS, strict=False):
        _draw_tracked(axes, track, name, label)
    forces, torque = panels[-2:]
    for leg, colour in enumerate((DARK, GREY)):  # blue and orange are achieved and commanded
        force = track.state["foot_force"][:, leg]
        forces.plot(track.time, force, color=colour, linewidth=0.5, label=LEGS[leg])
    forces.set_ylabel("foot force\n(N)")
    _legend_beside(forces)
    ratio = 100.0 * np.abs(track.sensors["drive_torque"]) / TORQUE_LIMITS
    torque.plot(track.time, ratio.max(axis=1), color=DARK, linewidth=0.5)
    torque.set(ylabel="largest\ntorque (%)", ylim=(0.0, 108.0))
    for axes in (modes, *panels):
        mark(axes, view.events)
    _limit_time(torque, view)
    return _explained(figure, panels, view)


def outputs_by_phase(view: View) -> Figure | None:
    """Error of each output over the phase of a step, by stance leg; None without steps."""
    rows = view.status[(view.status["mode"] == RobotMode.WALK) & (view.status["stance_leg"] >= 0)]
    if len(rows) < _MIN_SAMPLES:
        return None
    figure = _figure(view, "Outputs' errors", 9.0, 6.0)
    panels = figure.subplots(3, 3, sharex=True).ravel()
    pushed = _pushed(stamps(rows), view.events)
    edges = np.linspace(0.0, 1.0, _BINS + 1)
    for index, (axes, name) in enumerate(zip(panels, OUTPUTS, strict=True)):
        metres = name.endswith("length")
        error = rows["y"][:, index] * (1e3 if metres else 180.0 / np.pi)
        for leg, colour in enumerate((BLUE, ORANGE)):
            own = rows["stance_leg"] == leg
            axes.plot(rows["phase"][own], error[own], ".", color=colour, alpha=0.12, markersize=2)
            where = np.digitize(rows["phase"][own], edges) - 1
            means = [
                error[own][where == b].mean() if (where == b).any() else np.nan
                for b in range(_BINS)
            ]
            axes.plot(0.5 * (edges[1:] + edges[:-1]), means, color=colour, linewidth=1.6)
        axes.plot(rows["phase"][pushed], error[pushed], ".", color=PURPLE, markersize=3)
        axes.axhline(0.0, color=GREY, linewidth=0.6)
        axes.set_title(f"{name.replace('_', ' ')} ({'mm' if metres else 'deg'})", fontsize=8)
        spread = np.percentile(np.abs(error), 99.0) if np.isfinite(error).all() else 0.0
        axes.set_ylim(-max(1.2 * spread, 1e-3), max(1.2 * spread, 1e-3))
    for axes in panels[-3:]:
        axes.set_xlabel("phase of the step")
    handles = [
        Line2D([], [], color=c, label=f"{leg} stance")
        for leg, c in zip(LEGS, (BLUE, ORANGE), strict=True)
    ]
    if pushed.any():
        handles.append(Line2D([], [], color=PURPLE, marker=".", linestyle="", label="pushed"))
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


def knee_phase_portrait(view: View) -> Figure:
    """Rate of the left knee over its angle while walking, coloured by the commanded speed."""
    track = view.track
    figure = Figure(figsize=(4.8, 4.2), layout="constrained")
    axes = figure.subplots()
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
    pushed = _pushed(track.time, view.events) & shown
    if pushed.any():
        axes.plot(angle[pushed], rate[pushed], ".", color=PURPLE, markersize=2, label="pushed")
        axes.legend(loc="upper right")
    axes.autoscale_view()
    axes.locator_params(axis="x", nbins=5)
    axes.set(xlabel="left knee angle (rad)", ylabel="left knee rate (rad/s)")
    axes.set_title(f"Left knee, {'walking' if walking.any() else 'standing'}: {view.title}")
    return figure


def foot_forces(view: View) -> Figure:
    """Vertical force on each foot from the springs' deflection.

    It is below 0 where a leg swings: the springs then carry the lower leg, as it is pulled up.
    """
    forces = view.track.state["foot_force"]
    figure, panels = _over_time(view, "Vertical foot forces by the springs", 2, 3.4)
    for leg, (axes, colour) in enumerate(zip(panels, (BLUE, ORANGE), strict=True)):
        axes.plot(view.track.time, forces[:, leg], color=colour, linewidth=0.6)
        axes.set(ylabel=f"{LEGS[leg]}\n(N)", ylim=_limits(forces))
    return _explained(figure, panels, view)


def torques(view: View) -> Figure:
    """Torque of each drive over its limit."""
    ratio = 100.0 * np.abs(view.track.sensors["drive_torque"]) / TORQUE_LIMITS
    figure, panels = _over_time(view, "Torques by their limits", len(LEG_DRIVES), 6.4)
    for index, (axes, drive) in enumerate(zip(panels, LEG_DRIVES, strict=True)):
        for leg, colour in enumerate((BLUE, ORANGE)):
            values = ratio[:, leg * len(LEG_DRIVES) + index]
            axes.plot(view.track.time, values, color=colour, linewidth=0.5, label=LEGS[leg])
        axes.axhline(100.0, color=RED, linewidth=0.7)
        axes.set(ylabel=f"{drive.replace('_', ' ')}\n(%)", ylim=(0.0, 108.0))
    return _explained(figure, panels, view)


def estimate(view: View) -> Figure | None:
    """Errors of the state estimate: velocity, tilt and displacement; None without a true pose."""
    if view.estimated:
        return None
    track = view.track
    error = estimation_error(track)
    figure, panels = _over_time(view, "Estimate less truth", 3, 4.8)
    rows = (
        (error.velocity, ("forward", "to the left", "up"), "velocity\n(m/s)", 1.0),
        (error.tilt, ("roll", "pitch"), "tilt\n(deg)", 180.0 / np.pi),
        (error.position, ("x", "y"), "displacement\n(m)", 1.0),
    )
    for axes, (values, names, label, scale) in zip(panels, rows, strict=True):
        curves = []
        for index, (name, colour) in enumerate(zip(names, (BLUE, ORANGE, GREEN), strict=False)):
            curve = scale * values[:, index]
            if label.startswith("velocity"):
                curve = moving_mean(track.time, curve, _MEAN)
            curves.append(curve)
            axes.plot(track.time, curve, color=colour, linewidth=0.8, label=name)
        axes.axhline(0.0, color=GREY, linewidth=0.6)
        axes.set(ylabel=label, ylim=_limits(*curves, least_margin=0.002))
        _legend_beside(axes)
    return _explained(figure, panels, view, legend=False)


def footsteps(view: View) -> Figure:
    """Top view of the foot placements with the path of the pelvis, a long walk in several rows."""
    track = view.track
    places = np.concatenate([track.position[:, :2], *track.legs[:, :, -1, :2].swapaxes(0, 1)])
    places = places[np.isfinite(places).all(axis=1)]  # the feet are unknown while the drives damp
    low, high = places.min(axis=0) - 0.25, places.max(axis=0) + 0.25
    # A straight walk is a long strip: leave room to read it.
    low[1], high[1] = min(low[1], -0.9), max(high[1], 0.9)
    span = high - low
    count = 1
    if span[0] > _NARROW * span[1]:
        count = min(_MOST_ROWS, math.ceil(span[0] / _ROW_LENGTH))
    length = span[0] / count
    if count == 1:
        height = float(np.clip(8.2 * span[1] / length + 1.0, 2.4, 5.4))
    else:
        height = count * (8.2 * span[1] / length + 0.35) + 0.8
    figure = _figure(view, "Footsteps from above", 9.0, height)
    rows = list(figure.subplots(count, 1, squeeze=False)[:, 0])
    stood = placements(track)
    for index, axes in enumerate(rows):
        begin = low[0] + index * length
        _draw_footsteps(axes, view, [one for one in stood if _lies(one, begin, begin + length)])
        axes.set_aspect("equal", adjustable="box")
        axes.set(ylabel="y (m)", xlim=(begin, begin + length), ylim=(low[1], high[1]))
        axes.yaxis.set_major_locator(MaxNLocator(4))
    rows[-1].set_xlabel("x (m)")
    known = [pair for axes in rows for pair in zip(*axes.get_legend_handles_labels(), strict=True)]
    legend = {label: handle for handle, label in known}
    figure.legend(
        list(legend.values()), list(legend), loc="outside lower center", ncols=len(legend)
    )
    return figure


def _lies(placement: Placement, begin: float, end: float) -> bool:
    """Whether a part of a sole is between two distances ahead (m)."""
    ends = sorted((float(placement.heel[0]), float(placement.tip[0])))
    return ends[0] < end and ends[1] > begin


def _draw_footsteps(axes: Any, view: View, stood: Sequence[Placement]) -> None:
    """Draw the pelvis's path, some placements, the start and the events."""
    track = view.track
    axes.plot(*track.position[:, :2].T, color=DARK, linewidth=0.8, label="pelvis")
    for leg, (colour, name) in enumerate(((BLUE, "left foot"), (ORANGE, "right foot"))):
        label: str | None = name
        for placement in stood:
            if placement.leg == leg:
                ends = np.stack([placement.heel, placement.tip])
                axes.plot(
                    ends[:, 0], ends[:, 1], color=colour, alpha=0.55, linewidth=2.5,
                    solid_capstyle="round", label=label,
                )  # fmt: skip
                label = None
    axes.plot(*track.position[0, :2], "o", color=DARK, markersize=4, label="start")
    for kind in dict.fromkeys(event.kind for event in view.events):
        times = [event.t0 for event in view.events if event.kind == kind]
        index = np.searchsorted(track.time, times).clip(0, len(track.time) - 1)
        axes.plot(*track.position[index, :2].T, "x", color=EVENT_COLOURS[kind], label=kind)


DRAWERS: dict[str, Callable[[View], Figure | None]] = {
    "mode_timeline": mode_timeline,
    "speed_tracking": speed_tracking,
    "footsteps": footsteps,
    "foot_forces": foot_forces,
    "torques": torques,
    "outputs_by_phase": outputs_by_phase,
    "knee_phase_portrait": knee_phase_portrait,
    "estimate": estimate,
}
"""Functions that draw the pictures, by name, in the order of a page."""


def moving_mean(time: FloatArray, values: FloatArray, width: float) -> FloatArray:
    """Mean over a window around each sample; NaN where the window contains a NaN.

    Args:
        time: Evenly spaced times. Shape (n,), in s.
        values: Values at these times. Shape (n,).
        width: Width of the window. In s.
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


def _figure(view: View, title: str, width: float, height: float) -> Figure:
    """A figure of a size (inches) with a title."""
    figure = Figure(figsize=(width, height), layout="constrained")
    figure.suptitle(f"{title}: {view.title}", x=0.01, ha="left", fontsize=10)
    return figure


def _over_time(view: View, title: str, count: int, height: float) -> tuple[Figure, Sequence[Any]]:
    """Panels over time, with every event marked."""
    figure = _figure(view, title, 9.0, height)
    panels = list(figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0])
    for axes in panels:
        mark(axes, view.events)
    _limit_time(panels[-1], view)
    return figure, panels


def _limit_time(axes: Any, view: View) -> None:
    start, end = float(view.track.time[0]), float(view.track.time[-1])
    axes.set_xlim(start, max(end, start + 1e-3))


def _explained(figure: Figure, panels: Sequence[Any], view: View, *, legend: bool = True) -> Figure:
    """A figure over time with a legend of the curves and of the marked events."""
    handles, labels = panels[1].get_legend_handles_labels() if legend else ([], [])
    lines, kinds = event_legend(view.events)
    handles, labels = [*handles, *lines], [*labels, *kinds]
    panels[-1].set_xlabel("robot time (s)")
    if handles:
        figure.legend(handles, labels, loc="upper right", ncols=len(handles))
    return figure


def _legend_beside(axes: Any) -> None:
    """A legend to the right of a panel, where it covers no curve."""
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=7)


def _pushed(time: FloatArray, events: Iterable[Event]) -> BoolArray:
    """Samples during a push and shortly after it."""
    pushed = np.zeros(len(time), bool)
    for event in events:
        if event.kind == "push":
            pushed |= (time >= event.t0) & (time < event.t1 + _AFTER_PUSH)
    return pushed


def _limits(*curves: FloatArray, least_margin: float = 0.02) -> tuple[float, float]:
    values = np.concatenate([curve.ravel() for curve in curves])
    values = values[np.isfinite(values)]
    if not len(values):
        return -1.0, 1.0
    low, high = float(values.min()), float(values.max())
    margin = max(0.1 * (high - low), least_margin)
    return low - margin, high + margin
