"""Import of a gait library from a file of the MATLAB tools around FROST.

The file contains, at its top level or in one struct of any name:

    RightStance.HAlpha, LeftStance.HAlpha   [n, 10, 6]  Bezier coefficients of n gaits
    ct                                      [n]         1 / step time in 1/s; also in RightStance
    Velocity                                [n] or [k, n]  sagittal speeds in the first row, m/s

Rows of HAlpha: hip roll, hip yaw, leg pitch, leg length, toe of the left leg, then of the right,
with the torso upright. Angles are those of this project (`virtual_leg`), with roll and yaw positive
to the left, and q7 for the toe. Leg pitch may have either sign; the motion of the swing legs at
speed decides which. Values that such a file does not have are zero (torso) or missing (torques,
passive motion). The library is not certified.
"""

from __future__ import annotations

import datetime
import io
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cassie_gaits import bezier, virtual_leg
from cassie_gaits.errors import CassieError, GaitLibraryError
from cassie_gaits.gait_library import OUTPUTS, STANCES, Gait, GaitLibrary, Provenance
from cassie_gaits.json_file import read_bounded
from cassie_gaits.model_hash import model_hash

FloatArray = npt.NDArray[np.float64]

HIP_ROLL, HIP_YAW, LEG_PITCH, LEG_LENGTH, TOE = range(5)
_FIELDS = {"right_stance": "RightStance", "left_stance": "LeftStance"}
_STEEP = 0.5
_SAMPLES = 41


def import_mat(path: Path) -> GaitLibrary:
    """Read a library.

    Raises:
        GaitLibraryError: if the file is missing or damaged, or its content is not of the shape
            above, not finite, or no gait of Cassie; one line with the file's name and the reason.
    """
    try:
        content = _content(path)
        speeds, times = _row(content, "Velocity"), 1.0 / _row(content, "ct")
        stances = [_alpha(content, _FIELDS[stance], len(speeds)) for stance in STANCES]
        if len(times) != len(speeds):
            raise GaitLibraryError(f"ct has {len(times)} entries, Velocity {len(speeds)}")
        sign = _leg_pitch_sign(speeds, stances[0])
        gaits = []
        for i in np.argsort(speeds):
            pair = [_outputs(alpha[i], s, sign) for s, alpha in enumerate(stances)]
            gaits.append(Gait(float(speeds[i]), 0.0, 0.0, float(times[i]), np.array(pair)))
        settings = {"file": path.name, "leg_pitch_sign": sign}
        today = datetime.date.today().isoformat()
        provenance = Provenance("cassie_gaits.optimize_gaits --import", "1", today, settings)
        return GaitLibrary(tuple(gaits), "imported", model_hash(), provenance)
    except CassieError as error:
        raise GaitLibraryError(f"{path}: {error}") from None


def _content(path: Path) -> dict[str, Any]:
    from scipy.io import loadmat

    try:
        raw = read_bounded(path)
    except OSError as error:
        raise GaitLibraryError(error.strerror or str(error)) from None
    try:
        found = loadmat(io.BytesIO(raw), squeeze_me=False, struct_as_record=True)
    except NotImplementedError:
        raise GaitLibraryError("it is a MATLAB 7.3 file; save it with -v7") from None
    except Exception as error:  # scipy's reader raises many kinds of errors on damaged files
        reason = " ".join(str(error).split()) or type(error).__name__
        raise GaitLibraryError(f"it is no MATLAB file, or damaged: {reason}") from None
    top = {name: value for name, value in found.items() if not name.startswith("__")}
    for candidate in (top, *(_struct(value) for value in top.values())):
        if _FIELDS["right_stance"] in candidate:
            return candidate
    raise GaitLibraryError(f"it has no RightStance; it has {', '.join(sorted(top)) or 'nothing'}")


def _struct(value: Any) -> dict[str, Any]:
    """Fields of a MATLAB struct; empty for anything else."""
    if not isinstance(value, np.ndarray) or value.dtype.names is None or value.size != 1:
        return {}
    return {name: value.ravel()[0][name] for name in value.dtype.names}


def _numbers(value: Any, name: str) -> FloatArray:
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "iuf":
        raise GaitLibraryError(f"{name} holds something that is not a number")
    array = np.array(value, dtype=np.float64)
    if not np.isfinite(array).all():
        raise GaitLibraryError(f"{name} holds a number that is not finite")
    return array


def _row(content: dict[str, Any], name: str) -> FloatArray:
    """The first row of a field of the library, or of its right stance. Shape (n,)."""
    stance = _struct(content[_FIELDS["right_stance"]])
    value = content.get(name, stance.get(name))
    if value is None:
        raise GaitLibraryError(f"it has no {name}")
    array = _numbers(value, name)
    row = array.ravel() if array.ndim < 2 or 1 in array.shape else array[0]
    if row.size == 0 or array.ndim > 2:
        raise GaitLibraryError(f"{name} has shape {array.shape}, expected n speeds")
    if name == "ct" and not bool(((row >= 0.2) & (row <= 20.0)).all()):
        raise GaitLibraryError(f"ct is {row.min():g} .. {row.max():g}, expected 0.2 .. 20 1/s")
    return row


def _alpha(content: dict[str, Any], stance: str, count: int) -> FloatArray:
    fields = _struct(content.get(stance))
    if "HAlpha" not in fields:
        raise GaitLibraryError(f"it has no {stance}.HAlpha")
    alpha = _numbers(fields["HAlpha"], f"{stance}.HAlpha")
    shape = (count, 10, bezier.COEFFICIENTS)
    if alpha.shape != shape:
        raise GaitLibraryError(f"{stance}.HAlpha has shape {alpha.shape}, expected {shape}")
    lengths = alpha[:, LEG_LENGTH::5]
    if not virtual_leg.SHORTEST < lengths.min() <= lengths.max() < virtual_leg.LONGEST:
        raise GaitLibraryError(
            f"{stance}.HAlpha has leg lengths of {lengths.min():g} .. {lengths.max():g} m, "
            f"expected {virtual_leg.SHORTEST:.3g} .. {virtual_leg.LONGEST:.4g} m"
        )
    return alpha


def _leg_pitch_sign(speeds: FloatArray, right_stance: FloatArray) -> float:
    """+1 if leg pitch > 0 puts the toe in front, else -1: the left leg swings along the speed."""
    sweep = right_stance[:, LEG_PITCH, -1] - right_stance[:, LEG_PITCH, 0]
    return -1.0 if float(sweep @ speeds) < 0.0 else 1.0


def _outputs(alpha: FloatArray, stance: int, sign: float) -> FloatArray:
    """The nine outputs of a step on the right leg (0) or the left one (1). Shape (9, 6)."""
    left, right = alpha[:5], alpha[5:]
    st, sw = (left, right) if stance else (right, left)
    rows = dict.fromkeys(OUTPUTS, np.zeros(bezier.COEFFICIENTS))
    rows |= {
        "stance_hip_yaw": st[HIP_YAW],
        "stance_leg_length": st[LEG_LENGTH],
        "swing_leg_roll": sw[HIP_ROLL],
        "swing_hip_yaw": sw[HIP_YAW],
        "swing_leg_pitch": sign * sw[LEG_PITCH],
        "swing_leg_length": sw[LEG_LENGTH],
        "swing_foot_pitch": _foot_pitch(sign * sw[LEG_PITCH], sw[LEG_LENGTH], sw[TOE]),
    }
    return np.array([rows[name] for name in OUTPUTS])


def _foot_pitch(leg_pitch: FloatArray, length: FloatArray, toe: FloatArray) -> FloatArray:
    """Coefficients of the foot's pitch, by least squares from those of the toe joint. (6,)."""
    curves = np.array([leg_pitch, length, toe])
    basis = np.array([bezier.basis(phase)[:, 0] for phase in np.linspace(0.0, 1.0, _SAMPLES)])
    values = [
        virtual_leg.foot_pitch(0.0, virtual_leg.hip_pitch_angle(pitch, 0.0, reach), angle)
        for pitch, reach, angle in (basis @ curves.T).tolist()
    ]
    if max(map(abs, values)) > _STEEP:
        raise GaitLibraryError(
            f"the swing foot pitches by {max(map(abs, values)):.2g} rad, expected at most "
            f"{_STEEP}: its row is not the toe joint's angle"
        )
    fitted: FloatArray = np.linalg.lstsq(basis, np.array(values), rcond=None)[0]
    return fitted
