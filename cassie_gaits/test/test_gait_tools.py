"""optimize_gaits and check_gaits: files, exit codes, the library that comes with the package."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from distributed import LocalCluster

import cassie_gaits
from cassie_gaits.certificate.certify import certify
from cassie_gaits.errors import GaitLibraryError
from cassie_gaits.gait_library_file import (
    default_library_path,
    library_path,
    load_certified,
    load_library,
    save_library,
)
from cassie_gaits.grid_pictures import grid_figure
from cassie_gaits.optimize import library, solution
from cassie_gaits.optimize.problem import Problem
from cassie_gaits.ros import check_gaits, optimize_gaits, plot_gaits

OPTIMIZED = Path(cassie_gaits.__file__).parent / "libraries" / "optimized.json"


def test_the_optimized_library_has_the_seven_certified_gaits():
    library = load_certified(OPTIMIZED)
    assert [gait.vx for gait in library.gaits] == list(optimize_gaits.SPEEDS)
    assert library.kind == "optimized"


def test_a_gait_of_the_library_passes_the_check_again():
    assert certify(load_library(OPTIMIZED).gaits[-1]).met


def changed(tmp_path, change):
    document = json.loads(OPTIMIZED.read_text())
    change(document)
    path = tmp_path / "changed.json"
    path.write_text(json.dumps(document))
    return path


def test_a_library_for_another_model_is_refused(tmp_path):
    path = changed(tmp_path, lambda document: document.update(model_hash="0" * 16))
    with pytest.raises(GaitLibraryError, match="it is for model 0000"):
        load_certified(path)
    assert check_gaits.main([str(path)]) == 2


def test_a_library_for_another_robot_is_refused(tmp_path, capsys):
    path = changed(tmp_path, lambda document: document.update(robot="digit"))
    for allow_uncertified in (False, True):
        with pytest.raises(GaitLibraryError, match="the robot 'digit', expected 'cassie'"):
            load_certified(path, allow_uncertified=allow_uncertified)
    assert check_gaits.main([str(path), "--certify"]) == 2
    assert "robot 'digit'" in capsys.readouterr().err


def test_neighbours_and_certificates_are_not_asked_for_at_once(capsys):
    assert check_gaits.main([str(OPTIMIZED), "--neighbours", "--certify"]) == 2
    printed = capsys.readouterr()
    assert printed.out == "" and "--neighbours certifies nothing" in printed.err


def test_an_uncertified_library_runs_only_on_request(tmp_path):
    path = changed(tmp_path, lambda document: document["gaits"][2].update(certificate=None))
    with pytest.raises(GaitLibraryError, match="gait of 0 m/s is not certified"):
        load_certified(path)
    assert len(load_certified(path, allow_uncertified=True).gaits) == 7


def test_a_half_written_library_is_refused(tmp_path, capsys):
    path = tmp_path / "half.json"
    path.write_text(OPTIMIZED.read_text()[:5000])
    assert check_gaits.main([str(path)]) == 2
    assert "half.json" in capsys.readouterr().err


def test_optimize_writes_resumes_and_keeps_a_good_library(tmp_path, capsys, monkeypatch):
    out = tmp_path / "gaits.json"
    assert optimize_gaits.main(["--speeds", "0.25", "--jobs", "1", "--out", str(out)]) == 0
    assert "certified" in capsys.readouterr().out
    good = out.read_bytes()
    assert load_certified(out).gaits[0].vx == 0.25
    hasty = Problem(symmetric=True, lean=True, max_iterations=12)
    monkeypatch.setattr(solution, "problem", lambda **_: hasty)
    failing = ["--speeds", "5.0", "--jobs", "1", "--out", str(out)]
    assert optimize_gaits.main(failing) == 1
    printed = capsys.readouterr().out
    assert "conflict" in printed
    assert "failed: no gait found in 12 iterations; missed at the best point found: " in printed
    assert out.read_bytes() == good
    again = ["--speeds", *map(str, range(-4, 5)), *failing[2:]]
    monkeypatch.setattr(optimize_gaits, "find", failed)
    assert optimize_gaits.main(again) == 1
    assert capsys.readouterr().out.count("vx +4.00 m/s") == 1
    assert optimize_gaits.main([*again, "--resume"]) == 1
    assert "no gait for vx +4.00 m/s: it fell" in capsys.readouterr().out


def failed(requests, executor, done):
    """`find` that finds nothing."""
    yield from (library.Result(request, None, None, "it fell") for request in requests)


def test_without_a_cluster_no_file_is_begun(tmp_path, monkeypatch):
    monkeypatch.setattr(optimize_gaits, "CONNECT_TIMEOUT", 0.5)
    words = ["--speeds", "0", "--out", str(tmp_path / "gaits.json")]
    assert optimize_gaits.main([*words, "--scheduler", "tcp://127.0.0.1:1"]) == 2
    assert list(tmp_path.iterdir()) == []


def test_a_file_of_another_kind_is_refused(tmp_path, capsys):
    assert optimize_gaits.main(["--speeds", "0", "--out", str(tmp_path / "gaits.txt")]) == 2
    assert "gaits.txt ends neither in .json nor in .json.gz" in capsys.readouterr().err


def killed_after(count):
    """`find` that is interrupted after some results."""

    def find(*arguments):
        for i, result in enumerate(library.find(*arguments)):
            if i == count:
                raise KeyboardInterrupt
            yield result

    return find


def test_a_killed_run_goes_on_where_it_was(tmp_path, capsys, monkeypatch):
    out = tmp_path / "gaits.json"
    arguments = ["--speeds", "0", "0.1", "--jobs", "1", "--out", str(out)]
    with monkeypatch.context() as patch:
        patch.setattr(optimize_gaits, "find", killed_after(1))
        assert optimize_gaits.main(arguments) == 130
    assert not out.exists()
    partial = tmp_path / "gaits.json.partial"
    partial.write_text(partial.read_text() + '{"request": {"vx": 0.1, "cut o')
    assert optimize_gaits.main([*arguments, "--resume"]) == 0
    printed = capsys.readouterr().out
    assert "1 of 2 taken over" in printed
    assert printed.count("iterations") == 2
    assert [gait.vx for gait in load_certified(out).gaits] == [0.0, 0.1]
    assert not partial.exists()


def test_a_cluster_finds_the_same_gaits(tmp_path, capsys, monkeypatch):
    local, remote = tmp_path / "local.json", tmp_path / "remote.json"
    arguments = ["--speeds", "0", "0.1", "--jobs", "1", "--out"]
    assert optimize_gaits.main([*arguments, str(local)]) == 0
    kind = {"processes": False, "threads_per_worker": 1, "dashboard_address": None}
    with LocalCluster(n_workers=1, **kind) as cluster:
        scheduler = ["--scheduler", cluster.scheduler_address]
        assert optimize_gaits.main([*arguments, str(remote), *scheduler]) == 0
    for one, other in zip(load_certified(local).gaits, load_certified(remote).gaits, strict=True):
        assert one.vx == other.vx
        np.testing.assert_allclose(one.coefficients, other.coefficients, rtol=0.0, atol=1e-9)
    monkeypatch.setattr(optimize_gaits, "CONNECT_TIMEOUT", 0.5)
    with LocalCluster(n_workers=0, **kind) as cluster:
        scheduler = ["--scheduler", cluster.scheduler_address]
        assert optimize_gaits.main([*arguments, str(remote), *scheduler]) == 2
    assert "no worker within 0.5 s" in capsys.readouterr().err


def test_a_folder_in_the_place_of_the_file_is_told_before_the_search(capsys, tmp_path):
    assert optimize_gaits.main(["--speeds", "0", "--out", str(tmp_path)]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert "is a folder, expected a file" in printed.err


def fails_at_a_tenth(request, near=None):
    found = solution.solve(request, near)
    return replace(found, gait=None) if request.vx == 0.1 else found


def test_a_share_of_holes_can_be_allowed(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(library, "solve", fails_at_a_tenth)
    out = tmp_path / "gaits.json.gz"
    arguments = ["--speeds", "0", "0.1", "--jobs", "1", "--out", str(out)]
    assert optimize_gaits.main(arguments) == 1
    assert optimize_gaits.main([*arguments, "--holes", "0.5"]) == 0
    assert len(load_certified(out).gaits) == 1
    out.write_bytes(out.read_bytes()[:-100])
    with pytest.raises(GaitLibraryError, match="damaged or half written"):
        load_certified(out)


def test_plots_are_drawn_with_a_table(tmp_path, capsys):
    assert plot_gaits.main([str(OPTIMIZED), "--out", str(tmp_path)]) == 0
    drawn = {path.stem for path in tmp_path.glob("*.png")}
    assert drawn == {
        *("outputs", "strips", "torques", "clearance", "friction", "cost_of_transport")
    }
    table = capsys.readouterr().out
    assert table.count(" of stance ") == len(optimize_gaits.SPEEDS)
    assert plot_gaits.main([str(tmp_path / "nothing.json")]) == 2


def test_the_progress_of_plots_is_shown_on_a_terminal_only(tmp_path, capsys, monkeypatch):
    gait = load_library(OPTIMIZED).gaits[0]
    monkeypatch.setattr(plot_gaits, "motion", gait_motion_that_breaks)
    words = [str(OPTIMIZED), "--out", str(tmp_path)]
    assert plot_gaits.main(words) == 2
    assert capsys.readouterr().err == f"plot_gaits: error: the gait of {gait.speeds}: it broke\n"
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    assert plot_gaits.main(words) == 2
    assert "\r1 of 7 gaits" in capsys.readouterr().err


def gait_motion_that_breaks(gait):
    raise GaitLibraryError("it broke")


def test_labels_of_rates_and_holes_of_the_maps_can_be_read():
    gaits = [gait for gait in load_library(library_path("dense")).gaits if gait.vx == 0.0]
    figure = grid_figure(gaits[:-1])
    assert "0 rad/s" in [axes.get_title(loc="left") for axes in figure.axes]
    assert (
        figure.get_suptitle() == f"{len(gaits) - 1} gaits by turning rate; orange: 1 without a gait"
    )
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert "farthest neighbour,\ntimes the median\nof its direction" in labels


def test_a_grid_gets_maps_and_slices(tmp_path):
    dense = load_library(library_path("dense"))
    few = [g for g in dense.gaits if g.vx in (0.0, 0.5) and abs(g.vy) < 0.2]
    path = tmp_path / "few.json"
    save_library(replace(dense, gaits=tuple(few)), path)
    assert plot_gaits.main([str(path)]) == 0
    drawn = {picture.stem for picture in (tmp_path / "few_pictures").glob("*.png")}
    assert {"grid", "outputs_vy", "outputs_yaw_rate", "torques"} <= drawn


@pytest.mark.parametrize("turns", [1, 7])
def test_labels_of_the_maps_are_no_longer_than_their_colour_bars(turns):
    gaits = [
        g for g in load_library(library_path("dense")).gaits if abs(g.yaw_rate) <= 0.15 * turns
    ]
    figure = grid_figure(gaits)
    figure.draw_without_rendering()
    bars = [axes for axes in figure.axes if axes.get_label() == "<colorbar>"]
    assert len(bars) == 5
    for bar in bars:
        label, inside = bar.yaxis.label.get_window_extent(), bar.get_window_extent()
        assert inside.y0 <= label.y0 and label.y1 <= inside.y1, bar.get_ylabel()
        ticks = bar.yaxis.get_tightbbox()
        assert ticks.x1 <= figure.bbox.x1


@pytest.mark.parametrize(
    "arguments",
    [
        ["--jobs", "0"],
        ["--holes", "1"],
        ["--speeds", "nan"],
        ["--slope", "0.1", "--yaw-rate", "0.2"],
    ],
)
def test_impossible_options_are_refused(arguments, tmp_path, capsys):
    assert optimize_gaits.main([*arguments, "--out", str(tmp_path / "x.json")]) == 2
    assert "error" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "both"),
    [
        (["--grid", "--speeds", "0.3"], ("--grid", "--speeds")),
        (["--grid", "--lateral", "0"], ("--grid", "--lateral")),
        (["--yaw-rate", "0.1", "--grid"], ("--grid", "--yaw-rate")),
        (["--grid", "--holes", "0"], ("--grid", "--holes")),
        (["--table-only", "--landing-speed", "0.3"], ("--table-only", "--landing-speed")),
        (["--torso-roll", "0.1", "--table-only"], ("--table-only", "--torso-roll")),
        (["--import", "a.mat", "--speeds", "0.3"], ("--import", "--speeds")),
        (["--import", "a.mat", "--grid"], ("--import", "--grid")),
        (["--import", "a.mat", "--step-time", "0.4"], ("--import", "--step-time")),
        (["--import", "a.mat", "--jobs", "2"], ("--import", "--jobs")),
    ],
)
def test_options_that_contradict_each_other_are_refused(arguments, both, tmp_path, capsys):
    assert optimize_gaits.main([*arguments, "--out", str(tmp_path / "x.json")]) == 2
    printed = capsys.readouterr()
    assert printed.out == "" and printed.err.count("\n") == 1
    assert all(option in printed.err for option in both)


def test_check_prints_the_table_and_fails_on_a_miss(tmp_path, capsys):
    def raise_the_bar(document):
        document["gaits"] = document["gaits"][:1]
        document["gaits"][0]["solver"]["request"]["clearance"] = 0.3

    assert check_gaits.main([str(changed(tmp_path, raise_the_bar)), "--jobs", "1"]) == 1
    printed = capsys.readouterr().out
    assert "MISS" in printed
    assert "friction cone" in printed


BACK, FAST = [-1.3, -1.2, -1.1], [1.9, 2.0]  # straight gaits beyond the grid


def test_the_dense_library_is_certified_and_nearly_full():
    dense = load_certified(library_path("dense"))
    grid = optimize_gaits.DENSE
    assert dense.axes == ([*BACK, *grid["speeds"], *FAST], grid["lateral"], grid["yaw_rate"])
    count = len(BACK) + len(FAST) + 0.97 * np.prod([len(axis) for axis in list(grid.values())[:3]])
    assert len(dense.gaits) >= count


@pytest.mark.parametrize("at", [3, 501, 740, 1100, 1410])
def test_gaits_of_the_dense_library_pass_the_check_again(at):
    gait = load_library(library_path("dense")).gaits[at]
    assert [row.name for row in certify(gait).rows if not row.met] == []


def test_in_the_dense_library_left_and_right_are_alike():
    dense = load_library(library_path("dense"))
    by_speeds = {(gait.vx, gait.vy, gait.yaw_rate): gait.cost for gait in dense.gaits}
    pairs = [
        (cost, by_speeds[vx, -vy, -turn])
        for (vx, vy, turn), cost in by_speeds.items()
        if (vx, -vy, -turn) in by_speeds
    ]
    ratios = [max(pair) / min(pair) for pair in pairs]
    assert np.median(ratios) < 1.002
    assert np.quantile(ratios, 0.99) < 1.01


def test_a_library_is_found_by_its_name_or_its_path():
    assert library_path("optimized") == OPTIMIZED
    assert library_path("dense") == default_library_path() == OPTIMIZED.with_name("dense.json.gz")
    assert library_path("some/where.json") == Path("some/where.json")
