"""Step-to-step maps from a command line: the table, one row for each speed, and the picture."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path

from matplotlib.ticker import MaxNLocator

from cassie_bags.errors import ExperimentError, RunError
from cassie_bags.report.figures import drawing
from cassie_bags.run.progress import progress_bar
from cassie_bags.studies.results import check_results, markdown, put_results
from cassie_bags.studies.return_map import (
    DELAYS,
    IMPULSES,
    STEPS,
    Measurement,
    experiment_of,
    measure,
)
from cassie_bags.studies.return_map_fit import DECAYED, decay, steps_to_decay
from cassie_gaits.gait_library_file import default_library_path, library_path, load_certified
from cassie_gaits.processes import available_cores

SECTION = "Return maps"
"""Heading of the maps' table in a file of results."""

HEADINGS = (
    *("speed m/s", "runs", "d after 2 steps", "4", "8", f"steps to {DECAYED:g}", "noise m/s"),
    *("eigenvalues of two steps", "largest, a run left out", "residual (pairs)"),
)
"""Headings of the table."""

ACROSS = 5
"""Largest number of panels side by side in the picture."""

STRONGEST = 10.0
"""Largest push; the deviation after a larger one is no longer small. In N s."""

_RUNS = len(IMPULSES) * len(DELAYS) + 2  # and a run without a push, and one that shows the noise


def run(options: argparse.Namespace) -> int:
    """Push at each speed; returns the exit code."""
    if not (math.isfinite(options.impulse) and 0.1 <= options.impulse <= STRONGEST):
        raise ExperimentError(
            f"--impulse = {options.impulse:g} N s is outside 0.1 .. {STRONGEST:g}"
        )
    named = bool(options.speeds) or options.file is not None
    check_results(options, "speeds of the package's library", partial=named)
    if options.file is not None:
        options.file = library_path(options.file)
    speeds, jobs = _speeds(options), options.jobs or available_cores()
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
    print(f"seed {options.seed}, pushes of {options.impulse:g} N s; d: see --help", flush=True)
    print("\n".join(markdown([HEADINGS])), flush=True)
    rows: list[str] = []
    measured, failed = [], 0
    with progress_bar("run", len(speeds) * _RUNS) as bar:
        for speed in speeds:
            experiment = experiment_of(speed, options.seed, options.file, options.allow_uncertified)
            try:
                one = measure(experiment, speed, options.impulse, STEPS, jobs, bar.update)
            except RunError as error:
                failed += 1
                rows.append(f"| {speed:g} | {error} |")
                bar.write(rows[-1], file=sys.stdout)
                continue
            rows.append(line(one))
            bar.write(rows[-1], file=sys.stdout)
            failed += not settles(one)
            measured.append(one)
    if options.out is not None and any(one.deviations for one in measured):
        print(_draw(measured, options.out / "return_map.png"))
    command = f"return_map --seed {options.seed} --impulse {options.impulse:g}"
    put_results(options, SECTION, [*markdown([HEADINGS]), *rows], command)
    print(f"{len(speeds) - failed} of {len(speeds)} gaits end nearer to themselves than they began")
    return 1 if failed else 0


def settles(one: Measurement) -> bool:
    """Whether no run fell or lost its steps, and the last median deviation is below the first."""
    return not one.fell and not one.dropped and float(decay(one.deviations)[-1]) < 1.0


def line(one: Measurement) -> str:
    """A row of the table, in Markdown."""
    runs = len(one.deviations) + one.dropped + one.fell
    cells = [f"{one.speed:g}", f"{len(one.deviations)} of {runs}"]
    if one.deviations:
        ratios, steps = decay(one.deviations), steps_to_decay(one.deviations)
        cells += [f"{ratios[k]:.2f}" for k in (2, 4, 8)]
        cells.append(f"more than {len(ratios) - 1}" if steps is None else str(steps))
    else:
        cells += ["-"] * 4
    cells.append(f"{one.noise:.4f}")
    if one.map is None:
        cells += ["too few deviations above the noise", "-", "-"]
    else:
        low, high = one.map.spread
        cells.append(" ".join(f"{value:.2f}" for value in one.map.eigenvalues))
        cells += [f"{low:.2f} .. {high:.2f}", f"{one.map.residual:.2f} ({one.map.pairs})"]
    return "| " + " | ".join(cells) + " |"


def _draw(measured: Sequence[Measurement], path: Path) -> Path:
    """Draw the size of the deviations over steps, one panel for each speed."""
    rows = math.ceil(len(measured) / ACROSS)
    across = math.ceil(len(measured) / rows)
    with drawing(path, 3.0 * across + 0.6, 2.6 * rows + 0.6) as figure:
        panels = figure.subplots(rows, across, sharex=True, sharey=True, squeeze=False).ravel()
        for axes in panels[len(measured) :]:
            axes.set_visible(False)
        for axes, one in zip(panels, measured, strict=False):
            for run in one.deviations:
                x, y = run.impulse
                name = f"({x:g}, {y:g}) N s after {run.delay:g} s"
                axes.semilogy(run.size, marker=".", linewidth=0.8, label=name)
            axes.axhline(one.noise, color="0.5", linestyle=":", label="noise")
            axes.set(title=f"{one.speed:g} m/s", xlabel="steps after the push")
            axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        for axes in panels[::across]:
            axes.set_ylabel("deviation (m/s)")
        figure.legend(
            *panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=6
        ).set_title("push (ahead, to the left)")
    return path


def _speeds(options: argparse.Namespace) -> list[float]:
    path = options.file or default_library_path()
    library = load_certified(path, allow_uncertified=options.allow_uncertified)
    low, high = library.speed_range
    for speed in options.speeds or ():
        if not low <= speed <= high:
            raise ExperimentError(
                f"--speeds: {speed:g} m/s is outside {low:g} .. {high:g} of {path}"
            )
    straight = [gait.vx for gait in library.gaits if gait.vy == 0.0 and gait.yaw_rate == 0.0]
    return list(options.speeds or straight)
