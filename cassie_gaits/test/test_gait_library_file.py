"""Gait library file: round trip, whole or not at all, every kind of damage refused in one line."""

from __future__ import annotations

import json
import math
import os

import numpy as np
import pytest

from cassie_gaits.errors import GaitLibraryError
from cassie_gaits.gait_library import Gait, GaitLibrary, Provenance
from cassie_gaits.gait_library_file import library_path, load_library, save_library

RNG = np.random.default_rng(4)


def full_library() -> GaitLibrary:
    gaits = tuple(
        Gait(
            vx, 0.1, -0.2, 0.4, RNG.normal(size=(2, 9, 6)), RNG.normal(size=(2, 10, 6)), 12.5,
            {"status": "solved", "iterations": 71}, {"floquet": 0.6},
        )
        for vx in (-0.5, 0.25)
    )  # fmt: skip
    provenance = Provenance("test", "1", "2025-01-31", {"friction": 0.6})
    return GaitLibrary(gaits, "optimized", "0123456789abcdef", provenance)


def test_round_trip_keeps_every_bit(tmp_path):
    library = full_library()
    save_library(library, tmp_path / "library.json")
    back = load_library(tmp_path / "library.json")
    assert (back.kind, back.model_hash, back.robot) == ("optimized", "0123456789abcdef", "cassie")
    assert back.provenance == library.provenance
    for before, after in zip(library.gaits, back.gaits, strict=True):
        np.testing.assert_array_equal(after.coefficients, before.coefficients)
        np.testing.assert_array_equal(after.torques, before.torques)
        for name in ("vx", "vy", "yaw_rate", "step_time", "cost", "solver", "certificate"):
            assert getattr(after, name) == getattr(before, name)


def test_saving_what_is_no_json_keeps_the_old_file(tmp_path):
    path = tmp_path / "library.json"
    save_library(full_library(), path)
    old = path.read_bytes()
    bad = Gait(0.0, 0.0, 0.0, 0.4, np.zeros((2, 9, 6)), solver={"cost": math.nan})
    library = GaitLibrary((bad,), "optimized", "x", Provenance("test", "1", "2025-01-31"))
    with pytest.raises(GaitLibraryError, match=r"library\.json"):
        save_library(library, path)
    assert path.read_bytes() == old
    assert [entry.name for entry in tmp_path.iterdir()] == ["library.json"]


def test_saving_where_nothing_can_be_written_is_refused(tmp_path):
    with pytest.raises(GaitLibraryError, match="No such file"):
        save_library(full_library(), tmp_path / "missing" / "library.json")


def test_a_link_stays_and_what_is_no_file_is_refused(tmp_path):
    path, link, pipe = (tmp_path / name for name in ("library.json", "link.json", "pipe"))
    path.write_text("old")
    link.symlink_to(path)
    save_library(full_library(), link)
    assert link.is_symlink() and len(load_library(path).gaits) == 2
    os.mkfifo(pipe)
    with pytest.raises(GaitLibraryError, match="pipe: it is no regular file"):
        save_library(full_library(), pipe)
    assert pipe.is_fifo()
    assert {entry.name for entry in tmp_path.iterdir()} == {"library.json", "link.json", "pipe"}


def refusal(path) -> str:
    with pytest.raises(GaitLibraryError) as caught:
        load_library(path)
    text = str(caught.value)
    assert "\n" not in text
    assert str(path) in text
    return text


def test_missing_file_and_folder_are_refused(tmp_path):
    assert "No such file" in refusal(tmp_path / "none.json")
    assert "directory" in refusal(tmp_path)


def test_half_written_file_is_refused_wherever_it_ends(tmp_path):
    path = tmp_path / "library.json"
    save_library(full_library(), path)
    whole = path.read_bytes()
    for end in np.linspace(0, len(whole) - 3, 60).astype(int):
        path.write_bytes(whole[:end])
        refusal(path)


def test_bytes_that_are_no_text_are_refused(tmp_path):
    path = tmp_path / "library.json"
    path.write_bytes(b"\xff\xfe\x00\x01" * 20)
    assert "UTF-8" in refusal(path)


def _set(document, keys, value):
    for key in keys[:-1]:
        document = document[key]
    document[keys[-1]] = value


@pytest.mark.parametrize(
    ("keys", "value", "message"),
    [
        (["schema_version"], 2, "schema_version is 2, expected 1"),
        (["kind"], "guessed", "kind is 'guessed'"),
        (["model_hash"], "", "model_hash"),
        (["robot"], 7, "robot is 7"),
        (["extra"], 1, "unknown 'extra'"),
        (["outputs", 0], "roll", "outputs are"),
        (["provenance"], [], "provenance is no JSON object"),
        (["provenance", "date"], None, "date is None"),
        (["gaits"], [], "no gait"),
        (["gaits"], {}, "gaits is no list"),
        (["gaits", 0], 3, r"gaits\[0\]: the entry"),
        (["gaits", 0, "vx"], 0.25, "rising"),
        (["gaits", 1, "vx"], math.nan, "NaN"),
        (["gaits", 1, "vy"], True, r"gaits\[1\]: vy is True"),
        (["gaits", 0, "step_time"], "0.4", r"gaits\[0\]: step_time is '0.4'"),
        (["gaits", 0, "step_time"], -0.4, r"gaits\[0\]: step_time is -0.4"),
        (["gaits", 0, "coefficients", "right_stance"], [], "unequal length"),
        (["gaits", 0, "coefficients", "right_stance", 3], [0.0] * 5, "unequal length"),
        (["gaits", 0, "coefficients", "right_stance", 3, 2], None, "not a number"),
        (["gaits", 0, "coefficients", "left_stance", 8, 5], math.inf, "Infinity"),
        (["gaits", 0, "torques"], {"right_stance": []}, "lacks left_stance"),
        (["gaits", 0, "cost"], "cheap", "cost is 'cheap'"),
    ],
)
def test_damage_is_refused_by_name(tmp_path, keys, value, message):
    path = tmp_path / "library.json"
    save_library(full_library(), path)
    document = json.loads(path.read_text())
    _set(document, keys, value)
    path.write_text(json.dumps(document))
    with pytest.raises(GaitLibraryError, match=message):
        load_library(path)
    refusal(path)


@pytest.mark.parametrize("text", ["[]", "3", "null", '{"schema_version": 1}', "{}", "[" * 100_000])
def test_json_of_another_kind_is_refused(tmp_path, text):
    path = tmp_path / "library.json"
    path.write_text(text)
    refusal(path)


@pytest.mark.parametrize("number", ["1e999", "1" * 400, "1" * 5000])
def test_number_too_large_for_a_float_is_refused(tmp_path, number):
    path = tmp_path / "library.json"
    save_library(full_library(), path)
    path.write_text(path.read_text().replace('"vx": 0.25', f'"vx": {number}'))
    refusal(path)


def test_library_of_the_package_loads():
    assert load_library(library_path("optimized")).kind == "optimized"
