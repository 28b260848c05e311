"""Picture of the effect of learned torques: tracking errors by speed, and the torques."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from cassie_bags.report.figures import BLUE, GREY, STYLE
from cassie_bags.studies.learn import Comparison
from cassie_control.learning.torque_table import JOINTS, LearnedTorques
from cassie_gaits.gait_library import OUTPUTS

_LENGTHS = ("stance_leg_length", "swing_leg_length")


def draw(path: Path, learned: LearnedTorques, found: Sequence[Comparison]) -> None:
    """Draw the RMS error of each output without and with torques, above the torques by phase.

    Args:
        path: PNG file.
        learned: The torques.
        found: Errors at each speed.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(11.0, 7.5), layout="constrained")
        above, below = figure.subfigures(2, 1).tolist()  # type: ignore[union-attr]
        _errors(above, found)
        _torques(below, learned)
        figure.savefig(path)


def _errors(figure: object, found: Sequence[Comparison]) -> None:
    axes = figure.subplots(1, len(OUTPUTS))  # type: ignore[attr-defined]
    places = np.arange(len(found))
    for row, (name, plot) in enumerate(zip(OUTPUTS, axes, strict=True)):
        for offset, colour, label, values in (
            (-0.2, GREY, "without", [c.before[row] for c in found]),
            (0.2, BLUE, "learned", [c.after[row] for c in found]),
        ):
            plot.bar(places + offset, 1e3 * np.array(values), 0.4, color=colour, label=label)
        unit = "mm" if name in _LENGTHS else "mrad"
        plot.set_title(f"{name.replace('_', ' ')}\n{unit}", fontsize=8)
        plot.set_xticks(places, [f"{c.speed:g}" for c in found], rotation=90, fontsize=7)
        plot.tick_params(labelsize=7)
    axes[0].legend(fontsize=7, loc="upper left")
    axes[0].set_xlabel("speed in m/s", fontsize=7)


def _torques(figure: object, learned: LearnedTorques) -> None:
    axes = figure.subplots(2, 5, sharex=True)  # type: ignore[attr-defined]
    phases = np.linspace(0.0, 1.0, learned.torques.shape[2])
    colours = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.9, len(learned.speeds)))
    for joint, plot in enumerate(axes.flat):
        for speed, colour, torque in zip(
            learned.speeds.tolist(), colours, learned.torques[:, joint], strict=True
        ):
            plot.plot(phases, torque, color=colour, label=f"{speed:g} m/s")
        plot.set_title(f"{JOINTS[joint].replace('_', ' ')}, Nm", fontsize=8)
        plot.tick_params(labelsize=7)
    axes[0, 4].legend(fontsize=6, ncols=2, loc="upper left")
    axes[1, 0].set_xlabel("phase", fontsize=7)
