"""Pictures of a library over three speeds: maps of cost, friction and torque, and slices."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from cassie_gaits.gait_library import Gait
from cassie_gaits.gait_pictures import SPEED_NAMES, STYLE, draw_outputs, signed
from cassie_gaits.neighbours import greatest
from cassie_gaits.records import FloatArray

SLICES = {"yaw_rate": 0.5, "vy": 0.0}
"""Sagittal speed (m/s) of the slices over each of these speeds."""

_HOLE = "#d55e00"  # orange, which is no colour of the maps


def _certified(name: str) -> Callable[[Gait], float]:
    def value(gait: Gait) -> float:
        worst = (gait.certificate or {}).get("worst", {})
        return float(worst.get(name, np.nan))

    return value


MAPS: tuple[tuple[str, Callable[[Gait], float]], ...] = (
    ("cost of\ntwo steps", lambda gait: np.nan if gait.cost is None else gait.cost),
    ("friction,\nallowed 0.6", _certified("friction cone")),
    ("torque\nby limit", _certified("torque of the drives, share of the limit")),
    ("torque at speed\nby limit", _certified("torque at speed, share of the limit")),
)
"""Label of each map, no longer than its colour bar, and its value for a gait. There is a further
map of distances."""


def draw_grid(gaits: Sequence[Gait], path: Path) -> None:
    """Draw maps over sagittal and lateral speed, one column per turning rate."""
    with matplotlib.rc_context(STYLE):
        grid_figure(gaits).savefig(path)


def grid_figure(gaits: Sequence[Gait]) -> Figure:
    """The figure of `draw_grid`."""
    axes = [sorted({getattr(gait, name) for gait in gaits}) for name in SPEED_NAMES]
    with matplotlib.rc_context(STYLE):
        apart = greatest(gaits)
        maps = (
            *MAPS,
            (
                "farthest neighbour,\ntimes the median\nof its direction",
                lambda gait: apart[_speeds(gait)],
            ),
        )
        size = (1.9 * len(axes[2]) + 1.6, 1.7 * len(maps) + 0.8)
        figure = Figure(figsize=size, layout="constrained")
        panels = figure.subplots(len(maps), len(axes[2]), sharex=True, sharey=True, squeeze=False)
        for row, (label, value) in zip(panels, maps, strict=True):
            table = _table(gaits, axes, value)
            for k, panel in enumerate(row):
                mesh = _map(panel, axes, table[:, :, k], (np.nanmin(table), np.nanmax(table)))
            figure.colorbar(mesh, ax=list(row), label=label, aspect=14, pad=0.01)
            row[0].set_ylabel("to the left (m/s)")
        for k, rate in enumerate(axes[2]):
            panels[0, k].set_title(f"{signed(rate, 'g')} rad/s")
            panels[-1, k].set_xlabel("ahead (m/s)")
        holes = int(np.prod([len(axis) for axis in axes])) - len(gaits)
        missing = f"; orange: {holes} without a gait" if holes else ""
        figure.suptitle(f"{len(gaits)} gaits by turning rate{missing}", x=0.01, ha="left")
        return figure


def draw_slices(gaits: Sequence[Gait], folder: Path) -> None:
    """Draw outputs over each speed of `SLICES` that has several values, with the other one zero."""
    for name, speed in SLICES.items():
        other = "vy" if name == "yaw_rate" else "yaw_rate"
        part = [gait for gait in gaits if getattr(gait, other) == 0.0]
        if len({getattr(gait, name) for gait in part}) < 2:
            continue
        nearest = min((gait.vx for gait in part), key=lambda vx: abs(vx - speed))
        chosen = [gait for gait in part if gait.vx == nearest]
        draw_outputs(chosen, folder / f"outputs_{name}.png", name, f", {nearest:g} m/s ahead")


def _speeds(gait: Gait) -> tuple[float, float, float]:
    return gait.vx, gait.vy, gait.yaw_rate


def _table(
    gaits: Sequence[Gait], axes: list[list[float]], value: Callable[[Gait], float]
) -> FloatArray:
    """Values over the grid; NaN where there is no gait."""
    table = np.full([len(axis) for axis in axes], np.nan)
    for gait in gaits:
        at = (gait.vx, gait.vy, gait.yaw_rate)
        table[tuple(axis.index(x) for axis, x in zip(axes, at, strict=True))] = value(gait)
    return table


def _map(panel: Any, axes: list[list[float]], table: FloatArray, span: tuple[Any, Any]) -> Any:
    panel.set_facecolor(_HOLE)
    edges = [_edges(axis) for axis in axes[:2]]
    for spine in panel.spines.values():
        spine.set_visible(False)
    return panel.pcolormesh(*edges, np.ma.masked_invalid(table.T), vmin=span[0], vmax=span[1])


def _edges(axis: list[float]) -> FloatArray:
    """Borders halfway between the values of an axis."""
    values = np.array(axis)
    if len(values) == 1:
        return np.array([values[0] - 0.05, values[0] + 0.05])
    middle = 0.5 * (values[1:] + values[:-1])
    edges: FloatArray = np.concatenate(
        [[2.0 * values[0] - middle[0]], middle, [2.0 * values[-1] - middle[-1]]]
    )
    return edges
