"""Rows of sweeps as data: what a file of rows means, and how wrong files are refused."""

from __future__ import annotations

import dataclasses
import math
import re
from pathlib import Path

import pytest

from cassie_bags.errors import ExperimentError
from cassie_bags.studies.run_trial import MEASURES, run_trial
from cassie_bags.studies.sweep.course import Budget, reached_at, step_time
from cassie_bags.studies.sweep.formula import filled, resolved
from cassie_bags.studies.sweep.row import Row
from cassie_bags.studies.sweep.row_file import KEYS, checked_rows, read_rows
from cassie_bags.studies.sweep.table import all_rows, chosen_rows
from cassie_msgs.tunables import ParameterError

README = Path(__file__).resolve().parents[1] / "README.md"
EXAMPLE = re.search(r"```yaml\n(rows:\n.*?)```", README.read_text("utf-8"), re.DOTALL)[1]


def rows_of(text: str, folder: Path) -> list[Row]:
    path = folder / "own.yaml"
    path.write_text(text)
    return checked_rows(path, all_rows())


def test_the_readme_s_example_pushes_a_loaded_robot_to_either_side(tmp_path: Path):
    left, right = rows_of(EXAMPLE, tmp_path)
    assert (left.name, right.name, left.unit, left.target) == ("gust.left", "gust.right", "Ns", 12)
    assert left.title == "push of 0.5 s to the left at 0.8 m/s with 4 kg, 9 of 10 phases"
    assert left.levels == (4.0, 8.0, 12.0, 16.0, 20.0)
    trials = right.trials(Budget(seeds=2, phases=4), 8.0)
    assert [trial.seed for trial in trials] == [1, 2, 1, 2]
    reached, stride = reached_at(0.8), 2.0 * step_time(0.8)
    for index, trial in enumerate(trials):
        (push,) = trial.content["pushes"]
        assert push["t"] == pytest.approx(reached + 5.0 + stride * index / 4.0)
        assert push["duration"] * push["force"][1] == pytest.approx(-8.0)
        assert trial.window == pytest.approx((reached + 10.0, reached + 12.0))
        assert trial.content["payload"] == {"mass": 4.0}
    assert right.holds({"vx": 0.99}, 8.0) and not right.holds({"vx": math.nan}, 8.0)


def test_the_readme_names_every_key_of_a_row():
    section = README.read_text("utf-8").partition("### Rows of your own")[2]
    section = section.partition("\n### ")[0]
    own = KEYS[: KEYS.index("scene")]
    assert [key for key in own if not re.search(rf"`{key}\b", section)] == []


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("levels:", "lvels:", "rows.0: unknown key lvels: did you mean levels?"),
        ("$level,", "$levle,", "gust.left: push.impulse: unknown name levle: did you mean level?"),
        ("vx: {target", "vxx: {target", "unknown figure vxx: did you mean vx?"),
        ("12.0 Ns", "some Ns", "at_least = 'some Ns' is not a number and its unit"),
        ("at_least: 12.0 Ns", "counts: 1", "counts = 1 is not true"),
        ("walk: {vx: 0.8}", "walk: {vx: 8.0}", "walk.vx = 8 m/s is outside -3 .. 3 m/s"),
        ("walk: {vx: 0.8}", "draw: {}", "expected one of walk, cross, stand, ride"),
        ("{mass: 4.0}", "{mass: 40.0}", "payload.mass = 40 kg is outside 0 .. 30 kg"),
        ("{mass: 4.0}", "{mas: 4.0}", "payload: unknown key mas: did you mean mass?"),
        ("trials: phases", "trials: robots", "push.t: unknown name phase"),
        ("trials: phases", "trials: seeds", "trials = 'seeds' is not one of robots, phases"),
        ("gust.$side", "gust", "rows.0.name = 'gust' is not group.word"),
        ("gust.$side", "gust.x", "row gust.x: there is a row gust.x already"),
        ("gust.$side", "speed.+0", "row speed.+0: there is a row speed.+0 already"),
        ("[left, right]", "[left]", "rows.0.each: expected lists of one length of 1 or more"),
        ("step: 4.0", "step: 1e-4", "levels: 160001 of them, expected 1 .. 1000"),
        ("$reached + 12.0", "2*($reached)", "window.end = '2*($reached)' is not a formula"),
        ("seconds: 2.0", "seconds: 90.0", "s is less than window.seconds"),
        ("walk: {vx: 0.8}", "walk: {vx: $level/0}", "walk.vx: $level/0 divides by 0"),
        ("angle: [90.0, -90.0]", "angle: [2*$angle, 1.0]", "push.angle_deg: unknown name angle"),
        ("side: [left, right]", "side: [[1], 2]", "rows.0.name: $side = [1] is no word or number"),
        ("share", "scene: moon\n    share", "unknown scene moon"),
        ("share", "figure: 2*$vxx\n    share", "figure: unknown name vxx: did you mean vx?"),
        ("share", "operator: 5\n    share", "operator = 5 is not a list"),
    ],
)
def test_a_wrong_row_is_refused_with_key_value_and_what_is_permitted(
    old: str, new: str, reason: str, tmp_path: Path
):
    assert old in EXAMPLE
    with pytest.raises(ExperimentError, match=re.escape(reason)) as refused:
        rows_of(EXAMPLE.replace(old, new), tmp_path)
    assert str(refused.value).startswith(f"{tmp_path / 'own.yaml'}: ")


NAMES = {"level": 3.0, "word": "fore_left", "twice": "$level*2", "list": [1, "$level"], "index": 3}


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("$level", 3.0),
        ("-$level", -3.0),
        ("1.5 + 2*$level/4 - 1e-1", 1.5 + 6.0 / 4.0 - 0.1),
        ("10.0 - $level - 2", 5.0),
        ("$word", "fore_left"),
        ("walk", "walk"),
        ("$twice + 1", 7.0),
        ("$list", [1, 3.0]),
        ({"in_turn": [1.0, "-$level"]}, -3.0),
        ([{"t": "$level"}], [{"t": 3.0}]),
    ],
)
def test_placeholders_are_replaced_by_values(given, expected):
    assert resolved(given, NAMES) == expected


@pytest.mark.parametrize("text", ["$level)", "2**$level", "$level $level", "$level + walk", "$$"])
def test_nothing_but_sums_of_products_is_a_formula(text: str):
    with pytest.raises(ParameterError, match=re.escape(f"x = '{text}' is not a formula")):
        resolved(text, NAMES, "x")


def test_names_show_signs_and_titles_no_underscores():
    assert filled("speed.$+level", NAMES, "name") == "speed.+3"
    assert filled("at $level m/s, $word", NAMES, "title", gap=" ") == "at 3 m/s, fore left"


def test_levels_at_equal_distances_have_no_rounding_errors():
    (row,) = chosen_rows(["top_speed.forward"])
    assert row.levels == (0.8, 0.9, 1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.7, 1.8, 1.9, 2.0)


def test_rows_share_what_stands_beside_them_and_repeat_for_each_value(tmp_path: Path):
    path = tmp_path / "rows.yaml"
    path.write_text(
        "each: {a: [x, y]}\nstand: {}\nwindow: {end: 9.0, seconds: 1.0}\nrows:\n"
        "  - {name: s.$a, title: $a, at_most: 0.1 m, figure: creep}\n"
        "  - {name: s.$a$n, title: $a $n, each: {n: [1, 2]}, counts: true, stand: {height: 0.8}}\n"
    )
    rows = {row.name: row for row in read_rows(path)}
    assert list(rows) == ["s.x", "s.x1", "s.x2", "s.y", "s.y1", "s.y2"]
    heights = [
        row.trials(Budget(1), 0.0)[0].content["operator"][0]["height"] for row in rows.values()
    ]
    assert heights == [0.9, 0.8, 0.8, 0.9, 0.8, 0.8]
    assert (rows["s.x"].at_least, rows["s.x1"].counts, rows["s.x1"].unit) == (False, True, "%")


def test_a_short_file_cannot_stand_for_countless_rows(tmp_path: Path):
    row = "{name: a.b, title: $a, stand: {}, counts: true}"
    for _ in range(12):
        row = f"{{each: {{a: {list(range(50))}}}, rows: [{row}]}}"
    with pytest.raises(ExperimentError, match="it has more than 1000 rows"):
        rows_of(row, tmp_path)


def test_every_figure_and_bound_of_the_rows_is_one_of_the_measures():
    measures = {name: 1.0 for word in MEASURES for name in (word, f"reference_{word}")}
    for row in all_rows():
        row.holds(measures, row.levels[0])
        for figure in (row.figure, row.achieved):
            if figure is not None:
                figure(measures, row.levels[0])


def test_a_run_has_the_measures_that_rows_may_name():
    (row,) = chosen_rows(["stand_drop"])
    (trial,) = row.trials(Budget(1), 0.02)
    shorter = dataclasses.replace(trial, content={**trial.content, "duration": 0.5})
    assert set(run_trial(shorter)) == set(MEASURES)
