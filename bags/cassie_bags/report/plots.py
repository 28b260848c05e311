"""Plots of a bag's fields over time, and of two runs in the same axes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

from cassie_bags.bag.summary import Interval
from cassie_bags.bag.tables import Curve
from cassie_bags.report.figures import (
    BLUE,
    DARK,
    GREY,
    ORANGE,
    STYLE,
    draw_modes,
    drawing,
    event_legend,
    mark,
    overview,
)
from cassie_bags.report.view import View
from cassie_bags.signals.events import Event
from cassie_bags.signals.metrics import UNITS
from cassie_msgs.experiment.expectation import TRACKED

_MAX_LABELS = 20  # labels of a panel
_MAX_COLOURS = 10  # columns that the default colours distinguish
_LARGEST = 1e300  # larger numbers than this overflow in axes


def save_overview(view: View, path: Path) -> None:
    """Draw the standard set of plots of a run."""
    with matplotlib.rc_context(STYLE):
        overview(view).savefig(path)


def save_curves(
    curves: Sequence[Curve],
    modes: Sequence[Interval],
    events: Sequence[Event],
    title: str,
    path: Path,
) -> None:
    """Draw fields over time, one panel each, below the modes.

    Args:
        curves: Curves of the fields.
        modes: Modes of the robot; empty if they are not known.
        events: Events that are marked in each panel, in the time of the curves.
        title: Name of the bag.
        path: Picture; the ending decides its format.
    """
    heights = [0.3] * bool(modes) + [1.0] * len(curves)
    with drawing(path, 9.0, 1.2 + 1.6 * sum(heights)) as figure:
        panels = figure.subplots(
            len(heights), 1, sharex=True, squeeze=False, height_ratios=heights
        )[:, 0]
        if modes:
            draw_modes(panels[0], modes)
            panels[0].set(yticks=[], ylim=(0.0, 1.0))
        for axes, curve in zip(panels[-len(curves) :], curves, strict=True):
            _draw(axes, curve)
        end = max((float(curve.time[-1]) for curve in curves if len(curve.time)), default=0.0)
        shown = [event for event in events if event.t0 <= end]
        for axes in panels:
            mark(axes, shown)
        if shown:
            figure.legend(*event_legend(shown), loc="upper right", ncols=5)
        panels[-1].set_xlabel("robot time (s)")
        figure.suptitle(title, x=0.01, ha="left", fontsize=10)


def save_overlay(one: View, other: View, path: Path) -> None:
    """Draw the motion of two runs in the same axes."""
    with drawing(path, 9.0, 8.0) as figure:
        panels = figure.subplots(len(TRACKED) + 1, 1, sharex=True)
        for view, colour, name in ((one, BLUE, "A"), (other, ORANGE, "B")):
            track = view.track
            for axes, quantity in zip(panels, TRACKED, strict=False):
                axes.plot(
                    track.time, track.achieved[quantity], color=colour, linewidth=0.7, alpha=0.8,
                    label=f"{name}: {view.title}",
                )  # fmt: skip
                axes.set_ylabel(f"{quantity.replace('_', ' ')}\n({UNITS[quantity]})")
        ticks, distance = _distance(one, other)
        panels[-1].plot(ticks, distance, color=DARK, linewidth=0.8)
        panels[-1].set(ylabel="distance of\npelvises (m)", xlabel="robot time (s)")
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper right", ncols=2)


def _distance(one: View, other: View) -> tuple[Any, Any]:
    """Common ticks (s) of two runs, and the distance of the pelvis origins at these ticks (m)."""
    a, b = (np.round(view.track.time * 1e9).astype(np.int64) for view in (one, other))
    ticks, first, second = np.intersect1d(a, b, return_indices=True)
    apart = one.track.position[first] - other.track.position[second]
    return ticks * 1e-9, np.linalg.norm(apart, axis=1)


def _draw(axes: Any, curve: Curve) -> None:
    count = len(curve.columns)
    if count > _MAX_COLOURS:
        axes.set_prop_cycle(color=matplotlib.colormaps["tab20"](range(_MAX_LABELS)))
    left_out = 0
    for name, column in curve.columns.items():
        values = np.asarray(column, np.float64)
        beyond = np.abs(values) > _LARGEST
        left_out += int(beyond.sum())
        axes.plot(curve.time, np.where(beyond, np.nan, values), linewidth=0.7, label=name)
    if 1 < count <= _MAX_LABELS:
        columns, size = (1, 7) if count <= _MAX_COLOURS else (2, 6)
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=size, ncols=columns)
    elif count > _MAX_LABELS:
        axes.text(1.0, 1.0, f"{count} entries", transform=axes.transAxes, color=GREY)
    unit = f" ({curve.unit})" if curve.unit else ""
    note = f", without {left_out} values beyond {_LARGEST:g}" if left_out else ""
    axes.set_title(f"{curve.name}{unit}{note}", fontsize=8)
