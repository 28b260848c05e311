"""Import of a gait library from a file of the MATLAB tools around FROST.

The file contains, at its top level or in one struct of any name:

    RightStance.HAlpha, LeftStance.HAlpha   [n, 10, 6]  Bezier coefficients of n gaits
    ct                                      [n]         1 / step time in 1/s; also in RightStance
    Velocity                                [n] or [k, n]  sagittal speeds in the first row, m/s

Rows of HAlpha: hip roll, hip yaw, leg pitch, leg length, toe of the left leg, then of the right,
with the torso upright. Angles are those of this project (`virtual_leg`), with roll and yaw positive
to the left, and q7 for the toe. Leg pitch may have either sign; the motion of the swing legs at
speed decides which. Values that such a file does not have are zero (torso) or missing (torques,
passive motion). The library is not certified. Where the feet land, in the swing leg's values at the
end of a step, must fit the speed and the step time. What was set, derived or left out, and the
ranges found, stand in the library's settings as `remarks`.
"""

from __future__ import annotations

import datetime
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cassie_gaits import bezier, robot, virtual_leg
from cassie_gaits.errors import CassieError, GaitLibraryError
from cassie_gaits.gait_library import OUTPUTS, STANCES, Gait, GaitLibrary, Provenance
from cassie_gaits.mat_reader import USED, MatContent, read_mat
from cassie_gaits.model_hash import model_hash
from cassie_gaits.optimize.request import RANGES
from cassie_gaits.records import FloatArray

HIP_ROLL, HIP_YAW, LEG_PITCH, LEG_LENGTH, TOE = range(5)
_ROWS = ("hip roll", "hip yaw", "leg pitch", "leg length", "toe")
_LEGS = ("left", "right")
_FIELDS = {"right_stance": "RightStance", "left_stance": "LeftStance"}
_STEEP = 0.5

BEYOND_STOPS = 0.1
"""Angle by which a joint of an imported gait may be beyond the joint's stops. In rad."""

FEET_APART = (0.1, 0.5)
"""Least and largest lateral distance of the feet at touchdown. In m."""

STEP_RATIO = (0.5, 2.0)
"""Least and largest ratio of the step's length to speed times step time."""

STRAIGHT_YAW = 0.1
"""Largest hip yaw of gaits that walk straight. In rad."""

_SHORT_STEP = 0.05  # m; a shorter step does not show the unit of the speeds
_MIRRORED = 0.01  # rad; smaller angles do not show whether the legs are mirrored

_PHASES = np.linspace(0.0, 1.0, 41)
_BASIS = np.array([bezier.basis(phase)[:, 0] for phase in _PHASES])


def import_mat(path: Path) -> GaitLibrary:
    """Read a library.

    Raises:
        GaitLibraryError: if the file is missing or damaged, or its content is not of the shape
            above, not finite, or no gait of Cassie; one line with the file's name and the reason.
    """
    try:
        content = read_mat(path)
        stances = [_alpha(content, _FIELDS[stance]) for stance in STANCES]
        if len(stances[0]) != len(stances[1]):
            raise GaitLibraryError(
                f"RightStance has {len(stances[0])} gaits, LeftStance {len(stances[1])}"
            )
        velocity, ct = (_rows(content, name, len(stances[0])) for name in ("Velocity", "ct"))
        speeds, times = velocity[0], 1.0 / _step_rates(ct[0])
        _check_range("the first row of Velocity", speeds, RANGES["vx"], "m/s")
        different, counts = np.unique(speeds, return_counts=True)
        if counts.max() > 1:
            raise GaitLibraryError(
                f"the first row of Velocity has {counts.max()} gaits of "
                f"{different[counts.argmax()]:g} m/s, expected one for each speed"
            )
        sign = _leg_pitch_sign(speeds, stances[0])
        gaits = []
        for i in np.argsort(speeds):
            pair = [_outputs(alpha[i], s, sign) for s, alpha in enumerate(stances)]
            gaits.append(Gait(float(speeds[i]), 0.0, 0.0, float(times[i]), np.array(pair)))
        remarks = [*_remarks(content, velocity, ct), _sign_remark(speeds, sign)]
        remarks += _checked_remarks(gaits)
        settings = {"file": path.name, "leg_pitch_sign": sign, "remarks": remarks}
        today = datetime.date.today().isoformat()
        provenance = Provenance("cassie_gaits.optimize_gaits --import", "1", today, settings)
        return GaitLibrary(tuple(gaits), "imported", model_hash(), provenance)
    except CassieError as error:
        raise GaitLibraryError(f"{path}: {error}") from None


def _numbers(content: MatContent, name: str) -> FloatArray:
    if name in content.flaws:
        raise GaitLibraryError(f"{name} {content.flaws[name]}")
    if name not in content.numbers:
        raise GaitLibraryError(f"it has no {name}")
    return content.numbers[name]


def _rows(content: MatContent, name: str, count: int) -> FloatArray:
    """A field of the library, or of its right stance, one column for each gait. Shape (k, n)."""
    whole = f"{_FIELDS['right_stance']}.{name}"
    found = whole if name not in content.names and whole in content.names else name
    array = np.atleast_2d(_numbers(content, found))
    if array.shape == (count, 1):
        array = array if count == 1 else array.T
    if array.ndim != 2 or array.shape[1] != count or not array.size:
        raise GaitLibraryError(
            f"{found} has shape {array.shape}, expected (k, {count}) for the {count} gaits"
        )
    return array


def _step_rates(ct: FloatArray) -> FloatArray:
    shortest, longest = RANGES["step_time"]
    _check_range("ct", ct, (1.0 / longest, 1.0 / shortest), "1/s")
    return ct


def _check_range(name: str, values: FloatArray, allowed: tuple[float, float], unit: str) -> None:
    """Refuse values outside a range.

    Args:
        name: Name of the values, for the message.
        values: Values of any shape.
        allowed: Lowest and highest value.
        unit: Unit of the values and of the range.
    """
    low, high = float(values.min()), float(values.max())
    if not (allowed[0] <= low and high <= allowed[1]):
        raise GaitLibraryError(
            f"{name} is {low:.4g} .. {high:.4g} {unit}, "
            f"expected {allowed[0]:.4g} .. {allowed[1]:.4g} {unit}"
        )


def _alpha(content: MatContent, stance: str) -> FloatArray:
    """Coefficients of the legs while one leg stands. Shape (n, 10, 6), in rad and m."""
    name = f"{stance}.HAlpha"
    alpha = _numbers(content, name)
    if alpha.ndim != 3 or not len(alpha) or alpha.shape[1:] != (10, bezier.COEFFICIENTS):
        expected = f"(n, 10, {bezier.COEFFICIENTS})"
        raise GaitLibraryError(f"{name} has shape {alpha.shape}, expected {expected}")
    lengths = alpha[:, LEG_LENGTH::5]
    if not virtual_leg.SHORTEST < lengths.min() <= lengths.max() < virtual_leg.LONGEST:
        raise GaitLibraryError(
            f"{name} has leg lengths of {lengths.min():g} .. {lengths.max():g} m, "
            f"expected {virtual_leg.SHORTEST:.3g} .. {virtual_leg.LONGEST:.4g} m"
        )
    for side, leg in enumerate(_LEGS):
        for row, joint in ((HIP_ROLL, "hip_roll"), (HIP_YAW, "hip_yaw")):
            at = 5 * side + row
            title = f"{name}, row {at + 1} ({leg} {_ROWS[row]}),"
            _check_range(title, alpha[:, at] @ _BASIS.T, _stops(leg, joint), "rad")
    return alpha


def _stops(leg: str, joint: str) -> tuple[float, float]:
    """Stops of a joint, with the margin."""
    low, high = robot.stops(leg)[joint]
    return low - BEYOND_STOPS, high + BEYOND_STOPS


def _leg_pitch_sign(speeds: FloatArray, right_stance: FloatArray) -> float:
    """+1 if leg pitch > 0 puts the toe in front, else -1: the left leg swings along the speed."""
    sweep = right_stance[:, LEG_PITCH, -1] - right_stance[:, LEG_PITCH, 0]
    return -1.0 if float(sweep @ speeds) < 0.0 else 1.0


def _sign_remark(speeds: FloatArray, sign: float) -> str:
    positive = "in front of" if sign > 0.0 else "behind"
    reason = "as the legs swing at speed" if speeds.any() else "a guess, as every speed is 0"
    return f"leg pitch: positive puts the toe {positive} the hip ({reason})"


def _checked_remarks(gaits: Sequence[Gait]) -> list[str]:
    """Ranges of what was found, one line each, after a check of angles and footholds.

    Raises:
        GaitLibraryError: if left and right leg are not mirrored, the hips turn although the gaits
            walk straight, or the feet do not land where speed and step time ask for.
    """
    lines = []
    for name, outputs in (
        ("hip roll", ("swing_leg_roll",)),
        ("hip yaw", ("swing_hip_yaw", "stance_hip_yaw")),
    ):
        rows = [OUTPUTS.index(output) for output in outputs]
        left, right = (
            np.array([gait.coefficients[stance][rows] @ _BASIS.T for gait in gaits])
            for stance in (0, 1)
        )
        alike, mirrored = (float(np.abs(left + sign * right).max()) for sign in (1.0, -1.0))
        if alike > max(mirrored, _MIRRORED):
            raise GaitLibraryError(
                f"{name} of left and right leg: their sum is up to {alike:.2g} rad, their "
                f"difference up to {mirrored:.2g} rad, expected mirrored angles: positive is to "
                "the left for both legs"
            )
        both = np.concatenate([left, -right])
        low, high = float(both.min()), float(both.max())
        if name == "hip yaw" and max(-low, high) > STRAIGHT_YAW:
            raise GaitLibraryError(
                f"hip yaw is {low:.2g} .. {high:.2g} rad, expected at most {STRAIGHT_YAW:g} rad as "
                "the gaits walk straight: is it in rad?"
            )
        lines.append(
            f"{name}: {low:.2g} .. {high:.2g} rad in steps on the right leg, positive to the left"
        )
    ahead, apart = np.array([_foothold(gait) for gait in gaits]).T
    expected = np.array([gait.vx * gait.step_time for gait in gaits])
    title = "at touchdown the left foot, to the left of the right one,"
    _check_range(title, apart, FEET_APART, "m")
    for gait, length, wanted in zip(gaits, ahead.tolist(), expected.tolist(), strict=True):
        ends = sorted(ratio * wanted for ratio in STEP_RATIO)
        if abs(wanted) > _SHORT_STEP and not ends[0] <= length <= ends[1]:
            raise GaitLibraryError(
                f"the gait of {gait.vx:g} m/s with steps of {gait.step_time:g} s has steps of "
                f"{length:.2g} m, expected {ends[0]:.2g} .. {ends[1]:.2g} m: are Velocity in m/s "
                "and ct in 1/s?"
            )
    lines.append(f"feet at touchdown: {apart.min():.2g} .. {apart.max():.2g} m apart sideways")
    lines.append(
        f"steps: {ahead.min():.2g} .. {ahead.max():.2g} m long; speed times step time is "
        f"{expected.min():.2g} .. {expected.max():.2g} m"
    )
    return lines


def _foothold(gait: Gait) -> tuple[float, float]:
    """Where the left foot lands relative to the right one: ahead and to the left. In m.

    At that touchdown the right foot is where its swing begins in the next step.
    """
    left, right = _hanging_foot(gait, 0, -1), _hanging_foot(gait, 1, 0)
    return left[0] - right[0], left[1] - right[1]


def _hanging_foot(gait: Gait, stance: int, at: int) -> tuple[float, float]:
    """Toe joint of the swing leg relative to the pelvis, ahead and to the left, torso upright.

    Args:
        gait: The gait.
        stance: 0 for the left leg, which swings while the right one stands, else 1.
        at: 0 for the begin of the step, -1 for its end.
    """
    value = dict(zip(OUTPUTS, gait.coefficients[stance][:, at].tolist(), strict=True))
    links = {link.name: link for link in robot.leg_links(_LEGS[stance])}
    below = -sum(links[name].position[2] for name in ("hip_yaw", "hip_pitch"))
    length, pitch = value["swing_leg_length"], value["swing_leg_pitch"]
    drop = below + length * math.cos(pitch)
    side = links["hip_roll"].position[1] + math.sin(value["swing_leg_roll"]) * drop
    return length * math.sin(pitch), side


def _remarks(content: MatContent, velocity: FloatArray, ct: FloatArray) -> list[str]:
    """What the file lacks, and what of the file is not used; one line each."""
    found = [
        "set to 0: torso roll, torso pitch, speed to the left, turning rate",
        "missing: torques, passive motion, cost, certificate",
        "not used: hip roll, leg pitch and toe of the stance leg",
    ]
    for name, rows in (("Velocity", velocity), ("ct", ct)):
        found += [
            f"not used: row {i + 1} of {name} ({row.min():g} .. {row.max():g})"
            for i, row in enumerate(rows)
            if i > 0
        ]
    other = content.numbers.get("LeftStance.ct")
    if other is not None and not (other.size == ct[0].size and np.allclose(other.ravel(), ct[0])):
        found.append("not used: LeftStance.ct, which differs from the ct of the right stance")
    unknown = [name for name in content.names if name.rpartition(".")[2] not in USED]
    unknown = [name for name in unknown if name not in _FIELDS.values()]
    if unknown:
        found.append(f"not used: {', '.join(unknown)}")
    return found


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
        "swing_foot_pitch": _foot_pitch(sw, stance, sign),
    }
    return np.array([rows[name] for name in OUTPUTS])


def _foot_pitch(swing: FloatArray, stance: int, sign: float) -> FloatArray:
    """Coefficients of the swing foot's pitch, by least squares from those of the toe joint.

    Args:
        swing: Coefficients of the swing leg. Shape (5, 6).
        stance: 0 for a step on the right leg, 1 for one on the left.
        sign: Sign of leg pitch.

    Returns:
        Shape (6,), in rad.
    """
    leg, name = _LEGS[stance], f"{_FIELDS[STANCES[stance]]}.HAlpha"
    at = 5 * stance
    pitch, length, toe = (_BASIS @ swing[row] for row in (LEG_PITCH, LEG_LENGTH, TOE))
    hip = np.array(
        [
            virtual_leg.hip_pitch_angle(sign * angle, 0.0, reach)
            for angle, reach in np.column_stack([pitch, length]).tolist()
        ]
    )
    title = f"{name}, row {at + LEG_PITCH + 1} ({leg} leg pitch), as hip pitch"
    _check_range(title, hip, _stops(leg, "hip_pitch"), "rad")
    values = [virtual_leg.foot_pitch(0.0, *angles) for angles in np.column_stack([hip, toe])]
    if max(map(abs, values)) > _STEEP:
        raise GaitLibraryError(
            f"{name}, row {at + TOE + 1} ({leg} toe): the swing foot pitches by "
            f"{max(map(abs, values)):.2g} rad, expected at most {_STEEP}: its row is not the toe "
            "joint's angle"
        )
    _check_range(f"{name}, row {at + TOE + 1} ({leg} toe),", toe, _stops(leg, "toe"), "rad")
    fitted: FloatArray = np.linalg.lstsq(_BASIS, np.array(values), rcond=None)[0]
    return fitted
