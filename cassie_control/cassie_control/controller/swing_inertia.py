"""Torques that accelerate a swinging leg as its desired outputs ask for.

In the plane of the leg it is a double pendulum of hip pitch p and knee k, with relaxed springs
(the tarsus turns against the knee) and the foot kept level; about the hip roll axis a body whose
inertia follows the knee:

    u_pitch = A p'' + B k'' + A' p' k' + B' k'^2
    u_knee  = B p'' + C k'' - A' p'^2 / 2
    u_roll  = R r'' + R' r' k'

with A, B, C and R of the knee angle, drives' armature included, and ' in A', B', R' by the knee.
Gravity is left to the position loop: it holds a hanging leg within 0.01 rad.

Source:
    Cubic polynomials fitted to the mass matrix of `cassie_gaits.dynamics` for knees of -2.4 to
    -0.75 rad, error below 0.001 kg m^2 (a test holds that).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from cassie_gaits import virtual_leg
from cassie_gaits.compiled import compiled

FloatArray = npt.NDArray[np.float64]

INERTIA = np.array(
    [
        [1.0411, -0.1591, -0.3106, -0.0599],  # A
        [0.5699, -0.0817, -0.1565, -0.0302],  # B
        [0.4899, -0.0042, -0.0024, -0.0004],  # C
        [1.3723, -0.1943, -0.4381, -0.0809],  # R
    ]
)
"""Coefficients of A, B, C and R by rising power of the knee angle. In kg m^2."""

_SIDES = np.array([virtual_leg.SHIN, virtual_leg.THIGH, virtual_leg.KNEE_OFFSET])


def swing_torques(
    rates: tuple[float, float, float], accelerations: tuple[float, float, float], length: float
) -> tuple[float, float, float]:
    """Torques of hip roll, hip pitch and knee.

    Args:
        rates: Desired rates of leg roll, leg pitch and leg length. In rad/s and m/s.
        accelerations: The same for accelerations. In rad/s^2 and m/s^2.
        length: Desired leg length. In m.

    Returns:
        In Nm.
    """
    return _torques(rates, accelerations, virtual_leg.knee_angle(length), INERTIA, _SIDES)


@compiled
def _torques(
    rates: tuple[float, float, float],
    accelerations: tuple[float, float, float],
    knee: float,
    inertia: FloatArray,
    sides: FloatArray,
) -> tuple[float, float, float]:
    shin, thigh, offset = sides[0], sides[1], sides[2]
    bend = knee + offset
    sine, cosine = math.sin(bend), math.cos(bend)
    squares, product = shin * shin + thigh * thigh, shin * thigh
    length = math.sqrt(squares + 2.0 * product * cosine)
    # length(k) and hip pitch = leg pitch + lean(k), each differentiated twice by time.
    slope = -product * sine / length
    bow = (-product * cosine - slope * slope) / length
    knee_rate = rates[2] / slope
    knee_acceleration = (accelerations[2] - bow * knee_rate * knee_rate) / slope
    share = shin * (shin + thigh * cosine) / (length * length)
    share_slope = (-shin * thigh * sine - 2.0 * share * length * slope) / (length * length)
    pitch_rate = rates[1] - share * knee_rate
    pitch_acceleration = accelerations[1] - share * knee_acceleration
    pitch_acceleration -= share_slope * knee_rate * knee_rate
    a, a_slope = _cubic(inertia, 0, knee), _cubic_slope(inertia, 0, knee)
    b, b_slope = _cubic(inertia, 1, knee), _cubic_slope(inertia, 1, knee)
    c = _cubic(inertia, 2, knee)
    r, r_slope = _cubic(inertia, 3, knee), _cubic_slope(inertia, 3, knee)
    pitch = a * pitch_acceleration + b * knee_acceleration
    pitch += a_slope * pitch_rate * knee_rate + b_slope * knee_rate * knee_rate
    bending = b * pitch_acceleration + c * knee_acceleration - 0.5 * a_slope * pitch_rate**2
    return r * accelerations[0] + r_slope * rates[0] * knee_rate, pitch, bending


@compiled
def _cubic(table: FloatArray, row: int, x: float) -> float:
    value: float = table[row, 0] + x * (table[row, 1] + x * (table[row, 2] + x * table[row, 3]))
    return value


@compiled
def _cubic_slope(table: FloatArray, row: int, x: float) -> float:
    value: float = table[row, 1] + x * (2.0 * table[row, 2] + x * 3.0 * table[row, 3])
    return value
