"""The results of sweeps as one picture: how far each figure is from its target."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from cassie_bags.report.figures import BLUE, DARK, GREY, ORANGE, STYLE
from cassie_bags.studies.sweep.row import Row, RowResult
from cassie_bags.studies.sweep.table import Results

_LARGEST = 2.0  # beyond it a bar is cut
_COLOURS = (BLUE, ORANGE, GREY)


def reached(row: Row, result: RowResult) -> float:
    """Share of the target that was reached, 1 or more if it was met; 0 if nothing held."""
    if result.problem or math.isnan(result.measured):
        return 0.0
    if row.at_least:
        return result.measured / row.target
    return row.target / max(result.measured, row.target / _LARGEST)


def draw(path: Path, rows: Sequence[Row], results: Results) -> None:
    """Draw the share of each target that each variant reached.

    Args:
        path: PNG file.
        rows: What was measured, in order.
        results: Of each variant.
    """
    rows = [row for row in rows if any(row.name in found for found in results.values())]
    count = len(results)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(8.0, 1.2 + 0.24 * len(rows)), layout="constrained")
        axes = figure.subplots()
        places = np.arange(len(rows))
        for index, (name, found) in enumerate(results.items()):
            shares = [
                min(_LARGEST, reached(row, found[row.name])) if row.name in found else 0.0
                for row in rows
            ]
            offset = (index - 0.5 * (count - 1)) * 0.8 / count
            colour = _COLOURS[index % len(_COLOURS)]
            axes.barh(places + offset, shares, 0.8 / count, color=colour, label=name)
        axes.axvline(1.0, color=DARK, linewidth=1.0)
        axes.set_yticks(places, [row.title for row in rows], fontsize=7)
        axes.invert_yaxis()
        axes.set_xlim(0.0, _LARGEST)
        axes.set_xlabel("share of the target reached (1 and more: met)")
        axes.legend(fontsize=7, loc="lower right")
        figure.savefig(path)
