"""Distances between neighbours: known answers, and a gait in another optimum is named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cassie_gaits.gait_library_file import library_path, load_library
from cassie_gaits.neighbours import greatest, pairs, report
from cassie_gaits.ros import check_gaits

FIRST = load_library(library_path("optimized")).gaits[0]


def grid(jump=0.0):
    """Gaits on 4 by 3 speeds whose coefficients grow by 0.01 with each step ahead, 0.02 aside."""
    gaits = []
    for i in range(4):
        for j in range(3):
            change = 0.01 * i + 0.02 * j + (jump if (i, j) == (2, 1) else 0.0)
            moved = FIRST.coefficients + change
            speeds = {"vx": 0.1 * i, "vy": 0.1 * j, "coefficients": moved, "certificate": None}
            gaits.append(replace(FIRST, **speeds))
    return gaits


def test_distances_are_those_of_the_coefficients():
    found = pairs(grid())
    ahead = [pair.distance for pair in found if pair.axis == "vx"]
    aside = [pair.distance for pair in found if pair.axis == "vy"]
    assert len(ahead) == 3 * 3 and len(aside) == 4 * 2
    np.testing.assert_allclose(ahead, 0.01)
    np.testing.assert_allclose(aside, 0.02)


def test_neighbours_of_a_hole_are_left_out():
    gaits = [gait for gait in grid() if (gait.vx, gait.vy) != (0.1, 0.1)]
    assert len(pairs(gaits)) == 17 - 4


def test_a_gait_in_another_optimum_stands_out():
    gaits = grid(jump=0.1)
    apart = greatest(gaits)
    assert max(apart.values()) == pytest.approx(11.0)
    assert apart[0.2, 0.1, 0.0] == pytest.approx(11.0)
    assert apart[0.0, 0.0, 0.0] == pytest.approx(1.0)
    text = report(gaits)
    assert "11.0 times the median of vx: 0.1, 0.1 m/s" in text
    assert "times the median" not in report(grid())


def named(text):
    return text.count(" times the median of ")


def test_the_report_says_how_many_pairs_are_far_apart_and_how_many_it_shows():
    gaits = grid(jump=0.1)
    text = report(gaits, most=1)
    ahead = "vx: 2 pairs at more than 2 times the median (vx 0.1 .. 0.3 m/s), the 1 farthest shown:"
    assert ahead in text
    aside = "vy: 2 pairs at more than 2 times the median (vy 0 .. 0.2 m/s), the 1 farthest shown:"
    assert aside in text
    assert named(text) == 2
    text = report(gaits, most=None)
    assert text.count("all shown:") == 2
    assert named(text) == 4


def test_all_pairs_of_the_dense_library_are_shown_on_request(capsys):
    assert check_gaits.main(["dense", "--neighbours"]) == 0
    some = capsys.readouterr().out
    assert check_gaits.main(["dense", "--neighbours", "--all"]) == 0
    every = capsys.readouterr().out
    counts = {
        line.split(":")[0]: int(line.split()[1]) for line in every.splitlines() if "shown:" in line
    }
    assert named(every) == sum(counts.values()) > named(some)
    assert named(some) == sum(min(10, count) for count in counts.values())
    assert check_gaits.main(["dense", "--all"]) == 2
    assert "--all needs --neighbours" in capsys.readouterr().err


def test_the_command_tells_of_a_library(capsys):
    assert check_gaits.main([str(library_path("optimized")), "--neighbours"]) == 0
    assert "neighbours in" in capsys.readouterr().out
