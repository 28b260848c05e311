"""Import of FROST-style libraries: round trip, sign of leg pitch, refusals in one line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

import cassie_gaits
from cassie_gaits import bezier, virtual_leg
from cassie_gaits.errors import GaitLibraryError
from cassie_gaits.gait_library import OUTPUTS
from cassie_gaits.gait_library_file import load_certified, load_library
from cassie_gaits.mat_import import import_mat
from cassie_gaits.ros import optimize_gaits

LIBRARY = load_library(Path(cassie_gaits.__file__).parent / "libraries" / "optimized.json")
KEPT = ["stance_hip_yaw", "stance_leg_length", "swing_leg_roll", "swing_hip_yaw"]
KEPT += ["swing_leg_pitch", "swing_leg_length"]


def alpha(coefficients, stance):
    """Our outputs as a FROST-style (10, 6); a level foot's toe angle, fitted."""
    row = dict(zip(OUTPUTS, coefficients, strict=True))
    phases = np.linspace(0.0, 1.0, 41)
    basis = np.array([bezier.basis(phase)[:, 0] for phase in phases])
    curves = np.array([row["swing_leg_pitch"], row["swing_leg_length"]])
    toes = [
        virtual_leg.toe_angle(0.0, 0.0, virtual_leg.hip_pitch_angle(pitch, 0.0, length))
        for pitch, length in (basis @ curves.T).tolist()
    ]
    toe = np.linalg.lstsq(basis, np.array(toes), rcond=None)[0]
    st = [np.zeros(6), row["stance_hip_yaw"], np.zeros(6), row["stance_leg_length"], np.zeros(6)]
    sw = [row["swing_leg_roll"], row["swing_hip_yaw"], *curves, toe]
    return np.array([*sw, *st] if stance == "right" else [*st, *sw])


def content(sign=1.0):
    stances = {}
    for i, name in enumerate(("right", "left")):
        halpha = np.array([alpha(gait.coefficients[i], name) for gait in LIBRARY.gaits])
        halpha[:, [2, 7]] *= sign
        stances[name] = {"HAlpha": halpha}
    speeds = np.array([[gait.vx for gait in LIBRARY.gaits], [0.0] * len(LIBRARY.gaits)])
    return {
        "RightStance": stances["right"],
        "LeftStance": stances["left"],
        "ct": np.full((1, len(LIBRARY.gaits)), 2.5),
        "Velocity": speeds,
    }


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


def damaged(change):
    found = content()
    change(found)
    return found


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda c: c.pop("ct"), "it has no ct"),
        (lambda c: c.pop("LeftStance"), "it has no LeftStance.HAlpha"),
        (lambda c: c.update(ct=np.full(3, 2.5)), "ct has 3 entries, Velocity 7"),
        (lambda c: c.update(ct=np.zeros(7)), "ct is 0 .. 0, expected"),
        (lambda c: c["RightStance"].update(HAlpha=np.zeros((7, 9, 6))), "shape"),
        (lambda c: c["RightStance"]["HAlpha"].__setitem__((0, 0, 0), np.nan), "not finite"),
        (lambda c: c["LeftStance"]["HAlpha"].__imul__(10.0), "leg lengths"),
        (lambda c: c["RightStance"].update(HAlpha="text"), "not a number"),
        (lambda c: c["LeftStance"]["HAlpha"].__setitem__((slice(None), 9), 1.0), "foot pitches"),
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


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(GaitLibraryError, match=r"nowhere\.mat: No such file"):
        import_mat(tmp_path / "nowhere.mat")
