"""Rods of a leg in closed form: heel spring and achilles rod, foot crank and plantar rod.

Each leg has two loops. The achilles rod, on a ball joint at the hip pitch link, is pinned to
the tip of the heel spring, which turns in the tarsus: knee, shin and tarsus angle determine the
heel spring's angle. The plantar rod joins the foot crank to the toe link: the toe angle determines
the crank's angle. Both closures need a point on a circle at a given distance from another point:
A cos(angle) + B sin(angle) = C.

Everything is written for the left leg. A right leg with the same joint angles is its mirror
image in the plane of the leg. So all angles here are valid for it, too, and vectors negate z.
"""

from __future__ import annotations

import math

import numpy as np

from cassie_gaits import robot
from cassie_gaits.compiled import compiled
from cassie_gaits.errors import KinematicsError
from cassie_gaits.records import FloatArray, Record, array
from cassie_gaits.vectors import dot


class HeelLoop(Record):
    """The loop of the achilles rod, see `heel_loop`. In m and rad.

    Attributes:
        knee, shin, tarsus: Joint axes in the plane of the leg, each in its parent's frame.
        knee_turn, tarsus_turn: Angles of the frames about z from the hip pitch frame, without the
            joint angles.
        base: The rod's base in the hip pitch frame, with z from the knee's z.
        heel: The heel spring's joint in the tarsus.
        still, cosine, sine: Tip from that joint: still + cosine cos(angle) + sine sin(angle).
        reach: Squared distance of the tip from that joint, minus the rod's squared length. In m^2.
        branch: Sign of the solution of the loop that is the spring's, 1 or -1.
    """

    knee: FloatArray = array(2)
    shin: FloatArray = array(2)
    tarsus: FloatArray = array(2)
    knee_turn: float
    tarsus_turn: float
    base: FloatArray = array(3)
    heel: FloatArray = array(3)
    still: FloatArray = array(3)
    cosine: FloatArray = array(3)
    sine: FloatArray = array(3)
    reach: float
    branch: float


# Share of the greatest C up to which the achilles rod's loop is solved: the derivatives of the heel
# spring's angle grow without bound where the loop ceases to close.
_CLOSES_WELL = 0.9999


@compiled
def _turned(x: float, y: float, c: float, s: float) -> tuple[float, float]:
    return c * x - s * y, s * x + c * y


@compiled
def heel_deflection(
    knee: float, shin: float, tarsus: float, loop: HeelLoop
) -> tuple[float, float, float, float]:
    """Deflection of the heel spring and its partial derivatives, compiled.

    Args:
        knee: q4. In rad.
        shin: q5. In rad.
        tarsus: q6. In rad.
        loop: See `heel_loop`.

    Returns:
        Heel angle in rad and its derivatives by q4, q5, q6. All are NaN if the rod does not
        reach, or so barely that a derivative exceeds about 100, and if an angle is not finite.
    """
    upper = knee + loop.knee_turn
    lower, foot = upper + shin, knee + shin + tarsus + loop.tarsus_turn
    if not -100.0 < foot + lower < 100.0:
        return math.nan, math.nan, math.nan, math.nan
    cos_f, sin_f = math.cos(foot), math.sin(foot)
    # Joint axes from the tarsus axis upwards, then the rod's base; in hip pitch axes.
    shin_x, shin_y = _turned(-loop.tarsus[0], -loop.tarsus[1], math.cos(lower), math.sin(lower))
    x, y = _turned(-loop.shin[0], -loop.shin[1], math.cos(upper), math.sin(upper))
    knee_x, knee_y = shin_x + x, shin_y + y
    base_x = knee_x - loop.knee[0] + loop.base[0]
    base_y = knee_y - loop.knee[1] + loop.base[1]
    # From the heel spring's joint to the base, in tarsus axes.
    x, y = _turned(base_x, base_y, cos_f, -sin_f)
    w = (x - loop.heel[0], y - loop.heel[1], loop.base[2] - loop.heel[2])
    a, b = dot(w, loop.cosine), dot(w, loop.sine)
    c = 0.5 * (dot(w, w) + loop.reach) - dot(w, loop.still)
    amplitude = math.hypot(a, b)
    if not abs(c) < _CLOSES_WELL * amplitude:
        return math.nan, math.nan, math.nan, math.nan
    heel = math.atan2(b, a) + loop.branch * math.acos(c / amplitude)
    heel -= 2.0 * math.pi * round(heel / (2.0 * math.pi))
    # The rod's length is constant: the tip's velocity components along the rod sum to zero.
    cos_h, sin_h = math.cos(heel), math.sin(heel)
    x = loop.heel[0] + loop.still[0] + loop.cosine[0] * cos_h + loop.sine[0] * sin_h
    y = loop.heel[1] + loop.still[1] + loop.cosine[1] * cos_h + loop.sine[1] * sin_h
    x, y = _turned(x, y, cos_f, sin_f)
    rod_x, rod_y, by_heel = base_x - x, base_y - y, a * sin_h - b * cos_h
    by_knee = (rod_y * (x - knee_x) - rod_x * (y - knee_y)) / by_heel
    by_shin = (rod_y * (x - shin_x) - rod_x * (y - shin_y)) / by_heel
    return heel, by_knee, by_shin, (rod_y * x - rod_x * y) / by_heel


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
    """Position of a rod's pin in the frame of its target on the left leg. Shape (3,), in m."""
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


_PINS = {rod.rod: pin_in_target(rod) for rod in robot.RODS}


def _turn_about_z(name: str) -> float:
    """Angle of a link's frame about the common z axis, without its joint angle."""
    link = _LINKS[name]
    return math.atan2(link.x_axis[1], link.x_axis[0]) - link.joint.zero


def _about_z(angle: float) -> FloatArray:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def heel_loop() -> HeelLoop:
    """Geometry of the achilles rod's loop, for `heel_deflection`."""
    spring, knee = _LINKS["heel_spring"], _LINKS["knee"]
    rod, base = _RODS["achilles_rod"], np.array(_LINKS["achilles_rod"].position)
    loop = HeelLoop()
    for joint in ("knee", "shin", "tarsus"):
        loop.records[joint] = _LINKS[joint].position[:2]
    loop.knee_turn = _turn_about_z("knee")
    loop.tarsus_turn = _turn_about_z("knee") + _turn_about_z("tarsus")
    loop.base = base - (0.0, 0.0, knee.position[2])
    loop.heel[:] = spring.position
    axes, pin = link_rotation(spring), _PINS[rod.rod]
    loop.still = axes[:, 2] * pin[2]
    loop.cosine = axes[:, :2] @ pin[:2]
    loop.sine = axes[:, :2] @ (-pin[1], pin[0])
    loop.reach = float(pin @ pin) - rod.length * rod.length
    # In the neutral pose the spring is relaxed: its angle is zero.
    position, rotation = _neutral("heel_spring", "hip_pitch")
    to_base = axes @ rotation.T @ (base - position)
    loop.branch = -math.copysign(1.0, to_base @ loop.sine)
    return loop


_HEEL_LOOP = heel_loop()
_TURNS = {name: link_rotation(link) for name, link in _LINKS.items()}


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
        Heel angle in rad and its derivatives by q4, q5, q6.

    Raises:
        KinematicsError: if the rod does not reach, or an angle is not finite.
    """
    result = heel_deflection(knee, shin, tarsus, _HEEL_LOOP.records[0])
    if not math.isfinite(result[0]):
        if not math.isfinite(knee + shin + tarsus):
            raise KinematicsError(f"leg angles are ({knee}, {shin}, {tarsus}) rad, expected finite")
        raise KinematicsError(
            f"achilles rod does not reach at knee {knee:.3f}, shin {shin:.3f}, "
            f"tarsus {tarsus:.3f} rad"
        )
    return result


def achilles_direction(knee: float, shin: float, tarsus: float) -> FloatArray:
    """Unit vector along the left achilles rod to the heel spring, in hip pitch axes. (3,).

    Raises:
        KinematicsError: if the rod does not reach, or an angle is not finite.
    """
    tip, rotation = np.zeros(3), np.eye(3)
    heel = heel_angle(knee, shin, tarsus)
    for name, angle in (("knee", knee), ("shin", shin), ("tarsus", tarsus), ("heel_spring", heel)):
        link = _LINKS[name]
        tip = tip + rotation @ link.position
        rotation = rotation @ _TURNS[name] @ _about_z(angle - link.joint.zero)
    tip = tip + rotation @ _PINS["achilles_rod"]
    along = tip - _LINKS["achilles_rod"].position
    unit: FloatArray = along / np.linalg.norm(along)
    return unit


def achilles_turn(leg: str, knee: float, shin: float, tarsus: float) -> FloatArray:
    """Rotation of an achilles rod's ball joint, without spin about the rod.

    Args:
        leg: "left" or "right".
        knee: q4. In rad.
        shin: q5. In rad.
        tarsus: q6. In rad.

    Returns:
        Unit quaternion w, x, y, z from the rod's neutral axes, in these axes. Shape (4,).

    Raises:
        KinematicsError: if the rod does not reach, or an angle is not finite.
    """
    x, y, z = _TURNS["achilles_rod"].T @ achilles_direction(knee, shin, tarsus)
    quaternion = np.array([1.0 + x, 0.0, -z, y])
    if leg == "right":
        quaternion[1:3] *= -1.0  # the mirror image in the rod's xy plane
    unit: FloatArray = quaternion / np.linalg.norm(quaternion)
    return unit


def crank_angles(toe: float) -> tuple[float, float]:
    """Angles of the foot crank in the tarsus and of the plantar rod in the crank.

    Args:
        toe: q7. In rad.

    Raises:
        KinematicsError: if the rod does not reach, or the angle is not finite.
    """
    if not -10.0 < toe < 10.0:
        raise KinematicsError(f"toe angle is {toe} rad, expected a finite joint angle")
    crank, length = np.array(_LINKS["foot_crank"].position), _RODS["plantar_rod"].length
    arm = _LINKS["plantar_rod"].position[0]
    pin = _about_z(toe) @ _PINS["plantar_rod"] + _LINKS["toe"].position
    x, y, _ = (pin - crank).tolist()
    reach = (x * x + y * y + arm * arm - length * length) / (2.0 * arm * math.hypot(x, y))
    if not -1.0 <= reach <= 1.0:
        raise KinematicsError(f"plantar rod does not reach at toe {toe:.3f} rad")
    # The crank follows the toe nearly in parallel: of the two solutions, the lower one.
    angle = math.atan2(y, x) - math.acos(reach)
    rod = math.atan2(y - arm * math.sin(angle), x - arm * math.cos(angle))
    return angle, rod - angle
