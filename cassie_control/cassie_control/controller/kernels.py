"""Small vector arithmetic of the controller, compiled: numpy's call overhead would dominate."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from cassie_gaits.compiled import compiled

FloatArray = npt.NDArray[np.float64]


@compiled
def set_tilt(pitch: float, roll: float, tilt: FloatArray) -> None:
    """Rotation from pelvis to heading frame, from pitch and roll in rad, into `tilt` (3, 3)."""
    cp, sp = math.cos(pitch), math.sin(pitch)
    cr, sr = math.cos(roll), math.sin(roll)
    tilt[0, 0], tilt[0, 1], tilt[0, 2] = cp, sp * sr, sp * cr
    tilt[1, 0], tilt[1, 1], tilt[1, 2] = 0.0, cr, -sr
    tilt[2, 0], tilt[2, 1], tilt[2, 2] = -sp, cp * sr, cp * cr


@compiled
def turned(rotation: FloatArray, vector: FloatArray) -> tuple[float, float, float]:
    """rotation (3, 3) times vector (3,)."""
    x, y, z = vector[0], vector[1], vector[2]
    return (
        rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z,
        rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z,
        rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z,
    )


@compiled
def holding_torques(
    jacobian: FloatArray, tilt: FloatArray, force: float, lean_x: float, lean_y: float
) -> tuple[float, float, float, float]:
    """See `LegReadings.weight_torques`; `jacobian` (3, 7) moves the toe joint, pelvis frame."""
    x = force * (tilt[2, 0] + lean_x * tilt[0, 0] + lean_y * tilt[1, 0])
    y = force * (tilt[2, 1] + lean_x * tilt[0, 1] + lean_y * tilt[1, 1])
    z = force * (tilt[2, 2] + lean_x * tilt[0, 2] + lean_y * tilt[1, 2])
    roll = jacobian[0, 0] * x + jacobian[1, 0] * y + jacobian[2, 0] * z
    yaw = jacobian[0, 1] * x + jacobian[1, 1] * y + jacobian[2, 1] * z
    pitch = jacobian[0, 2] * x + jacobian[1, 2] * y + jacobian[2, 2] * z
    knee = jacobian[0, 3] * x + jacobian[1, 3] * y + jacobian[2, 3] * z
    tarsus = jacobian[0, 5] * x + jacobian[1, 5] * y + jacobian[2, 5] * z
    return -roll, -yaw, -pitch, tarsus - knee


@compiled
def clamp(values: FloatArray, low: FloatArray, high: FloatArray) -> int:
    """Clamp each value in place; the index of the first that is not finite, or -1.

    Args:
        values, low, high: All of the same shape (n,) and unit.
    """
    for i in range(values.size):
        if not math.isfinite(values[i]):
            return i
        values[i] = max(low[i], min(high[i], values[i]))
    return -1
