"""A gait library by kinematics only, for walks that are rougher than those of the shipped one."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from cassie_gaits import bezier
from cassie_gaits.errors import GaitLibraryError
from cassie_gaits.gait_library import OUTPUTS, Gait, GaitLibrary, Provenance, mirror
from cassie_gaits.model_hash import model_hash
from cassie_gaits.virtual_leg import LENGTH_LIMITS

FloatArray = npt.NDArray[np.float64]

SPEEDS = (-0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0)
"""Of the seven gaits of the paper. In m/s."""

_VERSION = "1"
_SAMPLES = 41


def kinematic_library(
    speeds: Sequence[float] = SPEEDS,
    step_time: float = 0.4,
    leg_length: float = 0.85,
    clearance: float = 0.15,
    *,
    touchdown_speed: float = 0.2,
    leg_roll: float = 0.0,
    date: str = "",
) -> GaitLibrary:
    """Make the library.

    Args:
        speeds: Rising. In m/s.
        step_time: Duration of each step. In s.
        leg_length: Of the stance leg, and of the swing leg at both ends of a step. In m.
        clearance: Height of the swing foot at mid-step. In m.
        touchdown_speed: Downward speed of the swing foot at the end of a step. In m/s.
        leg_roll: Outward roll of the swing leg. In rad.
        date: For the provenance, YYYY-MM-DD.

    Raises:
        GaitLibraryError: if a length is outside the leg's reach or a step is too long for it.
    """
    low, high = LENGTH_LIMITS
    if not low <= leg_length <= high or not 0.0 <= clearance <= leg_length - low:
        raise GaitLibraryError(
            f"leg length {leg_length} m with clearance {clearance} m is outside "
            f"{low:.3f} .. {high:.3f} m"
        )
    settings = {
        "step_time": step_time,
        "leg_length": leg_length,
        "clearance": clearance,
        "touchdown_speed": touchdown_speed,
        "leg_roll": leg_roll,
    }
    gaits = []
    for speed in speeds:
        right = _right_stance(speed, step_time, leg_length, clearance, touchdown_speed, leg_roll)
        coefficients = np.stack([right, mirror(right)])
        gaits.append(Gait(float(speed), 0.0, 0.0, step_time, coefficients))
    return GaitLibrary(
        tuple(gaits),
        kind="imported",
        model_hash=model_hash(),
        provenance=Provenance("kinematic_gaits", _VERSION, date or "unknown", settings),
    )


def _right_stance(
    speed: float,
    step_time: float,
    leg_length: float,
    clearance: float,
    touchdown_speed: float,
    leg_roll: float,
) -> FloatArray:
    half_step = 0.5 * speed * step_time
    if not abs(half_step) < 0.7 * leg_length:
        raise GaitLibraryError(
            f"half a step of {half_step:.3f} m at {speed} m/s is too long for a leg of "
            f"{leg_length} m"
        )
    # The foot rests on the ground before and after its swing: relative to the hip it then moves
    # back at the walking speed.
    per_phase = -speed * step_time / bezier.DEGREE
    forward = _least_effort(-half_step, -half_step + per_phase, half_step - per_phase, half_step)
    up = _through_middle(touchdown_speed * step_time / bezier.DEGREE, clearance)
    hip_height = math.sqrt(leg_length**2 - half_step**2)
    phases = np.linspace(0.0, 1.0, _SAMPLES)
    x = np.array([bezier.evaluate(forward[np.newaxis], phase)[0] for phase in phases])
    z = np.array([bezier.evaluate(up[np.newaxis], phase)[0] for phase in phases]) - hip_height
    rows = dict.fromkeys(OUTPUTS, np.zeros(bezier.COEFFICIENTS))
    rows["stance_leg_length"] = np.full(bezier.COEFFICIENTS, leg_length)
    rows["swing_leg_roll"] = np.full(bezier.COEFFICIENTS, leg_roll)
    rows["swing_leg_pitch"] = _fit(phases, np.arctan2(x, -z))
    rows["swing_leg_length"] = _fit(phases, np.hypot(x, z))
    return np.stack([rows[name] for name in OUTPUTS])


def _least_effort(start: float, second: float, fifth: float, end: float) -> FloatArray:
    """Coefficients with these ends and the least integral of squared second derivative."""
    grid = np.linspace(0.0, 1.0, _SAMPLES)
    acceleration = np.array([bezier.basis(phase)[:, 2] for phase in grid])
    fixed = np.array([start, second, 0.0, 0.0, fifth, end])
    middle = np.linalg.lstsq(acceleration[:, 2:4], -acceleration @ fixed, rcond=None)[0]
    fixed[2:4] = middle
    return fixed


def _through_middle(before_end: float, clearance: float) -> FloatArray:
    """Coefficients of a height that leaves 0 at rest, passes `clearance` and ends at 0."""
    weight = bezier.basis(0.5)[:, 0]
    middle = (clearance - weight[4] * before_end) / (weight[2] + weight[3])
    return np.array([0.0, 0.0, middle, middle, before_end, 0.0])


def _fit(phases: FloatArray, values: FloatArray) -> FloatArray:
    """Coefficients of the polynomial nearest to the samples; their ends and middle are kept."""
    basis = np.array([bezier.basis(phase)[:, 0] for phase in phases])
    step = phases[1] - phases[0]
    # Slopes at the ends from five samples, exact for the smooth curves met here.
    weights = np.array([-25.0, 48.0, -36.0, 16.0, -3.0]) / (12.0 * step)
    first, last = weights @ values[:5], -weights @ values[-1:-6:-1]
    fixed = np.array(
        [
            values[0],
            values[0] + first / bezier.DEGREE,
            0.0,
            0.0,
            values[-1] - last / bezier.DEGREE,
            values[-1],
        ]
    )
    weight = np.ones(len(phases))
    weight[len(phases) // 2] = 1e3
    rest = weight * (values - basis @ fixed)
    fixed[2:4] = np.linalg.lstsq(basis[:, 2:4] * weight[:, np.newaxis], rest, rcond=None)[0]
    return fixed
