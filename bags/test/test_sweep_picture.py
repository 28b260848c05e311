"""The picture of sweeps, drawn of rows that `sweep` kept: what it shows and how well."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterator
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox
from PIL import Image

from cassie_bags.report.figures import BLUE, ORANGE, STYLE
from cassie_bags.studies.sweep.picture import compose, draw
from cassie_bags.studies.sweep.table import StoredRow, read_rows

ROWS = read_rows(Path(__file__).resolve().parent / "sweeps_of_two_robots.json")
"""Rows that `sweep` kept, measured with robots 1 and 2; the file holds the command."""


def picture(rows: list[StoredRow]) -> Figure:
    with matplotlib.rc_context(STYLE):
        figure = compose(rows)
        assert figure is not None
        FigureCanvasAgg(figure).draw()
    return figure


def panel(figure: Figure, title: str) -> Axes:
    """The axes whose title begins so."""
    (found,) = (
        axes
        for axes in figure.axes
        for where in ("left", "center")
        if axes.get_title(loc=where).startswith(title)
    )
    return found


def points(axes: Axes, colour: str, marker: str = "o") -> list[tuple[float, float]]:
    """Single points of a colour, in degrees if the axes are polar."""
    found = [
        line.get_xydata()[0]
        for line in axes.lines
        if line.get_marker() == marker and line.get_color() == colour
    ]
    polar = axes.name == "polar"
    return [(round(math.degrees(x)) if polar else float(x), float(y)) for x, y in found]


def of(name: str, variant: str = "measured") -> float:
    (row,) = (row for row in ROWS if row.name == name)
    return row.results[variant].measured


def texts(figure: Figure) -> Iterator[tuple[str, Bbox]]:
    """Every word that is drawn, with its place in pixels."""
    renderer = FigureCanvasAgg(figure).get_renderer()
    outside = set()
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            for tick in axis.get_major_ticks():
                if not low - 1e-9 <= tick.get_loc() <= high + 1e-9:
                    outside |= {tick.label1, tick.label2}
    for text in figure.findobj(Text):
        if text.get_visible() and text.get_text().strip() and text not in outside:
            box = text.get_window_extent(renderer)
            if box.width > 0.0:
                yield text.get_text(), box


def overlapping(figure: Figure) -> list[tuple[str, str]]:
    """Pairs of words that lie on each other, however little."""
    return [
        (one, other)
        for (one, a), (other, b) in itertools.combinations(list(texts(figure)), 2)
        if min(a.x1, b.x1) - max(a.x0, b.x0) > 0.0 and min(a.y1, b.y1) - max(a.y0, b.y0) > 0.0
    ]


def words_over_bars(figure: Figure) -> list[str]:
    """Words within axes that lie on a bar."""
    renderer = FigureCanvasAgg(figure).get_renderer()
    return [
        text.get_text()
        for axes in figure.axes
        for text in axes.texts
        for bar in axes.patches
        if bar.get_window_extent().width > 1.0
        and bar.get_window_extent().overlaps(text.get_window_extent(renderer))
    ]


def test_pushes_lie_in_their_directions_as_strong_as_they_were_survived():
    axes = panel(picture(ROWS), "Pushes, in place")
    assert axes.get_theta_direction() == 1  # to the left is counterclockwise,
    assert axes.get_theta_offset() == pytest.approx(math.pi / 2)  # and ahead is up
    angles = {"fore": 0, "left": 90, "aft": 180, "right": 270}
    angles |= {"fore_left": 45, "aft_left": 135, "aft_right": 225, "fore_right": 315}
    for colour, variant in ((BLUE, "measured"), (ORANGE, "paper's law")):
        expected = {
            angle: value
            for name, angle in angles.items()
            if not math.isnan(value := of(f"push_in_place.{name}", variant))
        }
        assert dict(points(axes, colour)) == expected


def held_nothing(row: StoredRow) -> StoredRow:
    """The row as if the paper's law had held no level."""
    nothing = dataclasses.replace(row.results["paper's law"], measured=math.nan)
    return dataclasses.replace(row, results={**row.results, "paper's law": nothing})


def test_a_law_that_holds_nothing_has_no_point_but_the_word_none():
    rows = [held_nothing(row) for row in ROWS if row.group == "push_in_place"]
    axes = panel(picture(rows), "Pushes, in place")
    assert points(axes, ORANGE) == []
    assert "paper's law: none" in legend(axes)
    (kept,) = (row for row in ROWS if row.name == "push_in_place.fore")
    axes = panel(picture([kept, *rows[1:]]), "Pushes, in place")
    assert len(points(axes, ORANGE)) == 1
    assert f"paper's law: none in {len(rows) - 1} of {len(rows)} directions" in legend(axes)


def legend(axes: Axes) -> list[str]:
    return [text.get_text() for text in axes.get_legend().get_texts()]


def test_each_panel_of_pushes_says_how_long_they_last():
    circle = [
        dataclasses.replace(row, name=row.name.replace("push_in_place.fore", "push_circle_fast.0"))
        for row in ROWS
        if row.name == "push_in_place.fore"
    ]
    figure = picture([*circle, *some("push_in_place")])
    assert "0.05 to 0.4 s" in legend(panel(figure, "Pushes, 1 m/s"))
    assert "0.1 s" in legend(panel(figure, "Pushes, in place"))


def test_the_legend_names_the_laws_and_the_footer_their_robots():
    shown = [word for word, _ in texts(picture(ROWS))]
    assert "shipped law" in shown and "paper's law" in shown
    assert "measured" not in shown
    made = ROWS[0].results["measured"].origin
    assert made is not None
    other = dataclasses.replace(made, seeds="1 to 10; paper's law 1 to 3", date="2027-01-02")
    rows = [
        dataclasses.replace(
            row,
            results={
                name: dataclasses.replace(result, origin=other)
                for name, result in row.results.items()
            },
        )
        for row in ROWS
    ]
    (footer,) = (word for word, _ in texts(picture(rows)) if "revision" in word)
    assert footer.splitlines() == [
        f"shipped law: robots 1 to 10; 2027-01-02; revision {made.revision}",
        f"paper's law: robots 1 to 3; 2027-01-02; revision {made.revision}",
    ]
    (footer,) = (word for word, _ in texts(picture([ROWS[0], *rows[1:]])) if "revision" in word)
    assert "\npaper's law: robots 1 or 1 to 3; " in footer
    assert footer.startswith(f"shipped law: robots 1 to 2 or 1 to 10; {made.date} to 2027-01-02; ")


def test_payload_and_steady_force_have_bars():
    rows = [as_if("slope.up", "payload.fast"), as_if("step.up", "steady_force.walking")]
    figure = picture(rows)
    for title, label in (("Payload", "at 1 m/s"), ("Force to the side", "at 0.8 m/s")):
        axes = panel(figure, title)
        assert [text.get_text() for text in axes.get_yticklabels()] == [label]
        assert axes.patches


def test_a_limit_that_was_not_found_is_hollow():
    axes = panel(picture(ROWS), "Pushes, 0.5 m/s")
    shown = {
        round(math.degrees(line.get_xdata()[0])): line.get_markerfacecolor() == "white"
        for line in axes.lines
        if line.get_marker() == "o" and line.get_color() == BLUE
    }
    found = {row.name: row.results["measured"] for row in ROWS if row.group == "push_walking"}
    angles = {"fore": 0, "left": 90, "aft": 180, "right": 270}
    assert shown == {
        angle: all(level.passed for level in found[f"push_walking.{name}"].levels)
        for name, angle in angles.items()
    }


def test_lines_join_no_directions_that_are_farther_apart_than_a_quarter():
    rows = [row for row in ROWS if row.name in ("push_walking.fore", "push_walking.left")]
    axes = panel(picture(rows), "Pushes, 0.5 m/s")
    (line,) = (x for x in axes.lines if x.get_color() == BLUE and x.get_marker() == "None")
    angles, values = line.get_data()
    assert np.degrees(angles[:2]) == pytest.approx([0.0, 90.0])
    assert not np.isnan(values[:2]).any()
    assert np.isnan(values[2])


def test_speeds_stand_over_their_commands_with_the_spread_of_the_robots():
    figure = picture(ROWS)
    axes = panel(figure, "Speed")
    (row,) = (row for row in ROWS if row.name == "speed.+0.5")
    (level,) = row.results["measured"].levels
    assert len(level.achieved) == 2
    (place, mean), *_ = sorted(points(axes, BLUE), key=lambda point: abs(point[0] - 0.5))
    assert place == pytest.approx(0.5, abs=0.03)
    assert mean == pytest.approx(np.mean(level.achieved))
    bars = [line.get_xydata() for line in axes.lines if line.get_marker() == "None"]
    spread = [bar[:, 1].tolist() for bar in bars if bar[0, 0] == bar[1, 0] == place]
    assert [min(level.achieved), max(level.achieved)] in spread


@pytest.mark.parametrize("group", ["top_speed", "fastest"])
def test_speeds_backward_lie_on_the_other_side(group: str):
    forward = as_if("top_speed.forward", f"{group}.forward")
    renamed = dataclasses.replace(forward, name=f"{group}.backward")
    ahead = points(panel(picture([forward]), "Speed"), BLUE)
    back = points(panel(picture([renamed]), "Speed"), BLUE)
    assert len(ahead) == len(back) > 1
    assert -np.array(ahead) == pytest.approx(np.array(back), abs=0.03)
    assert all(y < -1.0 for _, y in back)


def test_bars_of_grounds_end_at_their_limits_and_name_them():
    figure = picture(ROWS)
    angles, lengths = panel(figure, "Angles"), panel(figure, "Heights")
    blue = matplotlib.colors.to_rgba(BLUE)
    ends = [bar.get_width() for bar in angles.patches if bar.get_facecolor() == blue]
    assert ends == [of("slope.up"), of("slope.down"), of("slope.side")]
    ends = [bar.get_width() for bar in lengths.patches if bar.get_facecolor() == blue]
    heights = [of("step.up"), of("step.down"), of("stand_block.left")]
    assert ends == pytest.approx([100.0 * height for height in heights])
    targets = [line.get_xdata()[0] for line in angles.lines]
    assert targets == [20.0, 15.0, 8.0]
    (row,) = (row for row in ROWS if row.name == "slope.up")
    beyond = "≥ " if row.results["measured"].open_ended else ""
    assert f"{beyond}{of('slope.up'):g}" in {text.get_text() for text in angles.texts}


def test_less_friction_is_a_longer_bar():
    axes = panel(picture(ROWS), "Friction")
    left, right = axes.get_xlim()
    assert left > right == 0.0
    bar = axes.patches[0]
    assert bar.get_x() == left == 0.8
    assert bar.get_x() + bar.get_width() == pytest.approx(of("friction.0.5"))


def some(*groups: str) -> list[StoredRow]:
    return [row for row in ROWS if row.group in groups]


def as_if(name: str, other: str) -> StoredRow:
    """A row under the name of another one, to fill the picture."""
    return dataclasses.replace(next(row for row in ROWS if row.name == name), name=other)


EVERY_GROUND = [
    *some("slope", "step", "stand_block", "friction"),
    as_if("slope.up", "sinking.heel"),
    as_if("step.down", "sinking.sand"),
    as_if("stand_block.left", "stand_sinking.sand"),
    as_if("stand_block.left", "stand_block.right"),
    as_if("friction.0.5", "friction.0.2"),
    *(as_if("slope.up", f"payload.{way}") for way in ("in_place", "walking", "fast")),
    *(as_if("step.up", f"steady_force.{way}") for way in ("standing", "in_place", "walking")),
]

NONE_AT_ALL = [held_nothing(row) for row in ROWS]
CIRCLES = [
    as_if("push_in_place.fore", f"push_circle_{way}.{angle}")
    for way in ("in_place", "slow", "fast")
    for angle in range(0, 360, 30)
]


@pytest.mark.parametrize(
    "rows",
    [
        ROWS,
        some("push_in_place"),
        some("speed", "sideways"),
        some("slope", "step"),
        EVERY_GROUND,
        [*EVERY_GROUND, *some("speed", "push_in_place")],
        some("stand_push", "slope"),
        some("push_walking", "speed"),
        NONE_AT_ALL,
        [*CIRCLES, *NONE_AT_ALL],
        [dataclasses.replace(r, results={"measured": r.results["measured"]}) for r in ROWS],
    ],
    ids=[
        "all",
        "pushes",
        "speeds",
        "grounds",
        "every ground",
        "full",
        "standing",
        "walking",
        "no law of the paper",
        "circles",
        "own law alone",
    ],
)
def test_no_words_lie_on_each_other_or_beyond_the_edge(rows: list[StoredRow]):
    figure = picture(rows)
    assert overlapping(figure) == []
    assert words_over_bars(figure) == []
    width, height = figure.canvas.get_width_height()
    for word, box in texts(figure):
        assert box.x0 >= -1.0 and box.y0 >= -1.0, word
        assert box.x1 <= width + 1.0 and box.y1 <= height + 1.0, word


def test_words_that_lie_on_each_other_are_found():
    figure = Figure()
    figure.text(0.5, 0.5, "one")
    figure.text(0.51, 0.5, "other")
    figure.text(0.5, 0.9, "apart")
    assert overlapping(figure) == [("one", "other")]


def test_the_picture_is_written_and_removed_where_there_is_nothing_to_show(tmp_path: Path):
    path = tmp_path / "sweeps.png"
    draw(path, ROWS)
    with Image.open(path) as image:
        assert image.width > 1500 and image.height > 1000
    draw(path, [dataclasses.replace(row, name=f"other.{row.name}") for row in ROWS])
    assert not path.exists()
