"""Pictures of a gait library."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from cassie_gaits import bezier
from cassie_gaits.certificate.table import FRICTION
from cassie_gaits.drive_limits import TORQUE_LIMITS
from cassie_gaits.gait_library import OUTPUTS, Gait
from cassie_gaits.gait_motion import Motion, figures
from cassie_gaits.names import LEG_DRIVES
from cassie_gaits.records import FloatArray

STYLE: dict[str, Any] = {
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "legend.frameon": False,
    "lines.linewidth": 1.2,
    "savefig.dpi": 160,
}

_PHASES = np.linspace(0.0, 1.0, 101)
_LIMIT, _DARK, _GREY, _NEAR, _FAR = "#d55e00", "#222222", "#9a9a9a", "#0072b2", "#b8c8d6"
_PHASE = "phase of the step"


SPEED_NAMES = {
    "vx": "sagittal speed (m/s)",
    "vy": "speed to the left (m/s)",
    "yaw_rate": "turning rate to the left (rad/s)",
}
"""Labels of a gait's three speeds, for axes."""


class Speeds:
    """Colour map of one of the three speeds, and its colour bar."""

    def __init__(self, gaits: Sequence[Gait], name: str = "vx") -> None:
        self._name = name
        speeds = [getattr(gait, name) for gait in gaits]
        low, high = min(speeds), max(speeds)
        norm = Normalize(low - 0.5, high + 0.5) if low == high else Normalize(low, high)
        self._map: Any = ScalarMappable(norm, matplotlib.colormaps["viridis"])

    def colour(self, gait: Gait) -> Any:
        """Colour of a gait."""
        return self._map.to_rgba(getattr(gait, self._name))

    def bar(self, figure: Figure, axes: Any) -> None:
        """Draw the colour bar beside the panels."""
        figure.colorbar(self._map, ax=axes, label=SPEED_NAMES[self._name], aspect=40, pad=0.02)


def signed(value: float, digits: str) -> str:
    """A number in a format such as `.2f` with its sign; 0 has none."""
    return format(value, f"+{digits}") if value else "0"


def draw_outputs(gaits: Sequence[Gait], path: Path, name: str = "vx", which: str = "") -> None:
    """Draw the nine outputs over phase in right stance.

    Args:
        gaits: Gaits, which are coloured by one of their speeds.
        path: File to write.
        name: Name of that speed.
        which: Common property of the gaits, for the title.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 7.0), layout="constrained")
        panels, speeds = figure.subplots(3, 3, sharex=True), Speeds(gaits, name)
        for i, (panel, output) in enumerate(zip(panels.flat, OUTPUTS, strict=True)):
            length = output.endswith("length")
            for gait in gaits:
                alpha = gait.coefficients[0][i : i + 1]
                curve = np.array([bezier.evaluate(alpha, phase)[0] for phase in _PHASES])
                values = curve if length else np.degrees(curve)
                panel.plot(_PHASES, values, color=speeds.colour(gait))
            panel.set_title(output.replace("_", " "))
            panel.set_ylabel("m" if length else "degrees")
            _at_least(panel, 0.02 if length else 2.0)
        for panel in panels[-1]:
            panel.set_xlabel(_PHASE)
        speeds.bar(figure, panels)
        figure.suptitle(f"Outputs, right leg in stance{which}", x=0.01, ha="left")
        figure.savefig(path)


def _at_least(panel: Any, span: float) -> None:
    """Give a panel at least a range of `span`, so that nearly constant curves look constant."""
    low, high = panel.get_ylim()
    if high - low < span:
        middle = 0.5 * (low + high)
        panel.set_ylim(middle - 0.5 * span, middle + 0.5 * span)


def draw_strips(motions: Sequence[Motion], path: Path) -> None:
    """Draw stick figures of two steps from the right side, one row per speed."""
    spread = 0.55
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(11.0, 1.75 * len(motions)), layout="constrained")
        panels = figure.subplots(len(motions), 1, squeeze=False)[:, 0]
        for panel, at in zip(panels, motions, strict=True):
            for k, sticks in enumerate(figures(at, 8)):
                _stick(panel, sticks, k * spread - at.gait.vx * k * at.gait.step_time / 8)
            panel.axhline(0.0, color=_GREY, linewidth=0.7, zorder=0)
            panel.set_aspect("equal")
            panel.set_xlim(-0.9, 16 * spread + 0.3)
            panel.set_ylim(-0.05, 1.2)
            panel.set_title(f"{signed(at.gait.vx, '.2f')} m/s")
            panel.axis("off")
        figure.suptitle(
            "Two steps from the side, drawn apart; dark the right leg, light the left",
            x=0.01,
            ha="left",
        )
        figure.savefig(path)


def _stick(panel: Any, sticks: dict[str, FloatArray], shift: float) -> None:
    for leg, colour in (("left", _FAR), ("right", _NEAR)):
        points = sticks[leg]
        panel.plot(points[:5, 0] + shift, points[:5, 2], color=colour, linewidth=1.6)
        panel.plot(points[5:, 0] + shift, points[5:, 2], color=colour, linewidth=2.4)
        foot = points[[5, 4, 6]]
        panel.plot(foot[:, 0] + shift, foot[:, 2], color=colour, linewidth=0.9)
    torso = sticks["torso"]
    panel.fill(torso[:, 0] + shift, torso[:, 2], color=_DARK, alpha=0.75, linewidth=0)


def draw_torques(motions: Sequence[Motion], path: Path) -> None:
    """Draw torques of stance and swing leg against the drives' limits."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(12.0, 5.2), layout="constrained")
        panels, speeds = figure.subplots(2, 5, sharex=True), Speeds([m.gait for m in motions])
        limits = TORQUE_LIMITS[:5]
        for row, side in enumerate(("stance", "swing")):
            for i, drive in enumerate(LEG_DRIVES):
                panel = panels[row, i]
                for at in motions:
                    torque = at.step.torques[:, 5 * (1 - row) + i]
                    panel.plot(at.step.phases, torque, color=speeds.colour(at.gait))
                for sign in (-1.0, 1.0):
                    panel.axhline(sign * limits[i], color=_LIMIT, linewidth=0.9, linestyle="--")
                panel.set_title(f"{side} {drive.replace('_', ' ')}")
                panel.set_ylim(-1.08 * limits[i], 1.08 * limits[i])
        for panel in panels[:, 0]:
            panel.set_ylabel("torque (Nm)")
        for panel in panels[1]:
            panel.set_xlabel(_PHASE)
        speeds.bar(figure, panels)
        figure.suptitle("Torques of the drives; dashed: their limits", x=0.01, ha="left")
        figure.savefig(path)


def draw_clearance(motions: Sequence[Motion], path: Path) -> None:
    """Draw the height of the swing foot, and its path over the ground."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 3.8), layout="constrained")
        panels, speeds = figure.subplots(1, 2), Speeds([m.gait for m in motions])
        for at in motions:
            colour = speeds.colour(at.gait)
            panels[0].plot(at.step.phases, at.feet[:, 2], color=colour)
            panels[1].plot(at.feet[:, 0], at.feet[:, 2], color=colour)
        least = float(motions[0].gait.solver.get("request", {}).get("clearance", 0.15))
        panels[0].plot([0.5], [least], marker="^", color=_LIMIT, linestyle="none")
        panels[0].annotate(
            f"at least {least:g} m",
            (0.5, least),
            (0.0, -8.0),
            color=_LIMIT,
            textcoords="offset points",
            ha="center",
            va="top",
        )
        panels[0].set(title="Swing foot clearance", xlabel=_PHASE, ylabel="height of the sole (m)")
        panels[1].set(title="Way of the swing foot", xlabel="ahead of the stance foot (m)")
        speeds.bar(figure, panels)
        figure.savefig(path)


def draw_friction(motions: Sequence[Motion], path: Path) -> None:
    """Draw the ground force in the friction cone."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 4.0), layout="constrained")
        panels, speeds = figure.subplots(1, 2), Speeds([m.gait for m in motions])
        highest = max(float(at.step.forces[:, 2].max()) for at in motions)
        for at in motions:
            colour, force = speeds.colour(at.gait), at.step.forces
            panels[0].plot(force[:, 0], force[:, 2], color=colour)
            panels[1].plot(at.step.phases, at.friction, color=colour)
        edge = FRICTION * 1.05 * highest
        panels[0].fill(
            [-edge, 0.0, edge],
            [1.05 * highest, 0.0, 1.05 * highest],
            color=_GREY,
            alpha=0.15,
            linewidth=0,
            zorder=0,
        )
        panels[0].set(
            title=f"Ground force in the cone of {FRICTION}",
            xlim=(-edge, edge),
            ylim=(0.0, 1.05 * highest),
            xlabel="fore and aft (N)",
            ylabel="normal (N)",
        )
        panels[1].axhline(FRICTION, color=_LIMIT, linewidth=0.9, linestyle="--")
        panels[1].set(
            title="Friction that is asked for; dashed: allowed",
            ylim=(0.0, 0.65),
            xlabel=_PHASE,
            ylabel="tangential / normal",
        )
        speeds.bar(figure, panels)
        figure.savefig(path)


def draw_transport(motions: Sequence[Motion], path: Path) -> None:
    """Draw the cost of transport and the mechanical power over speed."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 3.8), layout="constrained")
        cost, power = figure.subplots(1, 2)
        moving = [at for at in motions if np.isfinite(at.cost_of_transport)]
        for side in (-1.0, 1.0):
            part = [at for at in moving if at.gait.vx * side > 0.0]
            x = [at.gait.vx for at in part]
            line = {"marker": "o", "markersize": 3.5}
            cost.plot(x, [at.cost_of_transport for at in part], color=_NEAR, **line)
            cost.plot(x, [at.positive_cost_of_transport for at in part], color=_LIMIT, **line)
        for label, colour in (("absolute work", _NEAR), ("positive work only", _LIMIT)):
            cost.plot([], [], color=colour, label=label)
        cost.set(
            title="Mechanical cost of transport",
            xlabel="sagittal speed (m/s)",
            ylabel="work / (weight · way)",
        )
        cost.set_ylim(0.0, None)
        cost.legend()
        seconds = [2.0 * at.gait.step_time for at in motions]
        x = [at.gait.vx for at in motions]
        power.plot(
            x,
            [at.work / t for at, t in zip(motions, seconds, strict=True)],
            color=_NEAR,
            marker="o",
            markersize=3.5,
        )
        power.plot(
            x,
            [at.positive_work / t for at, t in zip(motions, seconds, strict=True)],
            color=_LIMIT,
            marker="o",
            markersize=3.5,
        )
        power.set(title="Mean mechanical power", xlabel="sagittal speed (m/s)", ylabel="W")
        power.set_ylim(0.0, None)
        figure.savefig(path)
