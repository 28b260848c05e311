"""How gains of the feet shake a Segway: the paper's oscillation, and its cure.

The paper's nominal gains give each foot 600 Nm per m of CoM x and 80 Nms; with the standing
controller the Segway oscillated, with lower gains it did not. Here both laws stand on a Segway
that is let go, with those gains times a factor, and a rider who keeps it in place:

- "standing": the law of mode `stand`, as the paper did it;
- "riding": the law of mode `segway`, which takes out what the ground accelerates.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.figure import Figure
from tqdm import tqdm

from cassie_bags.report.figures import BLUE, DARK, ORANGE, STYLE
from cassie_bags.studies.sweep.course import Budget
from cassie_bags.studies.sweep.segway_rows import GO, LET_GO, ride
from cassie_bags.studies.trial import Figures, Trial, run_trial
from cassie_bags.studies.workers import workers
from cassie_control.config import SegwayConfig
from cassie_gaits.robot import WEIGHT

LAWS = ("standing", "riding")
NOMINAL = (600.0, 80.0)
"""The paper's gains of one foot, in Nm/m and Nms/m."""

SOFTNESS = (0.5, 1.0, 2.0)
FACTORS = (0.45, 0.6, 0.8, 1.0)
WATCHED = 12.0
"""How long after the operator has let go. In s."""

_FALLEN = 10.0  # deg, where the picture shows that all fell
QUIET = 0.5
"""RMS of the platform's pitch that the shipped gains are to stay below. In deg."""


@dataclass(frozen=True)
class Setting:
    """One point of the figure.

    Attributes:
        law: One of `LAWS`.
        factor: Of the nominal gains; None for the shipped ones.
        softness: Of the scene.
    """

    law: str
    factor: float | None
    softness: float


@dataclass(frozen=True)
class Shaking:
    """What came of a setting.

    Attributes:
        setting: Which.
        rms: Greatest RMS of the platform's pitch among those that stood, in deg; NaN if none did.
        fell: How many robots fell.
        run: Of how many.
    """

    setting: Setting
    rms: float
    fell: int
    run: int


def settings() -> list[Setting]:
    """All points, the shipped gains last."""
    points = [Setting(law, f, s) for law in LAWS for s in SOFTNESS for f in FACTORS]
    return points + [Setting("riding", None, softness) for softness in SOFTNESS]


def gains(factor: float) -> tuple[float, float]:
    """kp_com_x (over the weight's own, as both laws have it) and kd_com_x. In N/m and Ns/m."""
    return max(0.0, 2.0 * factor * NOMINAL[0] - WEIGHT), 2.0 * factor * NOMINAL[1]


def shipped_factor() -> float:
    """Share of the nominal stiffness that is shipped."""
    return (SegwayConfig().kp_com_x + WEIGHT) / (2.0 * NOMINAL[0])


def trial_of(setting: Setting, seed: int) -> Trial:
    """The run of a robot: at rest on a Segway, from the moment it is let go."""
    controller: dict[str, Any] = {}
    if setting.factor is not None:
        kp, kd = gains(setting.factor)
        section = "stand" if setting.law == "standing" else "segway"
        controller[section] = {"kp_com_x": kp, "kd_com_x": kd, "settled_kd_com_x": kd}
    window = (LET_GO + 1.0, LET_GO + 1.0 + WATCHED)
    scene = {"softness": setting.softness}
    made = ride(
        Budget(),
        seed,
        window,
        [{"t": GO, "speed": 0.0}],
        surface="floor",
        scene_parameters=scene,
        controller=controller,
    )
    if setting.law == "riding":
        return made
    content = dict(made.content)
    content["operator"] = content["operator"][:1]  # it never rides, but leans as far and as fast
    content["supervisor"] = {"com_x_limit": 0.07, "shift_rate": 0.3}
    return dataclasses.replace(made, content=content)


def shaking(setting: Setting, found: Sequence[Figures]) -> Shaking:
    """Sum up the runs of a setting."""
    stood = [f["platform_rms"] for f in found if not f["fell"] and math.isfinite(f["platform_rms"])]
    fell = sum(f["fell"] > 0.0 for f in found)
    return Shaking(setting, max(stood, default=math.nan), fell, len(found))


def table(found: Sequence[Shaking]) -> str:
    """Greatest RMS of the platform's pitch, by law, gains and softness."""
    lines = [f"{'law':10} {'gains of a foot':22}" + "".join(f"x{s:<15g}" for s in SOFTNESS)]
    keys = dict.fromkeys((entry.setting.law, entry.setting.factor) for entry in found)
    for law, factor in keys:
        kp, kd = (value * (factor or 0.0) for value in NOMINAL)
        config = SegwayConfig()
        if factor is None:
            kp, kd = 0.5 * (config.kp_com_x + WEIGHT), 0.5 * config.kd_com_x
        label = f"{kp:.0f} / {kd:.0f}" + (" shipped" if factor is None else "")
        cells = [_cell(e) for e in found if (e.setting.law, e.setting.factor) == (law, factor)]
        lines.append(f"{law:10} {label:22}" + "".join(f"{cell:16}" for cell in cells))
    lines.append(
        "RMS of the platform's pitch about its mean over 2 s, in deg, worst robot; "
        "columns: softness of the platform"
    )
    return "\n".join(line.rstrip() for line in lines)


def verdict(found: Sequence[Shaking]) -> tuple[float, float]:
    """Worst RMS with the shipped gains (deg), and the least ratio to it of the standing law.

    The ratio is that of the nominal gains at the same softness; infinite where every robot fell.
    """

    def of(law: str, factor: float | None, softness: float) -> Shaking:
        return next(e for e in found if e.setting == Setting(law, factor, softness))

    ratios, quiet = [], []
    for softness in SOFTNESS:
        shipped, nominal = of("riding", None, softness), of("standing", 1.0, softness)
        quiet.append(shipped.rms if not shipped.fell else math.inf)
        ratios.append(math.inf if nominal.fell else nominal.rms / shipped.rms)
    return max(quiet), min(ratios)


def draw(path: Path, found: Sequence[Shaking]) -> None:
    """Draw the shaking by gain, a line for each law and softness.

    Args:
        path: PNG file.
        found: Of `settings`.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(8.0, 4.0), layout="constrained")
        axes = figure.subplots()
        for law, colour in zip(LAWS, (ORANGE, BLUE), strict=True):
            for softness, style in zip(SOFTNESS, (":", "-", "--"), strict=True):
                line = [
                    e
                    for e in found
                    if (e.setting.law, e.setting.softness) == (law, softness)
                    and e.setting.factor is not None
                ]
                _line(axes, line, color=colour, linestyle=style, label=f"{law}, x{softness:g} soft")
        shipped = [e.rms for e in found if e.setting.factor is None]
        places = [shipped_factor()] * len(shipped)
        axes.plot(places, shipped, "D", color=DARK, markersize=4, label="shipped gains")
        axes.axhline(QUIET, color=DARK, linewidth=0.7, linestyle=":")
        axes.set_yscale("log")
        axes.set_xlabel("gains of the feet, by the paper's nominal 600 / 80")
        axes.set_ylabel("RMS of the platform's pitch (deg)")
        axes.set_title("A Segway that is let go: which gains shake it")
        if any(e.fell for e in found):
            axes.set_ylim(top=2.0 * _FALLEN)
        figure.legend(fontsize=7, loc="outside right upper")
        figure.savefig(path)


def _line(axes: Any, line: Sequence[Shaking], **style: Any) -> None:
    """One law on one platform; where robots fell, how many."""
    x = [float(e.setting.factor or 0.0) for e in line]
    axes.plot(x, [e.rms for e in line], marker="o", markersize=3, **style)
    for factor, entry in zip(x, line, strict=True):
        if entry.fell:
            high = entry.rms if math.isfinite(entry.rms) else _FALLEN
            axes.plot(factor, high, "x", color=style["color"])
            text = f"{entry.fell} of {entry.run} fell   "
            axes.annotate(text, (factor, high), fontsize=6, color=style["color"], ha="right")


def _cell(entry: Shaking) -> str:
    text = "-" if math.isnan(entry.rms) else f"{entry.rms:.3f}"
    return f"{text} ({entry.fell} fell)" if entry.fell else text


RATIO = 3.0
"""By how much the nominal gains are to shake more."""


def run(arguments: argparse.Namespace) -> int:
    """Stand on the Segway with each setting; returns the exit code."""
    points = settings()
    seeds = range(1, arguments.seeds + 1)
    jobs = [(index, seed) for index in range(len(points)) for seed in seeds]
    runs: list[list[Figures]] = [[] for _ in points]
    bar = tqdm(total=len(jobs), unit="run", disable=not sys.stderr.isatty(), leave=False)
    arguments.out.mkdir(parents=True, exist_ok=True)
    with contextlib.closing(workers(arguments.jobs, None)) as crew, bar:
        trials = [trial_of(points[index], seed) for index, seed in jobs]
        for number, figures in crew.results(run_trial, trials):
            runs[jobs[number][0]].append(figures)
            bar.update()
    found = [shaking(point, figures) for point, figures in zip(points, runs, strict=True)]
    (arguments.out / "toe_gains.txt").write_text(table(found) + "\n", "utf-8")
    draw(arguments.out / "toe_gains.png", found)
    print(table(found))
    quiet, ratio = verdict(found)
    print(f"seeds 1 to {arguments.seeds}: shipped gains <= {quiet:.3f} deg (target {QUIET:g}),")
    print(f"the standing law with nominal ones >= {ratio:.1f} times that (target {RATIO:g})")
    return 0 if quiet <= QUIET and ratio >= RATIO else 1
