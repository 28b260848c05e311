"""Results of sweeps as one picture: pushes by direction, speeds, and limits of each ground."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.projections.polar import PolarAxes
from matplotlib.ticker import FuncFormatter, MaxNLocator

from cassie_bags.report.figures import BLUE, DARK, GREY, ORANGE, STYLE
from cassie_bags.studies.sweep.results_file import MEASURED
from cassie_bags.studies.sweep.row import Level, RowResult
from cassie_bags.studies.sweep.table import StoredRow

_COLOURS = (BLUE, ORANGE, GREY)  # colours of the variants
_SHADE = "#ececec"
_SMALL = 7.5  # size of small text
_WIDTH = 12.5  # width of the figure, in inches
_POLAR_HEIGHT, _LOWER_HEIGHT, _EDGE_HEIGHT = 3.1, 4.4, 0.32
_LINE_HEIGHT = 0.15  # inches, of a line of a legend below a polar plot
_BAR_HEIGHT, _AXES_HEIGHT = 0.165, 0.65  # inches: of a bar with text; of axes around bars

_SHIPPED = "shipped law"

_DIRECTIONS = {
    **{"fore": 0.0, "left": 90.0, "aft": 180.0, "right": -90.0},
    **{"fore_left": 45.0, "fore_right": -45.0, "aft_left": 135.0, "aft_right": -135.0},
}
"""Directions of pushes and slopes, from ahead to the left. In deg."""

_CM = 100.0  # per m
_FINEST = 1.0  # cm/s, difference of speeds up to which the scale is linear, then logarithmic
_LARGEST = 100.0  # cm/s, largest difference in the picture


_SHORT, _OTHER = "0.1 s", "0.05 to 0.4 s"
_AROUND = {
    "Pushes, in place (Ns)": {"push_in_place": _SHORT, "push_circle_in_place": _OTHER},
    "Pushes, 0.5 m/s (Ns)": {"push_walking": _SHORT, "push_circle_slow": _OTHER},
    "Pushes, 1 m/s (Ns)": {"push_circle_fast": _OTHER},
    "Pushes, standing (Ns)": {"stand_recovery": "with steps", "stand_push": "without a step"},
    "Ground that rises, standing (deg)": {"stand_slope": "slope", "stand_tilting": "tilts"},
}
"""Polar plots by title: label of each group of rows, whose names end in directions."""

_LINES = ("-", "--")  # line styles of the kinds
_INNERMOST = 0.35  # ratio to the largest value below which rings have no number
_WIDEST = 90.0  # deg, largest angle between directions that a line joins
_COMPASS = ((0.0, "fore"), (90.0, "left"), (180.0, "aft"), (270.0, "right"))
_GROUNDS = {
    "Angles (deg)": {
        "slope.up": "slope up",
        "slope.down": "slope down",
        "slope.side": "slope to the side",
        "steep.up": "steep slope up",
        "steep.down": "steep slope down",
        "steep.side": "steep slope to the side",
        "slope.circling": "slope, circling on it",
        "sinking.heel": "feet, heels dug in",
    },
    "Heights and depths (cm)": {
        "step.up": "blind step up",
        "step.down": "blind step down",
        "step_fast.up": "blind step up, 0.4 m/s",
        "step_fast.down": "blind step down, 0.4 m/s",
        "stairs.up": "five steps up",
        "stairs.down": "five steps down",
        "stairs.up_and_down": "up, then down",
        "stairs.down_and_up": "down, then up",
        "rough.hard": "rough hard ground, s.d.",
        "sinking.sand": "sand, walking",
        "stand_sinking.sand": "sand, standing",
        "stand_block.left": "block, left foot",
        "stand_block.right": "block, right foot",
    },
    "Friction (less is harder)": {
        "friction.0.5": "at 0.5 m/s",
        "friction.0.2": "at 0.2 m/s",
        "friction.pillar": "pillar, 0.3 m/s",
        "friction.ice": "patches of ice, 0.4 m/s",
    },
    "Speed on grass (m/s)": {
        "grass.0.8": "all robots",
        "grass.1.2": "9 of 10 robots",
    },
    "Payload off centre (kg)": {
        "payload.in_place": "in place",
        "payload.walking": "at 0.5 m/s",
        "payload.fast": "at 1 m/s",
    },
    "Force to the side for 3 s (N)": {
        "steady_force.standing": "standing",
        "steady_force.in_place": "in place",
        "steady_force.walking": "at 0.8 m/s",
    },
}
"""Rows whose limits are drawn as bars, with a label for each, by the title of their axes."""

_MOST_FRICTION = 0.8  # start of the bars of friction: ground on which every robot walks
_SPEEDS = {"speed": "o", "top_speed": "o", "fastest": "o", "sideways": "s"}
"""Marker of each group of rows whose levels are commanded speeds."""

_REACHED = ("top_speed", "fastest")
"""Groups of `_SPEEDS` whose targets are speeds; those of the others are tolerances."""


def draw(path: Path, rows: Sequence[StoredRow]) -> None:
    """Draw stored results into a PNG file; without any, an old picture is removed."""
    with matplotlib.rc_context(STYLE):
        figure = compose(rows)
        if figure is None:
            path.unlink(missing_ok=True)
        else:
            figure.savefig(path)


def compose(rows: Sequence[StoredRow]) -> Figure | None:
    """Picture of the results, without panels that have no results; None without any panel."""
    groups = {row.group for row in rows}
    around = [title for title, kinds in _AROUND.items() if groups & kinds.keys()]
    speeds = [
        row
        for row in rows
        if row.group in _SPEEDS
        and any(x.achieved is not None for result in row.results.values() for x in result.levels)
    ]
    grounds = [
        (title, shown)
        for title, names in _GROUNDS.items()
        if (shown := [row for name in names for row in rows if row.name == name])
    ]
    lower = bool(speeds) + bool(grounds)
    if not around and not lower:
        return None
    variants = list(dict.fromkeys(name for row in rows for name in row.results))
    colours = dict(zip(variants, _COLOURS, strict=False))
    bars = len(colours) * sum(len(shown) + 0.7 for _, shown in grounds)
    lowest = max(_LOWER_HEIGHT, _BAR_HEIGHT * bars + _AXES_HEIGHT * len(grounds))
    origins = _origins(rows, colours)
    lines = max((_legend_lines(_kinds(title, rows), colours) for title in around), default=0)
    polar = _POLAR_HEIGHT + _LINE_HEIGHT * lines
    heights = [_EDGE_HEIGHT, *[polar] * bool(around), *[lowest] * bool(lower)]
    heights.append(_EDGE_HEIGHT + _LINE_HEIGHT * (len(origins) - 1))
    figure = Figure(figsize=(_WIDTH, sum(heights)), layout="constrained")
    strips = figure.subfigures(len(heights), 1, squeeze=False, height_ratios=heights).flat
    _legend(next(strips), colours)
    if around:
        _draw_around(next(strips), around, rows, colours)
    if lower:
        widths = [1.15] * bool(speeds) + [1.0] * bool(grounds)
        strip = next(strips)
        parts = strip.subfigures(1, lower, squeeze=False, width_ratios=widths, wspace=0.03).flat
        if speeds:
            _draw_speeds(next(parts), speeds, colours)
        if grounds:
            _draw_grounds(next(parts), grounds, colours)
    next(strips).text(
        0.5, 0.5, "\n".join(origins), ha="center", va="center", fontsize=_SMALL, color="#555555"
    )
    return figure


def _legend(strip: SubFigure, colours: Mapping[str, str]) -> None:
    def line(**looks: str) -> Line2D:
        return Line2D([], [], color=DARK, **looks)  # type: ignore[arg-type]

    entries = {name: Patch(color=colour) for name, colour in colours.items()}
    strip.legend(
        [
            *entries.values(),
            line(linestyle=":"),
            line(marker="o", linestyle=""),
            line(marker="o", linestyle="", markerfacecolor="white"),
        ],
        [*map(_law, entries), "target", "limit", "no limit found: all that was tried held"],
        loc="center",
        ncols=len(entries) + 3,
        fontsize=9,
    )


def _law(variant: str) -> str:
    """Word of the picture for a variant of the results."""
    if variant.startswith("robots "):
        return f"{_SHIPPED}, {variant}"
    return _SHIPPED if variant == MEASURED else variant


def _origins(rows: Sequence[StoredRow], variants: Iterable[str]) -> list[str]:
    """Which robots each law was measured with, when, and at which revision; one line a law."""
    lines = []
    for variant in variants:
        results = [row.results[variant] for row in rows if variant in row.results]
        made = [result.origin for result in results if result.origin]
        robots = dict.fromkeys(_robots(origin.seeds, variant) for origin in made)
        dates = sorted({origin.date for origin in made})
        revisions = dict.fromkeys(origin.revision for origin in made)
        words = [
            f"robot{'' if all(each.isdigit() for each in robots) else 's'} {' or '.join(robots)}",
            dates[0] if dates[:1] == dates[-1:] else f"{dates[0]} to {dates[-1]}",
            f"revision {next(iter(revisions))}" if len(revisions) == 1 else
            f"{len(revisions)} revisions",
        ] if made else []  # fmt: skip
        if len(made) < len(results):
            words.append("origin not noted" if not made else "origin of some not noted")
        lines.append(f"{_law(variant)}: {'; '.join(words)}")
    return lines


def _robots(seeds: str, variant: str) -> str:
    """Robots of a variant, from those of an origin such as `1 to 10; paper's law 1 to 3`."""
    every, _, fewer = seeds.partition("; ")
    compared = re.fullmatch(r"(.*?) (\d+(?: to \d+)?)", fewer)
    return compared[2] if compared and variant.startswith(compared[1]) else every


def _draw_around(
    strip: SubFigure, titles: Sequence[str], rows: Sequence[StoredRow], colours: Mapping[str, str]
) -> None:
    axes = np.ravel(strip.subplots(1, len(titles), subplot_kw={"projection": "polar"}))
    for axis, title in zip(axes, titles, strict=True):
        axis.set_theta_zero_location("N")
        axis.set_thetagrids(*zip(*_COMPASS, strict=True))
        axis.set_rlabel_position(22.5)
        axis.tick_params(labelsize=_SMALL, pad=1)
        axis.grid(color="#dddddd", linewidth=0.6)
        axis.spines["polar"].set_visible(False)
        axis.set_title(title, loc="center", fontsize=9, pad=10)
        kinds = _kinds(title, rows)
        for shown, style in zip(kinds.values(), _LINES, strict=False):
            _draw_directions(axis, shown, style, colours)
        _set_rings(axis, list(chain.from_iterable(kinds.values())))
        without = _without_limit(kinds, colours)
        entries = [(DARK, style, word) for word, style in zip(kinds, _LINES, strict=False)]
        entries += without
        axis.legend(
            [Line2D([], [], color=colour, linestyle=style) for colour, style, _ in entries],
            [word for *_, word in entries],
            loc="upper center", bbox_to_anchor=(0.5, -0.08), ncols=1 if without else 2,
            fontsize=_SMALL, handlelength=2.2, columnspacing=1.0, labelspacing=0.25,
        )  # fmt: skip


def _kinds(title: str, rows: Sequence[StoredRow]) -> dict[str, list[StoredRow]]:
    """Rows of a polar plot by their direction, by the label of each kind."""
    return {
        word: found
        for group, word in _AROUND[title].items()
        if (found := sorted((row for row in rows if row.group == group), key=_angle))
    }


def _without_limit(
    kinds: Mapping[str, Sequence[StoredRow]], colours: Mapping[str, str]
) -> list[tuple[str, str, str]]:
    """Colour, line style and words for each law that holds no level in some directions."""
    found = []
    for (kind, rows), style in zip(kinds.items(), _LINES, strict=False):
        for name, colour in colours.items():
            results = [row.results[name] for row in rows if name in row.results]
            if none := sum(math.isnan(result.measured) for result in results):
                where = "" if none == len(results) else f" in {none} of {len(results)} directions"
                which = f", {kind}" if len(kinds) > 1 else ""
                found.append((colour, style, f"{_law(name)}{which}: none{where}"))
    return found


def _legend_lines(kinds: Mapping[str, Sequence[StoredRow]], colours: Mapping[str, str]) -> int:
    """Lines of the legend below a polar plot after the first one."""
    without = len(_without_limit(kinds, colours))
    return len(kinds) + without - 1 if without else 0


def _set_rings(axis: PolarAxes, rows: Sequence[StoredRow]) -> None:
    """Set a few rings with numbers, up to the largest limit or target."""
    measured = [result.measured for row in rows for result in row.results.values()]
    limits = [value for value in measured if not math.isnan(value)]
    most = max([*limits, *(row.target for row in rows)])
    rings = MaxNLocator(4, steps=[1, 2, 5, 10]).tick_values(0.0, most)
    axis.set_ylim(0.0, 1.08 * most)
    rings = [ring for ring in rings if 0.0 < ring <= 1.08 * most]
    # Numbers of the innermost rings would cover points.
    axis.set_yticks(rings, [f"{ring:g}" if ring > _INNERMOST * most else "" for ring in rings])
    for label in axis.get_yticklabels():
        label.set_bbox({"facecolor": "white", "edgecolor": "none", "pad": 0.4, "alpha": 0.8})


def _angle(row: StoredRow) -> float:
    word = row.name.partition(".")[2]
    return _DIRECTIONS[word] % 360.0 if word in _DIRECTIONS else float(word)


def _draw_directions(
    axis: PolarAxes, rows: Sequence[StoredRow], style: str, colours: Mapping[str, str]
) -> None:
    """Draw the limits of one kind by direction, for each variant."""
    _ring(axis, [(_angle(row), row.target) for row in rows], color=DARK, linestyle=":", lw=0.9)
    for index, (name, colour) in enumerate(colours.items()):
        thick = 1.0 if index else 2.0  # so that both are visible where they coincide
        found = [(row, row.results[name]) for row in rows if name in row.results]
        points = [(_angle(row), result.measured) for row, result in found]
        _ring(axis, points, color=colour, linestyle=style, lw=1.1 * thick)
        for (angle, value), (_, result) in zip(points, found, strict=True):
            if math.isnan(value):
                continue
            face = "white" if result.open_ended else colour
            axis.plot(
                math.radians(angle), value, "o", color=colour, markerfacecolor=face,
                markersize=2.5 + 1.8 * thick, clip_on=False, zorder=3,
            )  # fmt: skip


def _ring(axis: PolarAxes, points: Sequence[tuple[float, float]], **looks: object) -> None:
    """Draw a line through points by angle (deg), with gaps where angles differ by over 90 deg."""
    line: list[tuple[float, float]] = []
    for (angle, value), (following, _) in zip(points, [*points[1:], *points[:1]], strict=True):
        gap = (following - angle) % 360.0 or 360.0
        line += [(angle, value)] if gap <= _WIDEST else [(angle, value), (angle, math.nan)]
    line += points[:1]
    angles = [math.radians(angle) for angle, _ in line]
    axis.plot(angles, [value for _, value in line], **looks)  # type: ignore[arg-type]


def _levels(rows: Sequence[StoredRow], variant: str) -> Iterator[tuple[StoredRow, Level]]:
    """Levels of rows with their speeds; those backward are negative."""
    for row in rows:
        result = row.results.get(variant)
        sign = -1.0 if row.name.endswith(".backward") else 1.0
        for level in result.levels if result else ():
            speeds = [sign * speed for speed in level.achieved or ()]
            yield row, dataclasses.replace(level, level=sign * level.level, achieved=speeds)


def _draw_speeds(part: SubFigure, rows: Sequence[StoredRow], colours: Mapping[str, str]) -> None:
    """Draw achieved over commanded speed, and below it their difference, with the spread."""
    above, below = part.subplots(2, 1, sharex=True, height_ratios=(1.5, 1.0))
    points = {name: list(_levels(rows, name)) for name in colours}
    commanded = [level.level for found in points.values() for _, level in found]
    ends = min(commanded) - 0.1, max(commanded) + 0.1
    above.plot(ends, ends, color=DARK, linestyle=":", lw=0.9)
    above.set_xlim(*ends)
    above.set_title("Speed: slowest, mean and fastest robot", fontsize=9)
    above.set_ylabel("achieved (m/s)", fontsize=_SMALL + 0.5)
    below.set_ylabel("difference (cm/s)", fontsize=_SMALL + 0.5)
    below.set_xlabel("commanded (m/s)", fontsize=_SMALL + 0.5)
    below.set_yscale("symlog", linthresh=_FINEST)
    below.set_ylim(-_LARGEST, _LARGEST)
    below.set_yticks([-30, -10, -3, -1, 0, 1, 3, 10, 30])
    below.yaxis.set_major_formatter(FuncFormatter(_signed))
    below.minorticks_off()
    tolerances = [_CM * row.target for row in rows if row.group not in _REACHED]
    if tolerances:
        below.axhspan(-min(tolerances), min(tolerances), color=_SHADE, zorder=0)
    for axis in (above, below):
        axis.tick_params(labelsize=_SMALL)
    shift = 0.006 * (ends[1] - ends[0])  # so that the variants are side by side
    for index, (name, colour) in enumerate(colours.items()):
        aside = (2 * index - len(colours) + 1) * shift
        for row, level in points[name]:
            place, marker, speeds = level.level + aside, _SPEEDS[row.group], level.achieved or ()
            _draw_spread(above, place, speeds, marker, colour)
            off = [_CM * (speed - level.level) for speed in speeds]
            _draw_spread(below, place, off, marker, colour)
            if level.fell:
                low = -_LARGEST * (0.75 if index else 0.45)
                below.plot(level.level, low, "x", color=colour, markersize=5, clip_on=False)
    handles: list[Line2D | Patch] = [
        Line2D([], [], color=DARK, linestyle="", marker=marker, markersize=4)
        for marker in ("o", "s", "x")
    ]
    words = ["forward, backward", "to the side", "a robot fell"]
    if tolerances:
        handles.append(Patch(color=_SHADE))
        words.append("tolerance")
    above.legend(handles, words, loc="upper left", fontsize=_SMALL)


def _signed(value: float, _: int) -> str:
    return f"{value:+g}".replace("-", "\N{MINUS SIGN}") if value else "0"


def _draw_spread(
    axis: Axes, place: float, speeds: Sequence[float], marker: str, colour: str
) -> None:
    """Draw slowest, fastest and mean speed."""
    if values := list(filter(math.isfinite, speeds)):
        axis.plot([place, place], [min(values), max(values)], color=colour, lw=2.2, alpha=0.5)
        axis.plot(place, sum(values) / len(values), marker, color=colour, markersize=3.5)


def _draw_grounds(
    part: SubFigure,
    grounds: Sequence[tuple[str, Sequence[StoredRow]]],
    colours: Mapping[str, str],
) -> None:
    """Draw the limits of each ground as bars, with marked targets."""
    counts = [len(rows) + 0.7 for _, rows in grounds]
    found = np.ravel(part.subplots(len(grounds), 1, height_ratios=counts))
    for axis, (title, rows) in zip(found, grounds, strict=True):
        scale = _CM if rows[0].unit == "m" else 1.0
        falling = not rows[0].at_least
        begin = _MOST_FRICTION if falling else 0.0
        limits = [scale * row.target for row in rows]
        height = 0.8 / len(colours)
        for place, row in enumerate(rows):
            target = scale * row.target
            axis.plot([target] * 2, [place - 0.48, place + 0.48], color=DARK, linestyle=":", lw=1.4)
            for index, (name, colour) in enumerate(colours.items()):
                result = row.results.get(name)
                if result is None:
                    continue
                held = not math.isnan(result.measured)
                value = scale * result.measured if held else begin
                limits.append(value)
                middle = place + (index - 0.5 * (len(colours) - 1)) * height
                axis.barh(middle, value - begin, 0.9 * height, left=begin, color=colour)
                axis.annotate(
                    _words(result, value, falling), (value, middle), xytext=(4, 0),
                    textcoords="offset points", va="center", fontsize=_SMALL,
                    bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.2},
                )  # fmt: skip
        axis.set_title(title, fontsize=9, pad=4)
        axis.set_yticks(range(len(rows)), [_GROUNDS[title][row.name] for row in rows])
        axis.set_ylim(len(rows) - 0.45, -0.55)
        axis.set_xlim((begin, 0.0) if falling else (0.0, 1.22 * max(limits)))
        axis.tick_params(labelsize=_SMALL)
        axis.tick_params(axis="y", length=0)


def _words(result: RowResult, value: float, falling: bool) -> str:
    """The text at the end of a bar."""
    if result.problem or math.isnan(result.measured):
        return "none"
    beyond = ("≤ " if falling else "≥ ") if result.open_ended else ""
    return f"{beyond}{value:.3g}"
