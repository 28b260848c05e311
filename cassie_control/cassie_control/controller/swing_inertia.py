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

import numpy as np
import numpy.typing as npt

from cassie_control.controller.drive_kernels import inertia_torques
from cassie_gaits import virtual_leg

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

_SIDES = (virtual_leg.SHIN, virtual_leg.THIGH, virtual_leg.KNEE_OFFSET)


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
    return inertia_torques(rates, accelerations, virtual_leg.knee_angle(length), INERTIA, _SIDES)
