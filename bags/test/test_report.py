"""The page about recorded runs: what it says, and how it looks in a browser."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from synthetic import glide, glide_messages
from test_bag import write_bag
from test_looking import command

from cassie_bags.bag.recording import GROUND_TRUTH_TOPIC, read_recording
from cassie_bags.bag.summary import Interval, Summary
from cassie_bags.cli.frame import labels
from cassie_bags.report.figures import estimate
from cassie_bags.report.page import CAPTIONS, drive_entry, page
from cassie_bags.report.view import view_of
from cassie_bags.signals.events import events_of
from cassie_bags.signals.leg_geometry import euler_angles, quaternions
from cassie_bags.signals.metrics import UNITS, measure
from cassie_bags.signals.track import make_track
from cassie_bags.signals.window import estimation_error
from cassie_msgs.experiment.expectation import PHASE_METRICS, RUN_METRICS
from cassie_msgs.experiment.scenario import Scenario
from cassie_msgs.layout import RobotState

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

DESKTOP, PHONE = {"width": 1280, "height": 900}, {"width": 390, "height": 844}
MOST_BYTES = 5_000_000


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bag of a drive by hand: no experiment in it."""
    path = tmp_path_factory.mktemp("drive") / "drive.mcap"
    write_bag(path, glide_messages(3.0, yaw_rate=0.2))
    return path


@pytest.fixture(scope="module")
def file(drive: Path) -> Path:
    """A page about one bag."""
    path = drive.with_name("page.html")
    done = command("report", drive, "-o", path)
    assert done.returncode == 0, done.stderr
    return path


@pytest.fixture(scope="module")
def two(drive: Path) -> Path:
    """A page about two bags, one of which fell and was not closed."""
    other = drive.with_name("other.mcap")
    write_bag(other, glide_messages(4.0, vx=0.3, tilt_from=2.0))
    other.write_bytes(other.read_bytes()[:-2000])
    path = drive.with_name("two.html")
    done = command("report", drive, other, "-o", path, "--no-video")
    assert done.returncode == 0, done.stderr
    return path


@pytest.fixture
def look(browser: Browser) -> Iterator[Any]:
    """Opens a page and sees that nothing in it fails."""
    opened: list[Page] = []
    errors: list[str] = []

    def open_page(path: Path, size: dict[str, int]) -> Page:
        shown = browser.new_page(viewport=size)  # type: ignore[arg-type]
        opened.append(shown)
        shown.on("pageerror", lambda error: errors.append(str(error)))
        shown.on("requestfailed", lambda request: errors.append(request.url[:80]))
        shown.goto(path.as_uri())
        shown.wait_for_function("[...document.images].every(image => image.complete)")
        return shown

    yield open_page
    for shown in opened:
        shown.close()
    assert not errors


def test_a_drive_by_hand_is_reported_by_its_modes(file: Path):
    text = file.read_text(encoding="utf-8")
    assert len(text) < MOST_BYTES
    assert "Cassie: drive" in text
    assert re.search(r"<td>walk</td>", text)
    assert not re.search(r'(src|href)="(?!data:|#)', text)  # nothing but itself
    for name, caption in CAPTIONS.items():
        assert (f'alt="{caption}: drive"' in text) == (name != "outputs_by_phase"), name
    assert "as expected" not in text  # nothing was expected of it


def test_nothing_is_overwritten(drive: Path, file: Path):
    before = file.read_bytes()
    done = command("report", drive, "-o", file)
    assert done.returncode == 2
    assert "exists" in done.stderr
    assert file.read_bytes() == before


def test_two_bags_stand_side_by_side(two: Path):
    text = two.read_text(encoding="utf-8")
    assert "Side by side" in text
    assert "the bag is damaged or not closed: " in text
    assert "data:video" not in text
    assert "at 2.00 s" in text  # of the fall


def test_a_bag_without_a_true_pose_is_shown_by_its_estimate(tmp_path: Path):
    messages = glide_messages(1.0)
    del messages[GROUND_TRUTH_TOPIC]
    write_bag(tmp_path / "blind.mcap", messages)
    view = view_of(read_recording(tmp_path / "blind.mcap"), "blind")
    np.testing.assert_array_equal(view.track.position, view.track.state["q"][:, :3])
    assert "the estimate stands in its place" in view.notes[0]
    assert estimate(view) is None  # it would be without error


def test_a_page_says_where_reasons_come_from_without_the_supervisors_status(file: Path):
    text = " ".join(file.read_text(encoding="utf-8").split())
    assert "the supervisor&#39;s status is not in the bag" in text


def test_reasons_and_faults_stand_at_the_time_of_the_episode_that_is_shown():
    """Times of a bag go on over episodes; those of a track begin anew."""
    recording = glide(2.0, episode=2)
    summary = Summary(
        files=(), size=0, complete=True, lost_bytes=0, damage="", duration=12.0, wall_time=0.0,
        topics=(), gaps=(), strays=(),
        episodes=[Interval("1", 0.0, 10.0), Interval("2", 10.0, 12.0)],
        modes=[Interval("walk", 0.02, 10.0, "before"), Interval("walk", 10.02, 12.0, "it asked")],
        faults=[Interval("old", 1.0, 2.0), Interval("late", 9.0, 11.0)],
        has_status=True, made_gaits={},
        nodes=[Interval("stack began anew", 11.5, 11.5)], problems=(), metadata={},
        recording=recording,
    )  # fmt: skip
    view = view_of(recording, "two episodes", None, summary)
    assert [(mode.t0, mode.reason) for mode in view.modes] == [(0.0, "it asked")]
    assert [(e.kind, e.t0, e.t1, e.text) for e in view.events] == [
        ("fault", 0.0, 1.0, "late"),
        ("node", 1.5, 1.5, "stack began anew"),
    ]


def test_the_shipped_bags_can_be_reported(tmp_path: Path):
    """They hold no true pose, and one of them a Segway."""
    bags = sorted((Path(__file__).parents[1] / "recordings").glob("*.mcap"))
    path = tmp_path / "page.html"
    done = command("report", *bags, "-o", path, "--no-video")
    assert done.returncode == 0, done.stderr
    text = path.read_text(encoding="utf-8")
    assert len(bags) == 3 and len(text) < MOST_BYTES
    assert text.count("the estimate stands in its place") == 3
    assert "<td>segway</td>" in text
    assert "<dt>steps</dt><dd>\N{EN DASH}</dd>" in text  # of a bag without controller status


def test_quaternions_turn_back_into_their_angles():
    angles = np.random.default_rng(1).uniform(-1.2, 1.2, (50, 3))
    found = np.concatenate([euler_angles(q[None]) for q in quaternions(angles)])
    np.testing.assert_allclose(found, angles, atol=1e-12)


def test_the_estimators_error_is_that_which_was_put_in():
    track = make_track(glide(1.0, vx=0.5, yaw_rate=0.4))
    state = track.state.copy()
    yaw = track.angles[:, 0]
    state["v"][:, :3] = track.velocity
    state["v"][:, 0] += 0.1 * np.cos(yaw)  # 0.1 m/s ahead
    state["v"][:, 1] += 0.1 * np.sin(yaw)
    state["q"][:, :2] = 1.01 * track.position[:, :2] + 7.0  # odometry begins anywhere
    state["q"][:, 4] = track.angles[:, 1] + 0.02
    error = estimation_error(replace(track, state=state))
    np.testing.assert_allclose(error.velocity, np.tile([0.1, 0, 0], (len(yaw), 1)), atol=1e-12)
    np.testing.assert_allclose(error.tilt, np.tile([0, 0.02], (len(yaw), 1)), atol=1e-12)
    moved = track.position[-1, :2] - track.position[0, :2]
    np.testing.assert_allclose(error.position[-1], 0.01 * moved, atol=1e-12)


def test_events_of_a_scenario_until_the_end_of_the_run():
    scenario = Scenario.from_mapping(
        {
            "pushes": [{"t": 5.0, "force": [30.0, 40.0, 0.0], "duration": 0.2}],
            "gantry": [{"t": 1.0, "action": "lower", "height": 0.8}, {"t": 90.0, "action": "hold"}],
            "faults": [{"t": 6.0, "channel": "drive_position.3", "kind": "stuck"}],
        }
    )
    found = [(e.kind, e.t0, e.t1, e.text) for e in events_of(scenario, 10.0)]
    assert found == [
        ("gantry", 1.0, 1.0, "gantry: lower at 0.8 m"),
        ("push", 5.0, 5.2, "push 10 Ns"),
        ("fault", 6.0, 10.0, "drive_position.3 stuck"),
    ]


def test_words_of_a_bag_are_text_and_never_markup():
    recording = glide(1.0)
    view = view_of(recording, "<script>alert(1)</script>")
    view = replace(view, modes=[replace(view.modes[0], reason="<b>&")])
    text = page("t", [drive_entry(view, measure(recording, view.track, ()), {}, {})], {"<i>": "1"})
    assert "<script>" not in text and "<b>" not in text and "<i>" not in text
    assert "&lt;script&gt;" in text


def test_what_cannot_be_measured_is_a_dash():
    """As where one sample of the pose is not a number."""
    recording = glide(1.0)
    view = view_of(recording, "glide")
    metrics = measure(recording, view.track, view.phases)
    unknown = replace(metrics, run=dict.fromkeys(metrics.run, np.nan) | {"duration": 1.0})
    text = page("glide", [drive_entry(view, unknown, {}, {})], {})
    for name in ("steps", "distance", "greatest tilt", "peak torque"):
        assert re.search(rf"<dt>{name}</dt><dd>\s*\u2013", text)


def test_an_experiment_is_held_against_its_file(tmp_path: Path):
    """Its bag alone says what was expected of it."""
    experiment = tmp_path / "try.yaml"
    experiment.write_text(
        "start: standing\nduration: 1.0\npushes: [{t: 0.5, force: [20, 0, 0]}]\n"
        "operator: [{t: 0.0, power: true, mode: stand, height: 0.95}]\n"
        "supervisor: {walk_height: 0.9, height_high: 0.93}\n"
        "expect:\n  phases:\n"
        "    - {name: stand, t0: 0.6, t1: 1.0, vx: {target: 3, tolerance: 0.1}}\n"
    )
    done = command(
        "experiment", experiment, "--in-process", "--out", tmp_path / "out", "--no-pictures"
    )
    assert done.returncode == 1, done.stderr
    cut = "stand: the command height = 0.95 m was cut to 0.93 m by supervisor.height_high"
    assert cut in (tmp_path / "out" / "table.txt").read_text().replace("\n", " ")
    (told,) = json.loads((tmp_path / "out" / "result.json").read_text())["cuts"]
    assert told["text"] == cut
    assert (told["commanded"], told["permitted"]) == (0.95, 0.93)
    assert told["parameters"] == ["height_high"]
    path = tmp_path / "page.html"
    done = command("report", tmp_path / "out" / "bag.mcap", "-o", path, "--no-video")
    assert done.returncode == 1, done.stderr
    text = path.read_text(encoding="utf-8")
    assert re.search(r"<td>vx</td><td[^>]*>2.9 .. 3.1 m/s</td><td[^>]*>[-0-9.e]+ m/s</td>", text)
    assert "✗ no" in text
    assert "push 2 Ns" in text
    assert cut in text
    assert RobotState.TOPIC not in text


def test_figures_side_by_side_have_units(two: Path):
    text = two.read_text(encoding="utf-8")
    for figure in ("drift (m)", "tilt (deg)", "vx mean error (m/s)", "duration (s)", "steps"):
        assert f"<tr><td>{figure}</td>" in text, figure
    assert UNITS.keys() >= {*RUN_METRICS, *PHASE_METRICS}


def test_two_bags_of_one_experiment_are_told_apart_by_their_names(tmp_path: Path):
    """As a pair from before and after a change is, here without the true pose."""
    shipped = Path(__file__).parents[1] / "recordings" / "push.mcap"
    for name in ("before", "after"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "push.mcap").symlink_to(shipped)
    path = tmp_path / "page.html"
    bags = [tmp_path / name / "push.mcap" for name in ("before", "after")]
    done = command("report", *bags, "-o", path, "--no-video")
    assert done.returncode == 0, done.stderr
    text = path.read_text(encoding="utf-8")
    for name in ("before/push", "after/push"):
        assert len(re.findall(rf"<h2 id=[^>]*>[^<]*{name}", text)) == 1
        assert len(re.findall(rf'<th class="n">[^<]*{name}', text)) == 1
        assert f"<td>{name}</td>" in text


@pytest.mark.parametrize(
    ("bags", "names"),
    [
        (["a/walk.mcap", "b/turn.mcap"], ["walk", "turn"]),
        (["a/bag.mcap", "b/bag.mcap"], ["a", "b"]),
        (["a/walk.mcap", "b/walk.mcap", "turn.mcap"], ["a/walk", "b/walk", "turn"]),
        (["x/a/bag.mcap", "y/a/bag.mcap"], ["x/a/bag", "y/a/bag"]),
        (["walk.mcap", "walk.mcap"], ["walk", "walk"]),
    ],
)
def test_bags_have_names_that_differ(bags: list[str], names: list[str]):
    assert labels([Path("/there", bag) for bag in bags]) == names


@pytest.mark.parametrize("size", [DESKTOP, PHONE], ids=["desktop", "phone"])
@pytest.mark.parametrize("which", ["file", "two"])
def test_the_page_fits_the_window_and_every_picture_shows(look, request, which: str, size):
    shown = look(request.getfixturevalue(which), size)
    assert shown.evaluate("document.documentElement.scrollWidth") <= size["width"]
    widths = shown.evaluate("[...document.images].map(image => image.naturalWidth)")
    assert len(widths) >= 8 and min(widths) > 300
    wide = shown.evaluate(
        "[...document.querySelectorAll('table, figure')].filter(part => !part.closest('.scroll')"
        " && part.getBoundingClientRect().right > innerWidth).length"
    )
    assert wide == 0
    # Not smaller than can be read: what is too wide for a phone scrolls in its own frame.
    drawn = shown.evaluate("Math.min(...[...document.images].map(image => image.clientWidth))")
    assert drawn >= (340 if size is PHONE else 500)


def test_the_video_plays(look, file: Path):
    shown = look(file, DESKTOP)
    shown.wait_for_function("document.querySelector('video').readyState >= 1")
    assert shown.evaluate("document.querySelector('video').duration") > 1.0


def test_the_page_can_be_printed(look, file: Path, tmp_path: Path):
    shown = look(file, DESKTOP)
    shown.emulate_media(media="print")
    assert not shown.locator("video").is_visible()
    printed = shown.pdf(prefer_css_page_size=True)
    assert 2 <= len(re.findall(rb"/Type\s*/Page\b", printed)) <= 8
