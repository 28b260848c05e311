"""Force of the ground on a foot from what the leaf springs of its leg give way, on plain floats.

Shin and tarsus are driven by nothing but springs. At rest their torques, the weight of what hangs
below them and the force F on the foot balance in the plane of the leg:

    -dV/dq_i + G_i + J_i F - u_toe = 0,   i = shin, tarsus,
    V = 1/2 k_shin q5^2 + 1/2 k_heel heel(q4, q5, q6)^2

J moves the toe joint; the drive of the toe, u_toe, balances the ground's moment about it. These are
two equations for the two components of F. Inertia is left out, so that a swinging leg shows some
force too.
"""

from __future__ import annotations

import math

from cassie_gaits import linkage, robot
from cassie_gaits.errors import KinematicsError

_LINKS = {link.name: link for link in robot.LEFT_LEG}

SHIN_STIFFNESS = _LINKS["shin"].joint.stiffness
"""In Nm/rad."""

HEEL_STIFFNESS = _LINKS["heel_spring"].joint.stiffness
"""In Nm/rad."""

_GRAVITY = 9.81


def _weights() -> tuple[tuple[float, float, float], tuple[float, float, float], float]:
    """Mass and its first moment in the plane, of shin and of tarsus; mass at the toe joint.

    Foot and crank turn with the toe drive, whose torque takes their moment: they count as masses at
    their joints. Each rod counts as a mass at each end.
    """
    shin, tarsus = _LINKS["shin"], _LINKS["tarsus"]
    masses = [(tarsus.mass, tarsus.com[0], tarsus.com[1])]
    heel = _LINKS["heel_spring"]
    com = linkage.link_rotation(heel) @ heel.com
    masses.append((heel.mass, heel.position[0] + com[0], heel.position[1] + com[1]))
    lengths = {rod.rod: rod.length for rod in robot.RODS}
    shares = {name: _LINKS[name].com[0] / length for name, length in lengths.items()}
    tip = linkage.link_rotation(heel) @ linkage.pin_in_target(robot.RODS[0])
    masses.append(
        (
            _LINKS["achilles_rod"].mass * shares["achilles_rod"],
            heel.position[0] + tip[0],
            heel.position[1] + tip[1],
        )
    )
    crank, plantar = _LINKS["foot_crank"], _LINKS["plantar_rod"].mass
    near = crank.mass + plantar * (1.0 - shares["plantar_rod"])
    masses.append((near, crank.position[0], crank.position[1]))
    total = (
        float(sum(mass for mass, _, _ in masses)),
        float(sum(mass * x for mass, x, _ in masses)),
        float(sum(mass * y for mass, _, y in masses)),
    )
    own = (shin.mass, shin.mass * shin.com[0], shin.mass * shin.com[1])
    return own, total, _LINKS["toe"].mass + plantar * shares["plantar_rod"]


_SHIN, _TARSUS, _TOE_MASS = _weights()


def foot_force(
    torso_pitch: float,
    hip_pitch: float,
    knee: float,
    shin: float,
    tarsus: float,
    toe_torque: float = 0.0,
) -> tuple[float, float]:
    """Force of the ground on the foot in the plane of the leg.

    Args:
        torso_pitch: Pitch of the torso. In rad.
        hip_pitch: q3. In rad.
        knee: q4. In rad.
        shin: q5. In rad.
        tarsus: q6. In rad.
        toe_torque: Of the toe drive at the joint. In Nm.

    Returns:
        Force ahead and force up, as if the torso's roll and yaw and the hip's were zero. In N.

    Raises:
        KinematicsError: if the achilles rod does not reach, shin and tarsus are in line, or an
            angle is not finite.

    Source:
        The paper takes contact from the springs' deflection without a formula; its heel
        deflection q4 + q5 + q6 - 13 degrees (eq:SpringJacobian) is not used: see `linkage`.
    """
    heel, _, heel_by_shin, heel_by_tarsus = linkage.heel_angle_and_slopes(knee, shin, tarsus)
    lower = knee + shin + linkage.KNEE_TURN
    foot = knee + shin + tarsus + linkage.TARSUS_TURN
    cos_l, sin_l = math.cos(lower), math.sin(lower)
    cos_f, sin_f = math.cos(foot), math.sin(foot)
    # Toe joint from the tarsus axis and from the shin axis, in hip pitch axes.
    toe_x = cos_f * linkage.TOE_X - sin_f * linkage.TOE_Y
    toe_y = sin_f * linkage.TOE_X + cos_f * linkage.TOE_Y
    span_x = cos_l * linkage.TARSUS_X - sin_l * linkage.TARSUS_Y
    span_y = sin_l * linkage.TARSUS_X + cos_l * linkage.TARSUS_Y
    reach_x, reach_y = span_x + toe_x, span_y + toe_y
    # Weight along these axes, and its moments about tarsus axis and shin axis.
    lean = hip_pitch - torso_pitch
    ahead_x, ahead_y = math.sin(lean), math.cos(lean)
    weight_x, weight_y = _GRAVITY * ahead_y, -_GRAVITY * ahead_x
    mass, moment_x, moment_y = _TARSUS
    x = cos_f * moment_x - sin_f * moment_y + _TOE_MASS * toe_x
    y = sin_f * moment_x + cos_f * moment_y + _TOE_MASS * toe_y
    about_tarsus = x * weight_y - y * weight_x
    mass += _TOE_MASS
    x += cos_l * _SHIN[1] - sin_l * _SHIN[2] + mass * span_x
    y += sin_l * _SHIN[1] + cos_l * _SHIN[2] + mass * span_y
    about_shin = x * weight_y - y * weight_x
    torque = HEEL_STIFFNESS * heel
    shin_needs = SHIN_STIFFNESS * shin + torque * heel_by_shin + toe_torque - about_shin
    tarsus_needs = torque * heel_by_tarsus + toe_torque - about_tarsus
    # reach_x F_y - reach_y F_x = shin_needs; toe_x F_y - toe_y F_x = tarsus_needs.
    determinant = toe_x * reach_y - toe_y * reach_x
    if abs(determinant) < 1e-3:
        raise KinematicsError(f"shin and tarsus are in line at tarsus {tarsus:.3f} rad")
    force_x = (reach_x * tarsus_needs - toe_x * shin_needs) / determinant
    force_y = (reach_y * tarsus_needs - toe_y * shin_needs) / determinant
    return force_x * ahead_x + force_y * ahead_y, force_y * ahead_x - force_x * ahead_y
