"""Import of FROST-style libraries: round trip, sign of leg pitch, refusals in one line."""

from __future__ import annotations

import numpy as np
import pytest
from frost_file import LIBRARY, content
from scipy.io import savemat

from cassie_gaits.errors import GaitLibraryError
from cassie_gaits.gait_library import OUTPUTS
from cassie_gaits.gait_library_file import load_certified
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
