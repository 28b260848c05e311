"""Pictures of a run, with and without something to render with."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image
from synthetic import glide

from cassie_bags.bag.recording import Recording
from cassie_bags.report.figures import (
    DRAWERS,
    draw_all,
    estimate,
    footsteps,
    knee_phase_portrait,
    mode_timeline,
    moving_mean,
    outputs_by_phase,
    overview,
    speed_tracking,
)
from cassie_bags.report.pictures import STRIP_LENGTH, moments, strip
from cassie_bags.report.view import View, view_of
from cassie_bags.signals.events import Event
from cassie_bags.signals.track import Track
from cassie_gaits.names import DRIVES
from cassie_msgs.experiment.expectation import Phase
from cassie_msgs.layout import ControllerStatus, RobotMode
from cassie_sim.errors import SimulationError

PHASES = (Phase("first", 0.0, 1.0), Phase("second", 1.0, 2.0))


PUSH = Event("push", 0.5, 0.6, "push 5 Ns", (50.0, 0.0, 0.0))


def view(recording: Recording, title: str = "try", phases: Sequence[Phase] = PHASES) -> View:
    """What pictures show of a recording, with some phases and a push."""
    return replace(view_of(recording, title), phases=phases, events=[PUSH])


@pytest.fixture(scope="module")
def shown() -> View:
    return view(glide(2.0, yaw_rate=0.3))


@pytest.fixture(scope="module")
def track(shown: View) -> Track:
    return shown.track


def shades(path: Path) -> int:
    """Number of different colours, 1 in an empty picture."""
    image = Image.open(path).convert("RGB")
    return len(image.getcolors(image.width * image.height))


def test_each_figure_is_a_png_with_something_in_it(shown: View, tmp_path: Path):
    files = draw_all(shown, tmp_path)
    assert set(files) == set(DRAWERS) - {"outputs_by_phase"}  # it glides without steps
    for path in files.values():
        assert shades(path) > 20


def test_long_names_leave_room_for_the_plots(shown: View):
    """A fault told in a sentence left the modes no height."""
    sentence = "stopping and standing without joint_position.4 (right_tarsus): " * 2
    events = [Event("fault", 0.5, 1.0, sentence)]
    phases = [Phase(sentence, 0.0, 1.0)]
    for drawer in (mode_timeline, speed_tracking):
        figure = drawer(replace(shown, events=events, phases=phases))
        FigureCanvasAgg(figure).draw()
        height = figure.axes[0].get_position().height * figure.get_figheight()
        assert height > 0.5  # inch


def test_outputs_are_drawn_over_the_phase_of_each_stance(shown: View):
    rows = np.zeros(200, ControllerStatus.DTYPE)
    rows["mode"], rows["stance_leg"] = RobotMode.WALK, np.arange(200) // 20 % 2
    rows["phase"] = np.arange(200) % 20 / 20
    rows["y"][:, 3] = 0.01 * np.where(rows["stance_leg"] == 0, 1.0, -1.0)  # m, of the leg length
    figure = outputs_by_phase(replace(shown, status=rows))
    assert figure is not None
    assert len(figure.axes) == 9
    means = [line.get_ydata() for line in figure.axes[3].lines if line.get_linestyle() == "-"]
    np.testing.assert_allclose([np.nanmean(m) for m in means[:2]], [10.0, -10.0])  # mm
    assert outputs_by_phase(replace(shown, status=rows[:5])) is None


def test_a_run_that_ended_at_once_can_be_drawn(tmp_path: Path):
    for path in draw_all(view(glide(0.02), phases=()), tmp_path).values():
        assert path.is_file()


def test_phases_that_a_run_did_not_reach_leave_room_for_the_others(shown: View, tmp_path: Path):
    late = (Phase("at the end", 1.0, 70.0), Phase("never", 70.0, 80.0))
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # matplotlib warns where a label leaves it no room
        draw_all(replace(shown, phases=(*PHASES, *late)), tmp_path)


def test_a_run_that_ended_in_damping_can_be_drawn(tmp_path: Path):
    damped = view(glide(2.0))
    damped.track.legs[200:] = np.nan  # no estimate, so no place of the feet
    for path in draw_all(damped, tmp_path).values():
        assert shades(path) > 20


def test_without_opengl_the_strip_shows_stick_figures_and_says_what_to_install(
    shown: View, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    reason = "install the Debian packages libegl1"

    def no_opengl(*_: object, **__: object) -> None:
        raise SimulationError(reason)

    monkeypatch.setattr("cassie_bags.report.pictures.Camera", no_opengl)
    path = tmp_path / "strip.png"
    assert strip(shown, path) == reason
    assert shades(path) > 20


def test_a_strip_shows_as_many_images_of_each_phase(track: Track):
    phases = [Phase(str(i), 0.4 * i, 0.4 * i + 0.4) for i in range(5)]
    shown = [track.time[index] for index in moments(track, phases)]
    np.testing.assert_allclose(shown, np.arange(0.1, 2.0, 0.2), atol=0.003)
    middles = [track.time[index] for index in moments(track, phases, 7)]
    np.testing.assert_allclose(middles, [0.2, 0.6, 1.0, 1.4, 1.8], atol=0.003)
    assert len(moments(track, ())) == STRIP_LENGTH


def test_a_moving_mean_of_a_line_is_the_line():
    time = np.arange(0.0, 2.0, 0.01)
    mean = moving_mean(time, 3.0 * time, 0.2)
    known = np.isfinite(mean)
    assert known.sum() > 150
    np.testing.assert_allclose(mean[known], 3.0 * time[known])


def test_a_moving_mean_is_unknown_where_a_value_is():
    values = np.ones(200)
    values[100] = np.nan
    mean = moving_mean(np.arange(200) * 0.01, values, 0.2)
    assert np.isnan(mean[91:110]).all()
    np.testing.assert_allclose(mean[20:80], 1.0)


def test_the_legend_of_steps_round_one_place_leaves_the_title_free():
    """As tall as wide the plot is narrow: its legend lay on the title."""
    figure = footsteps(view(glide(2.0, vx=0.0), "standing_recovery, seed 0"))
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    written = [*figure.legends, *figure.texts, *(axes.title for axes in figure.axes)]
    written += [axes.get_legend() for axes in figure.axes if axes.get_legend()]
    boxes = [one.get_window_extent(canvas.get_renderer()) for one in written]
    boxes = [box for box in boxes if box.width > 1.0]
    assert len(boxes) == 2
    assert not boxes[0].overlaps(boxes[1])


def test_a_long_narrow_walk_is_drawn_in_rows_whose_labels_do_not_touch():
    shown = view(glide(20.0, vx=2.0))
    figure = footsteps(shown)
    rows = figure.axes
    assert len(rows) == 3
    edges = [axes.get_xlim() for axes in rows]
    assert edges[0][1] == pytest.approx(edges[1][0]) and edges[1][1] == pytest.approx(edges[2][0])
    x = shown.track.position[:, 0]
    assert edges[0][0] < x.min() and edges[-1][1] > x.max()
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    for axes in rows:
        low, high = axes.get_ylim()
        boxes = [
            label.get_window_extent(canvas.get_renderer())
            for label, tick in zip(axes.get_yticklabels(), axes.get_yticks(), strict=True)
            if low <= tick <= high
        ]
        assert len(boxes) >= 2
        assert all(one.y1 < other.y0 for one, other in itertools.pairwise(boxes))
    assert len(footsteps(view(glide(2.0))).axes) == 1


def test_legends_of_the_estimates_error_cover_no_curve(shown: View):
    figure = estimate(shown)
    assert figure is not None
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    for axes in figure.axes:
        plotted = axes.get_window_extent(canvas.get_renderer())
        assert not axes.get_legend().get_window_extent(canvas.get_renderer()).overlaps(plotted)


def test_a_colour_of_the_standard_plot_means_one_thing(shown: View):
    """The right foot's force had the colour of commanded speeds."""
    figure = overview(shown)
    (forces,) = [axes for axes in figure.axes if "force" in axes.get_ylabel()]
    assert [text.get_text() for text in forces.get_legend().get_texts()] == ["left", "right"]
    legend = {line.get_color() for line in figure.legends[0].get_lines()}
    assert not legend.intersection(line.get_color() for line in forces.get_lines()[:2])


def test_the_angles_of_a_knee_that_hardly_moves_can_be_read():
    """On a Segway they wrote over each other."""
    ride = view(glide(2.0, vx=4.0), "segway_ride, seed 0")
    track = replace(ride.track, sensors=ride.track.sensors.copy())
    track.sensors["drive_position"][:, DRIVES.index("left_knee")] = np.linspace(
        -2.19, -1.99, len(track.time)
    )
    figure = knee_phase_portrait(replace(ride, track=track, events=()))
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    axes = figure.axes[0]
    low, high = axes.get_xlim()
    ticks = zip(axes.get_xticks(), axes.get_xticklabels(), strict=True)
    boxes = [label.get_window_extent() for tick, label in ticks if low <= tick <= high]
    assert len(boxes) >= 3
    assert not any(a.overlaps(b) for a, b in itertools.pairwise(boxes))
