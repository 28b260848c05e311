"""Rods of a leg in closed form: heel spring and achilles rod, foot crank and plantar rod.

Each leg holds two loops. The achilles rod, on a ball joint at the hip pitch link, is pinned to
the tip of the heel spring, which turns in the tarsus: knee, shin and tarsus angle fix the heel
spring's angle. The plantar rod joins the foot crank to the toe link: the toe angle fixes the
crank's. Both closures ask for a point of a circle at a given distance from another point:
A cos(angle) + B sin(angle) = C.

Everything is written for the left leg. A right leg with the same joint angles is its mirror
image in the plane of the leg, so that all angles here hold for it too and vectors negate z.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from cassie_gaits import robot
from cassie_gaits.errors import KinematicsError

FloatArray = npt.NDArray[np.float64]

_LINKS = {link.name: link for link in robot.LEFT_LEG}
_RODS = {rod.rod: rod for rod in robot.RODS}


def link_rotation(link: robot.Link) -> FloatArray:
    """Orientation of a link's frame in its parent's when its joint is at `Joint.zero`. (3, 3)."""
    x_axis = np.asarray(link.x_axis) / np.linalg.norm(link.x_axis)
    z_axis = np.cross(x_axis, link.y_axis)
    z_axis /= np.linalg.norm(z_axis)
    return np.column_stack([x_axis, np.cross(z_axis, x_axis), z_axis])


def _neutral(name: str, ancestor: str) -> tuple[FloatArray, FloatArray]:
    """Position and orientation in an ancestor's frame with every joint at its `zero`."""
    position, rotation = np.zeros(3), np.eye(3)
    while name != ancestor:
        link = _LINKS[name]
        turn = link_rotation(link)
        position, rotation = np.asarray(link.position) + turn @ position, turn @ rotation
        name = link.parent
    return position, rotation


def pin_in_target(rod: robot.Rod) -> FloatArray:
    """Where a rod is pinned, in the frame of its target on the left leg. Shape (3,), in m."""
    common = _LINKS[rod.rod].parent
    while common not in _ancestors(rod.target):
        common = _LINKS[common].parent
    p_rod, R_rod = _neutral(rod.rod, common)
    p_target, R_target = _neutral(rod.target, common)
    pin: FloatArray = R_target.T @ (p_rod + R_rod[:, 0] * rod.length - p_target)
    return pin


def _ancestors(name: str) -> list[str]:
    chain = [name]
    while name in _LINKS:
        name = _LINKS[name].parent
        chain.append(name)
    return chain


def _turn_about_z(name: str) -> float:
    """Angle that a link's frame has turned about the common z axis, less its joint angle."""
    link = _LINKS[name]
    return math.atan2(link.x_axis[1], link.x_axis[0]) - link.joint.zero


def _floats(vector: npt.ArrayLike) -> tuple[float, ...]:
    return tuple(np.asarray(vector, dtype=np.float64).tolist())


# Hip pitch frame to tarsus, in the plane of the leg.
KNEE_X, KNEE_Y, _KNEE_Z = _LINKS["knee"].position
SHIN_X, SHIN_Y, _ = _LINKS["shin"].position
TARSUS_X, TARSUS_Y, _ = _LINKS["tarsus"].position
KNEE_TURN = _turn_about_z("knee")
TARSUS_TURN = KNEE_TURN + _turn_about_z("tarsus")

# Achilles rod: base seen from the hip pitch link, heel spring in the tarsus.
_BASE_X, _BASE_Y, _base_z = _LINKS["achilles_rod"].position
_BASE_Z = _base_z - _KNEE_Z
_LENGTH = _RODS["achilles_rod"].length
_HEEL_X, _HEEL_Y, _HEEL_Z = _LINKS["heel_spring"].position
_R_HEEL = link_rotation(_LINKS["heel_spring"])
_HEEL_PIN = pin_in_target(_RODS["achilles_rod"])

# Tip of the heel spring from its joint, in tarsus axes: _T0 + _TC cos(heel) + _TS sin(heel).
_T0X, _T0Y, _T0Z = _floats(_R_HEEL[:, 2] * _HEEL_PIN[2])
_TCX, _TCY, _TCZ = _floats(_R_HEEL[:, :2] @ _HEEL_PIN[:2])
_TSX, _TSY, _TSZ = _floats(_R_HEEL[:, :2] @ (-_HEEL_PIN[1], _HEEL_PIN[0]))
_HEEL_REACH = float(_HEEL_PIN @ _HEEL_PIN) - _LENGTH * _LENGTH

# Plantar rod: crank in the tarsus, toe in the tarsus.
_CRANK_X, _CRANK_Y, _ = _LINKS["foot_crank"].position
TOE_X, TOE_Y, _ = _LINKS["toe"].position
_ARM = _LINKS["plantar_rod"].position[0]
_PLANTAR = _RODS["plantar_rod"].length
_TOE_PIN_X, _TOE_PIN_Y, _ = _floats(pin_in_target(_RODS["plantar_rod"]))


def heel_angle(knee: float, shin: float, tarsus: float) -> float:
    """Deflection of the heel spring, from the length of the achilles rod. In rad.

    Raises:
        KinematicsError: if the rod does not reach, or an angle is not finite.
    """
    return heel_angle_and_slopes(knee, shin, tarsus)[0]


def heel_angle_and_slopes(
    knee: float, shin: float, tarsus: float
) -> tuple[float, float, float, float]:
    """Deflection of the heel spring and its partial derivatives.

    Args:
        knee: q4. In rad.
        shin: q5. In rad.
        tarsus: q6. In rad.

    Returns:
        Heel angle in rad and its derivatives to q4, q5, q6.

    Raises:
        KinematicsError: if the rod does not reach, or an angle is not finite.
    """
    upper = knee + KNEE_TURN
    lower = upper + shin
    foot = knee + shin + tarsus + TARSUS_TURN
    if not -100.0 < foot + lower < 100.0:
        raise KinematicsError(f"leg angles are ({knee}, {shin}, {tarsus}) rad, expected finite")
    cos_u, sin_u = math.cos(upper), math.sin(upper)
    cos_l, sin_l = math.cos(lower), math.sin(lower)
    cos_f, sin_f = math.cos(foot), math.sin(foot)
    # Joint axes from the tarsus axis backwards, and the rod's base from there; hip pitch axes.
    shin_x, shin_y = -cos_l * TARSUS_X + sin_l * TARSUS_Y, -sin_l * TARSUS_X - cos_l * TARSUS_Y
    knee_x = shin_x - cos_u * SHIN_X + sin_u * SHIN_Y
    knee_y = shin_y - sin_u * SHIN_X - cos_u * SHIN_Y
    base_x, base_y = knee_x - KNEE_X + _BASE_X, knee_y - KNEE_Y + _BASE_Y
    # From the heel spring's joint to the base; tarsus axes.
    w_x = cos_f * base_x + sin_f * base_y - _HEEL_X
    w_y = -sin_f * base_x + cos_f * base_y - _HEEL_Y
    w_z = _BASE_Z - _HEEL_Z
    a = w_x * _TCX + w_y * _TCY + w_z * _TCZ
    b = w_x * _TSX + w_y * _TSY + w_z * _TSZ
    fixed = w_x * _T0X + w_y * _T0Y + w_z * _T0Z
    c = 0.5 * (w_x * w_x + w_y * w_y + w_z * w_z + _HEEL_REACH) - fixed
    amplitude = math.sqrt(a * a + b * b)
    if not -amplitude <= c <= amplitude:
        raise KinematicsError(
            f"achilles rod does not reach at knee {knee:.3f}, shin {shin:.3f}, "
            f"tarsus {tarsus:.3f} rad"
        )
    heel = math.atan2(b, a) + _HEEL_BRANCH * math.acos(c / amplitude)
    if heel > math.pi:
        heel -= 2.0 * math.pi
    elif heel < -math.pi:
        heel += 2.0 * math.pi
    # The rod keeps its length: what the tip moves along the rod sums to zero.
    cos_h, sin_h = math.cos(heel), math.sin(heel)
    tip_x = _HEEL_X + _T0X + _TCX * cos_h + _TSX * sin_h
    tip_y = _HEEL_Y + _T0Y + _TCY * cos_h + _TSY * sin_h
    by_heel = b * cos_h - a * sin_h
    x, y = cos_f * tip_x - sin_f * tip_y, sin_f * tip_x + cos_f * tip_y
    rod_x, rod_y = base_x - x, base_y - y
    by_tarsus = rod_y * x - rod_x * y
    by_shin = rod_y * (x - shin_x) - rod_x * (y - shin_y)
    by_knee = rod_y * (x - knee_x) - rod_x * (y - knee_y)
    return heel, -by_knee / by_heel, -by_shin / by_heel, -by_tarsus / by_heel


def achilles_direction(knee: float, shin: float, tarsus: float) -> FloatArray:
    """Unit vector along the left achilles rod to the heel spring, in hip pitch axes. (3,)."""
    heel = heel_angle(knee, shin, tarsus)
    lower, foot = knee + KNEE_TURN + shin, knee + shin + tarsus + TARSUS_TURN
    offset = np.array([_HEEL_X, _HEEL_Y, _HEEL_Z])
    turned = np.array([[math.cos(heel), -math.sin(heel)], [math.sin(heel), math.cos(heel)]])
    in_heel = np.array([*(turned @ _HEEL_PIN[:2]), _HEEL_PIN[2]])
    tip = (
        np.array([KNEE_X, KNEE_Y, _KNEE_Z])
        + _about_z(knee + KNEE_TURN) @ (SHIN_X, SHIN_Y, 0.0)
        + _about_z(lower) @ (TARSUS_X, TARSUS_Y, 0.0)
        + _about_z(foot) @ (offset + _R_HEEL @ in_heel)
    )
    along = tip - np.asarray(_LINKS["achilles_rod"].position)
    unit: FloatArray = along / np.linalg.norm(along)
    return unit


def _about_z(angle: float) -> FloatArray:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def crank_angles(toe: float) -> tuple[float, float]:
    """Angles of the foot crank in the tarsus and of the plantar rod in the crank.

    Args:
        toe: q7. In rad.

    Raises:
        KinematicsError: if the rod does not reach, or the angle is not finite.
    """
    if not -10.0 < toe < 10.0:
        raise KinematicsError(f"toe angle is {toe} rad, expected a finite joint angle")
    cos_t, sin_t = math.cos(toe), math.sin(toe)
    x = TOE_X + cos_t * _TOE_PIN_X - sin_t * _TOE_PIN_Y - _CRANK_X
    y = TOE_Y + sin_t * _TOE_PIN_X + cos_t * _TOE_PIN_Y - _CRANK_Y
    reach = (x * x + y * y + _ARM * _ARM - _PLANTAR * _PLANTAR) / (2.0 * _ARM * math.hypot(x, y))
    if not -1.0 <= reach <= 1.0:
        raise KinematicsError(f"plantar rod does not reach at toe {toe:.3f} rad")
    # The crank follows the toe nearly in parallel: of the two solutions, the lower one.
    crank = math.atan2(y, x) - math.acos(reach)
    rod = math.atan2(y - _ARM * math.sin(crank), x - _ARM * math.cos(crank))
    return crank, rod - crank


_HEEL_BRANCH = 1.0
_neutral_knee, _neutral_tarsus = (_LINKS[name].joint.zero for name in ("knee", "tarsus"))
if abs(heel_angle(_neutral_knee, 0.0, _neutral_tarsus)) > 1e-6:
    _HEEL_BRANCH = -1.0
