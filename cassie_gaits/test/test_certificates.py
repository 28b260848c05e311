"""What a certificate is tied to: any change of content, model or checker is refused in words."""

from __future__ import annotations

import gzip
import hashlib
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from changed_library import one_number, wild

import cassie_gaits
from cassie_gaits import robot
from cassie_gaits.certificate import seal
from cassie_gaits.certificate.seal import CHECKER_VERSION, gait_sha256
from cassie_gaits.errors import GaitLibraryError
from cassie_gaits.gait_library import Gait
from cassie_gaits.gait_library_file import (
    library_path,
    load_certified,
    load_library,
    save_library,
)
from cassie_gaits.model_hash import model_hash
from cassie_gaits.optimize.partial_file import PartialFile
from cassie_gaits.optimize.request import Request
from cassie_gaits.ros import check_gaits, plot_gaits

OPTIMIZED = library_path("optimized")
DOCUMENT = json.loads(OPTIMIZED.read_text())
FOLDER = Path(cassie_gaits.__file__).parent

CHECKER = sorted({*(FOLDER / "certificate").glob("*.py")} - {FOLDER / "certificate/seal.py"}) + [
    FOLDER / f"{name}.py"
    for name in ("dynamics", "linkage", "pinocchio_model", "vectors", "virtual_leg")
]
"""Sources of the checker. The numbers of the robot are in the model's hash instead."""

CHECKERS = {"1": "ffad721178622c12f34ebfd721534ea014ff662d38cb6305ebdb60256a5af2f6"}
"""SHA-256 of `CHECKER` by version."""


def refusal(path: Path) -> str:
    """Why a library is not loaded, in one line."""
    with pytest.raises(GaitLibraryError) as caught:
        load_certified(path)
    text = str(caught.value)
    assert text.startswith(f"gait library {path}: ")
    assert "\n" not in text
    assert len(text) < 400
    return text


def written(tmp_path: Path, document: object) -> Path:
    path = tmp_path / "changed.json"
    path.write_text(json.dumps(document))
    return path


def test_the_version_is_raised_when_the_checker_changes():
    """After a change of the checker's sources this fails.

    Can the checker find something else in the same gait? Then raise `seal.CHECKER_VERSION`, certify
    the libraries that come along (`check_gaits FILE --certify`) and put the new version in
    `CHECKERS`. Only where it cannot, as by other words in a docstring, put the new hash in the old
    version's place.
    """
    digest = hashlib.sha256(repr(robot.NEUTRAL_TARSUS).encode())
    for path in CHECKER:
        digest.update(path.read_bytes())
    assert CHECKERS[CHECKER_VERSION] == digest.hexdigest()


@pytest.mark.parametrize(("change", "count"), [(one_number, 40), (wild, 250)])
def test_any_change_of_a_certified_library_is_refused(tmp_path, change, count):
    rng = np.random.default_rng(19)
    drawn = [change(DOCUMENT, rng) for _ in range(count)]
    changed = [document for document in drawn if json.dumps(document) != json.dumps(DOCUMENT)]
    assert len(changed) > 0.95 * count
    for document in changed:
        refusal(written(tmp_path, document))


def test_the_least_change_of_the_largest_torque_is_told_with_its_gait(tmp_path):
    document = json.loads(OPTIMIZED.read_text())
    row = document["gaits"][4]["torques"]["left_stance"][3]
    at = int(np.argmax(np.abs(row)))
    row[at] = float(np.nextafter(row[at], np.inf))
    text = refusal(written(tmp_path, document))
    assert "gaits[4]: the optimized gait of 0.5 m/s differs from what was certified" in text


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: d.update(kind="imported"), "its head"),
        (lambda d: d["provenance"].update(date="2025-01-31"), "its head"),
        (lambda d: d["gaits"].pop(3), "its set of gaits"),
        (lambda d: d.pop("sha256"), "sha256"),
        (lambda d: d.update(robot="digit"), "robot 'digit'"),
        (
            lambda d: d.update(model_hash="0" * 16),
            "it is for model 0000000000000000, this robot is",
        ),
        (lambda d: d["gaits"][0]["certificate"].update(met=False), "m/s is not certified"),
        (lambda d: d["gaits"][0]["certificate"].pop("sha256"), "has a certificate without hash: "),
        (lambda d: d["gaits"][0]["certificate"].update(points=4), "differs from what was"),
        (
            lambda d: d["gaits"][0]["certificate"].update(model_hash="f"),
            "was certified for model 'f'",
        ),
        (
            lambda d: d["gaits"][0]["certificate"].update(checker="0"),
            "was certified by checker '0'",
        ),
        (lambda d: d["gaits"][0]["solver"].update(n=math.inf), "solver holds a number that is too"),
    ],
)
def test_what_differs_is_told(tmp_path, change, words):
    document = json.loads(OPTIMIZED.read_text())
    change(document)
    path = tmp_path / "changed.json"
    path.write_text(json.dumps(document).replace("Infinity", "1e999"))
    assert words in refusal(path)


def test_a_library_of_another_checker_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(seal, "CHECKER_VERSION", "next")
    assert f"was certified by checker '{CHECKER_VERSION}', this is 'next'" in refusal(OPTIMIZED)


def test_a_key_given_twice_is_refused(tmp_path):
    path = tmp_path / "twice.json"
    path.write_text(OPTIMIZED.read_text().replace('"vx": 0.25', '"vx": 9.0, "vx": 0.25', 1))
    assert "key 'vx' is given twice" in refusal(path)


def test_layout_and_compression_do_not_matter(tmp_path):
    library = load_certified(OPTIMIZED)
    save_library(library, tmp_path / "same.json.gz")
    again = load_certified(tmp_path / "same.json.gz")
    assert [gait_sha256(gait) for gait in again.gaits] == [
        gait.certificate["sha256"] for gait in library.gaits
    ]


def test_a_gait_changed_in_memory_is_refused_when_its_library_is_loaded(tmp_path):
    library = load_certified(OPTIMIZED)
    faster = replace(library.gaits[6], step_time=0.39)
    save_library(replace(library, gaits=(*library.gaits[:6], faster)), tmp_path / "faster.json")
    assert "gaits[6]" in refusal(tmp_path / "faster.json")


def test_the_canonical_form_is_the_one_that_is_written_down():
    """A known answer, put together by hand from the description in `seal`."""
    coefficients = np.arange(108.0).reshape(2, 9, 6)
    gait = Gait(0.5, 0.0, -0.0, 0.4, coefficients, solver={"b": 1e-7, "a": [1, "ü"]})
    text = (
        '{"certificate":null,"coefficients":[2,9,6],"cost":null,"passive":null,'
        '"solver":{"a":[1,"\\u00fc"],"b":1e-07},"step_time":0.4,"torques":null,'
        '"vx":0.5,"vy":0.0,"yaw_rate":-0.0}\n'
    )
    content = text.encode() + coefficients.astype("<f8").tobytes()
    assert gait_sha256(gait) == hashlib.sha256(content).hexdigest()


def test_check_certifies_a_file_anew_and_keeps_every_number(tmp_path, capsys):
    document = json.loads(OPTIMIZED.read_text())
    del document["sha256"]
    document["gaits"] = document["gaits"][:2]
    for gait in document["gaits"]:
        for key in ("sha256", "checker", "model_hash"):
            del gait["certificate"][key]
    path = written(tmp_path, document)
    assert check_gaits.main([str(path), "--jobs", "1"]) == 1
    assert "the certificates in the file do not hold: gait library" in capsys.readouterr().out
    assert check_gaits.main([str(path), "--jobs", "1", "--certify"]) == 0
    assert "the certificates in the file hold" in capsys.readouterr().out
    for before, after in zip(
        load_library(OPTIMIZED).gaits, load_certified(path).gaits, strict=False
    ):
        for name in ("coefficients", "torques", "passive"):
            np.testing.assert_array_equal(getattr(after, name), getattr(before, name))


def test_check_does_not_certify_a_gait_that_misses_a_row(tmp_path):
    document = json.loads(OPTIMIZED.read_text())
    document["gaits"] = document["gaits"][:2]
    document["gaits"][1]["solver"]["request"]["clearance"] = 0.3
    path = written(tmp_path, document)
    before = path.read_bytes()
    assert check_gaits.main([str(path), "--jobs", "1", "--certify"]) == 1
    assert path.read_bytes() == before


def two_gaits() -> dict:
    return {**DOCUMENT, "gaits": DOCUMENT["gaits"][2:4]}


@pytest.mark.parametrize("seed", range(12))
def test_check_answers_a_changed_library_in_words(tmp_path, capsys, seed):
    document = wild(two_gaits(), np.random.default_rng(seed))
    path = written(tmp_path, document)
    assert check_gaits.main([str(path), "--jobs", "1"]) in (1, 2)
    printed = capsys.readouterr()
    assert "Warning" not in printed.err
    assert printed.out or printed.err.count("\n") == 1


def _set(*keys):
    *path, last, value = keys

    def change(document):
        place = document["gaits"][0]
        for key in path:
            place = place[key]
        place[last] = value

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            _set("coefficients", "right_stance", 7, [1.2] * 6),
            "no posture at phase 0.000: leg length",
        ),
        (_set("coefficients", "right_stance", 3, [0.4] * 6), "MISS"),
        (_set("coefficients", "right_stance", 5, [100.0] * 6), "MISS"),
        (_set("torques", "right_stance", 3, [9329.0] * 29), "its motion leaves the robot's range"),
        (_set("torques", "right_stance", 3, [1e300] * 29), "cannot be checked: "),
        (_set("step_time", 0.05), "MISS"),
        (_set("step_time", 5.0), "cannot be checked: "),
        (_set("solver", "request", "slope", 1e300), "slope is 1e+300, expected -1 .. 1"),
        (_set("solver", "request", "clearance", True), "clearance is True, expected 0 .. 1"),
        (_set("solver", "request", "symmetric", "no"), "symmetric is 'no', expected true or false"),
        (_set("solver", "request", 3), "does not say its clearance"),
        (_set("passive", None), "no torques or no passive motion"),
    ],
)
def test_check_says_why_a_gait_cannot_be_checked(tmp_path, capsys, change, words):
    document = json.loads(json.dumps({**DOCUMENT, "gaits": DOCUMENT["gaits"][3:4]}))
    change(document)
    path = written(tmp_path, document)
    assert check_gaits.main([str(path), "--jobs", "1"]) == 1
    printed = capsys.readouterr()
    assert words in printed.out
    assert printed.err == ""


def test_plot_says_which_gait_breaks_off(tmp_path, capsys):
    document = json.loads(json.dumps({**DOCUMENT, "gaits": DOCUMENT["gaits"][3:4]}))
    _set("torques", "right_stance", 3, [9329.0] * 29)(document)
    assert plot_gaits.main([str(written(tmp_path, document)), "--out", str(tmp_path)]) == 2
    assert "the gait of 0.25 m/s: its motion leaves" in capsys.readouterr().err


def test_a_changed_gait_in_a_partial_file_is_refused(tmp_path):
    gait = load_certified(OPTIMIZED).gaits[3]
    request = Request(**gait.solver["request"])
    partial = PartialFile(tmp_path / "gaits.json")
    partial.begin({request: gait})
    assert list(partial.read([request])) == [request]
    text = partial.path.read_text()
    partial.path.write_text(text.replace('"step_time":0.4,"coeff', '"step_time":0.3,"coeff'))
    with pytest.raises(GaitLibraryError, match=r"0\.25 m/s differs from what was certified; begin"):
        partial.read([request])
    partial.path.write_text(text.replace('{"request":{"vx":0.25', '{"request":{"vx":0.3'))
    with pytest.raises(GaitLibraryError, match="is the answer to another request"):
        partial.read([replace(request, vx=0.3)])


@pytest.mark.parametrize("line", ["[" * 5000, '{"request": ' + "[" * 900 + "]" * 900 + "}", "7"])
def test_a_damaged_partial_file_is_refused(tmp_path, line):
    partial = PartialFile(tmp_path / "gaits.json")
    partial.path.write_text(json.dumps({"model_hash": model_hash()}) + f"\n{line}\n")
    with pytest.raises(GaitLibraryError, match="line 2 is damaged"):
        partial.read([])


@pytest.mark.parametrize("text", ["", '{"model_hash": "0123', "{}\n"])
def test_a_partial_file_whose_first_line_is_cut_is_damaged_not_of_another_robot(tmp_path, text):
    partial = PartialFile(tmp_path / "gaits.json")
    partial.path.write_text(text)
    with pytest.raises(GaitLibraryError, match=r"partial: line 1 is damaged; begin without --res"):
        partial.read([])
    partial.path.write_text('{"model_hash": "0123"}\n')
    with pytest.raises(GaitLibraryError, match="is for another model of the robot"):
        partial.read([])


def test_the_dense_library_is_small_and_as_its_command_writes_it(tmp_path):
    packaged, again = library_path("dense"), tmp_path / "again.json.gz"
    save_library(load_library(packaged), again)
    assert max(path.stat().st_size for path in (packaged, again)) < 5e6
    assert gzip.decompress(again.read_bytes()) == gzip.decompress(packaged.read_bytes())
