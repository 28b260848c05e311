"""Heel spring angle by the knee and foot crank angle by the toe, in closed form, as symbols.

With rigid springs the attitude of the tarsus to the thigh is constant, so the knee alone determines
the heel spring. `cassie_gaits.linkage` has the same loops for numbers and any spring deflection.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from cassie_gaits import robot
from cassie_gaits.linkage import link_rotation, pin_in_target
from cassie_gaits.records import FloatArray

_LINKS = {link.name: link for link in robot.LEFT_LEG}
_RODS = {rod.rod: rod for rod in robot.RODS}


def heel_angle(knee: ca.SX) -> ca.SX:
    """Deflection of the heel spring when q5 = 0 and q6 = 13 degrees - q4. In rad."""
    angle: ca.SX = _heel_angle(knee, _HEEL_SIGN)
    return angle


def crank_angle(toe: ca.SX) -> ca.SX:
    """Angle of the foot crank in the tarsus, near to the toe angle. In rad."""
    rod, foot = _RODS["plantar_rod"], _LINKS["toe"]
    crank, arm = _LINKS["foot_crank"].position, _LINKS["plantar_rod"].position[0]
    pin = pin_in_target(rod)
    x = ca.cos(toe) * pin[0] - ca.sin(toe) * pin[1] + (foot.position[0] - crank[0])
    y = ca.sin(toe) * pin[0] + ca.cos(toe) * pin[1] + (foot.position[1] - crank[1])
    reach = (x * x + y * y + arm**2 - rod.length**2) / (2.0 * arm * ca.sqrt(x * x + y * y))
    angle: ca.SX = ca.atan2(y, x) - ca.acos(reach)
    return angle


def about_z(angle: ca.SX | ca.DM) -> ca.SX:
    """Rotation about z. Shape (3, 3)."""
    c, s = ca.cos(angle), ca.sin(angle)
    return ca.vertcat(ca.horzcat(c, -s, 0.0), ca.horzcat(s, c, 0.0), ca.horzcat(0.0, 0.0, 1.0))


def achilles_direction(knee: ca.SX) -> ca.SX:
    """Unit vector along the left achilles rod in the hip pitch link, to the heel. Shape (3, 1)."""
    attitude, base = _achilles_base(knee)
    angle = _heel_angle(knee, _HEEL_SIGN)
    axes, rod = link_rotation(_LINKS["heel_spring"]), _RODS["achilles_rod"]
    tip = ca.mtimes([ca.DM(axes), about_z(angle), ca.DM(pin_in_target(rod))])
    direction: ca.SX = ca.mtimes(ca.DM(attitude), tip - base) / rod.length
    return direction


def _achilles_base(knee: ca.SX | ca.DM) -> tuple[FloatArray, Any]:
    """The tarsus's attitude to the hip pitch link, and the rod's base from the heel spring.

    Returns:
        Attitude of shape (3, 3), and the base in the tarsus's axes, (3, 1) in m.
    """
    thigh, shin, tarsus = (_LINKS[name] for name in ("knee", "shin", "tarsus"))
    to_tarsus = ca.DM(np.array(shin.position) + np.array(tarsus.position))
    turn = link_rotation(thigh)
    corner = ca.DM(thigh.position) + ca.mtimes(
        ca.DM(turn), ca.mtimes(about_z(knee - thigh.joint.zero), to_tarsus)
    )
    turned = robot.NEUTRAL_TARSUS - thigh.joint.zero - tarsus.joint.zero
    # Knee, shin and tarsus turn about the same axis, so their order does not matter.
    attitude = turn @ link_rotation(tarsus) @ np.array(about_z(ca.DM(turned)))
    base = ca.mtimes(ca.DM(attitude.T), ca.DM(_LINKS["achilles_rod"].position) - corner)
    return attitude, base - ca.DM(_LINKS["heel_spring"].position)


def _heel_angle(knee: ca.SX | ca.DM, sign: float) -> Any:
    rod = _RODS["achilles_rod"]
    _, base = _achilles_base(knee)
    axes, pin = link_rotation(_LINKS["heel_spring"]), pin_in_target(rod)
    along, across = axes[:, :2] @ pin[:2], axes[:, :2] @ np.array([-pin[1], pin[0]])
    still = ca.DM(axes[:, 2] * pin[2])
    reach = 0.5 * (ca.dot(base, base) - rod.length**2 + pin @ pin) - ca.dot(still, base)
    x, y = ca.dot(base, ca.DM(along)), ca.dot(base, ca.DM(across))
    return ca.atan2(y, x) + sign * ca.acos(reach / ca.sqrt(x * x + y * y))


_HEEL_SIGN = min((-1.0, 1.0), key=lambda sign: abs(float(_heel_angle(ca.DM(-1.2), sign))))
"""Sign of the loop's solution with the smaller angle, which is that of the spring."""
