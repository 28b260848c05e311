"""Import of FROST-style libraries: round trip, remarks, refusals in one line."""

from __future__ import annotations

import os
import signal
import time

import numpy as np
import pytest
from frost_file import LIBRARY, content
from scipy.io import savemat

from cassie_gaits import mat_reader
from cassie_gaits.errors import GaitLibraryError
from cassie_gaits.gait_library import OUTPUTS
from cassie_gaits.gait_library_file import load_certified, load_library
from cassie_gaits.mat_import import import_mat
from cassie_gaits.ros import optimize_gaits

KEPT = ["stance_hip_yaw", "stance_leg_length", "swing_leg_roll", "swing_hip_yaw"]
KEPT += ["swing_leg_pitch", "swing_leg_length"]


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("nested", [False, True])
def test_a_library_comes_back_but_for_torso_and_torques(tmp_path, sign, nested):
    path = tmp_path / "library.mat"
    savemat(path, {"GaitLibrary": content(sign)} if nested else content(sign))
    found = import_mat(path)
    assert found.kind == "imported"
    for gait, original in zip(found.gaits, LIBRARY.gaits, strict=True):
        assert (gait.vx, gait.step_time) == (original.vx, 0.4)
        for name in KEPT:
            i = OUTPUTS.index(name)
            np.testing.assert_allclose(
                gait.coefficients[:, i], original.coefficients[:, i], atol=1e-12
            )
        assert np.abs(gait.coefficients[:, OUTPUTS.index("swing_foot_pitch")]).max() < 0.02


def test_it_is_written_and_runs_only_uncertified(tmp_path):
    savemat(tmp_path / "library.mat", content())
    out = tmp_path / "imported.json"
    assert optimize_gaits.main(["--import", str(tmp_path / "library.mat"), "--out", str(out)]) == 0
    with pytest.raises(GaitLibraryError, match=r"the imported gait .* is not certified"):
        load_certified(out)
    assert len(load_certified(out, allow_uncertified=True).gaits) == len(LIBRARY.gaits)


def imported(tmp_path, found):
    savemat(tmp_path / "library.mat", found)
    return import_mat(tmp_path / "library.mat")


def remarks(library):
    return "\n".join(library.provenance.settings["remarks"])


def test_it_tells_what_is_missing_set_or_not_used(tmp_path, capsys):
    found = content(sign=-1.0)
    found["Velocity"][1] = 0.3
    found["RightStance"]["TorsoAngleAlpha"] = np.zeros((7, 3, 6))
    found["LeftStance"]["ct"] = np.full(7, 2.0)
    savemat(tmp_path / "library.mat", found)
    out = tmp_path / "imported.json"
    assert optimize_gaits.main(["--import", str(tmp_path / "library.mat"), "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith(f"7 gaits imported, not certified: {out}\n")
    for words in (
        "set to 0: torso roll, torso pitch, speed to the left, turning rate",
        "missing: torques, passive motion",
        "not used: hip roll, leg pitch and toe of the stance leg",
        "not used: row 2 of Velocity (0.3 .. 0.3)",
        "not used: RightStance.TorsoAngleAlpha",
        "not used: LeftStance.ct",
        "leg pitch: positive puts the toe behind the hip (as the legs swing at speed)",
    ):
        assert words in printed
    assert printed.replace("\n  ", "\n").splitlines()[1:] == remarks(load_library(out)).splitlines()


def one_gait(velocity):
    found = content()
    for stance in ("RightStance", "LeftStance"):
        found[stance]["HAlpha"] = found[stance]["HAlpha"][4:5]
    return {**found, "ct": 2.5, "Velocity": velocity}


@pytest.mark.parametrize(
    "velocity", [0.5, [0.5], [[0.5], [0.0]], [[0.5], [0.1], [0.2]]], ids=lambda v: str(np.shape(v))
)
def test_one_gait_is_a_library(tmp_path, velocity):
    library = imported(tmp_path, one_gait(np.array(velocity)))
    assert [gait.vx for gait in library.gaits] == [0.5]
    assert remarks(library).count("of Velocity") == np.size(velocity) - 1


@pytest.mark.parametrize("shape", [(7,), (1, 7), (7, 1), (3, 7)])
def test_speeds_stand_in_a_row_a_column_or_the_first_row(tmp_path, shape):
    found = content()
    speeds = found["Velocity"][0]
    found["Velocity"] = (
        np.resize(speeds, shape) if shape[0] != 3 else np.array([speeds, *[speeds * 0.1] * 2])
    )
    assert [gait.vx for gait in imported(tmp_path, found).gaits] == [g.vx for g in LIBRARY.gaits]


def test_it_tells_the_ranges_and_where_the_feet_land(tmp_path):
    found = remarks(imported(tmp_path, content())).splitlines()
    assert found[-4:] == [
        "hip roll: -0.0061 .. 0.025 rad in steps on the right leg, positive to the left",
        "hip yaw: -0.0033 .. 0.004 rad in steps on the right leg, positive to the left",
        "feet at touchdown: 0.26 .. 0.26 m apart sideways",
        "steps: -0.2 .. 0.4 m long; speed times step time is -0.2 .. 0.4 m",
    ]


def test_the_sign_of_leg_pitch_is_a_guess_without_speeds(tmp_path):
    assert "a guess, as every speed is 0" in remarks(imported(tmp_path, one_gait(0.0)))


def damaged(change):
    found = content()
    change(found)
    return found


def set_rows(found, rows, value):
    for stance in ("RightStance", "LeftStance"):
        found[stance]["HAlpha"][:, rows] = value


def in_degrees(found):
    for stance in ("RightStance", "LeftStance"):
        found[stance]["HAlpha"][:, [0, 1, 5, 6]] *= 180.0 / np.pi


def scaled(rows, factor):
    def change(found):
        for stance in ("RightStance", "LeftStance"):
            found[stance]["HAlpha"][:, rows] *= factor

    return change


def feet_crossed(found):
    for leg, row in ((0, 0), (1, 5)):
        stance = ("RightStance", "LeftStance")[leg]
        found[stance]["HAlpha"][:, row] += (-0.15, 0.15)[leg]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda c: c.pop("ct"), "it has no ct"),
        (lambda c: c.pop("LeftStance"), "it has no LeftStance.HAlpha"),
        (lambda c: c.update(ct=np.full(3, 2.5)), "ct has shape (1, 3), expected (k, 7)"),
        (lambda c: c.update(Velocity=np.zeros((7, 2))), "Velocity has shape (7, 2), expected"),
        (lambda c: c["LeftStance"].update(HAlpha=c["LeftStance"]["HAlpha"][:3]), "LeftStance 3"),
        (lambda c: c.update(ct=np.zeros(7)), "ct is 0 .. 0 1/s, expected"),
        (lambda c: c["RightStance"].update(HAlpha=np.zeros((7, 9, 6))), "shape"),
        (lambda c: c["RightStance"]["HAlpha"].__setitem__((0, 0, 0), np.nan), "not finite"),
        (lambda c: c["LeftStance"]["HAlpha"].__imul__(10.0), "leg lengths"),
        (lambda c: c["RightStance"].update(HAlpha="text"), "not a number"),
        (lambda c: c["LeftStance"]["HAlpha"].__setitem__((slice(None), 9), 1.0), "foot pitches"),
        (lambda c: set_rows(c, [0, 5], 1e5), "row 1 (left hip roll), is 1e+05 .. 1e+05 rad, exp"),
        (lambda c: set_rows(c, [6], -0.6), "row 7 (right hip yaw), is -0.6 .. -0.6 rad, expected"),
        (lambda c: set_rows(c, [2, 7], 50.0), "row 3 (left leg pitch), as hip pitch is 50"),
        (in_degrees, "HAlpha, row"),
        (scaled([1, 6], 180.0 / np.pi), "hip yaw is -0.19 .. 0.23 rad, expected at most 0.1 rad"),
        (scaled([5], -1.0), "hip roll of left and right leg: their sum is up to 0.05 rad"),
        (feet_crossed, "at touchdown the left foot, to the left of the right one, is -0.0"),
        (
            lambda c: c["Velocity"].__imul__(3.6),
            "the gait of -1.8 m/s with steps of 0.4 s has steps of -0.2 m, expected -1.4 .. -0.36",
        ),
        (
            lambda c: c["Velocity"].__imul__(1e6),
            "the first row of Velocity is -5e+05 .. 1e+06 m/s",
        ),
        (lambda c: c["Velocity"].__imul__(-6.0), "expected -5 .. 5 m/s"),
        (lambda c: c["Velocity"].__imul__(0.0), "the first row of Velocity has 7 gaits of 0 m/s"),
        (lambda c: c.update(ct=np.full(7, 0.4)), "ct is 0.4 .. 0.4 1/s, expected 0.6667 .. 20"),
    ],
)
def test_a_wrong_file_is_refused_with_the_reason(tmp_path, capsys, change, reason):
    path = tmp_path / "wrong.mat"
    savemat(path, damaged(change))
    out = tmp_path / "out.json"
    assert optimize_gaits.main(["--import", str(path), "--out", str(out)]) == 2
    error = capsys.readouterr().err
    assert reason in error and "wrong.mat" in error
    assert error.count("\n") == 1
    assert not out.exists()


@pytest.mark.parametrize("kept", [0, 60, 200, 3000])
def test_a_damaged_file_is_refused(tmp_path, kept):
    path = tmp_path / "cut.mat"
    savemat(path, content())
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(GaitLibraryError, match=r"cut\.mat: it"):
        import_mat(path)


CRASH = {109: 223, 855: 47, 5423: 33, 6900: 248, 7201: 171}
"""Bytes by offset with which scipy's reader ends in a segmentation fault."""


def test_a_file_that_crashes_the_reader_is_refused_in_one_line(tmp_path, capfd):
    path = tmp_path / "crash.mat"
    savemat(path, content())
    changed = bytearray(path.read_bytes())
    for offset, byte in CRASH.items():
        changed[offset] = byte
    path.write_bytes(changed)
    out = tmp_path / "out.json"
    assert optimize_gaits.main(["--import", str(path), "--out", str(out)]) == 2
    error = capfd.readouterr().err
    assert "crash.mat: it is" in error and "damaged" in error
    assert error.count("\n") == 1
    assert not out.exists()


def dies(raw):
    os.kill(os.getpid(), signal.SIGSEGV)


def hangs(raw):
    time.sleep(60.0)


def grows(raw):
    return bytes(2 * mat_reader.MOST_MEMORY)


@pytest.mark.parametrize(
    ("reader", "reason"),
    [(dies, "crashed"), (hangs, "not read within 0.5 s"), (grows, "does not fit into memory")],
)
def test_the_reader_s_death_time_and_memory_are_bounded(tmp_path, monkeypatch, reader, reason):
    monkeypatch.setattr(mat_reader, "_load", reader)
    monkeypatch.setattr(mat_reader, "MOST_TIME", 0.5)
    with pytest.raises(GaitLibraryError, match=rf"library\.mat: it is damaged.* {reason}"):
        imported(tmp_path, content())


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(GaitLibraryError, match=r"nowhere\.mat: No such file"):
        import_mat(tmp_path / "nowhere.mat")
