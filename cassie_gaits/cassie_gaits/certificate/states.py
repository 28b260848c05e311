"""States of the robot from a gait's coefficients: q and v from outputs and passive motion.

The stance foot is at the world's origin, along the x axis. Newton's method finds torso yaw, stance
hip roll and stance toe from the foot's attitude; all other joints follow from eq:IK.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from cassie_gaits import virtual_leg
from cassie_gaits.certificate.walker import Walker
from cassie_gaits.dynamics import RIGID, rigid_pose
from cassie_gaits.errors import GaitLibraryError, KinematicsError
from cassie_gaits.gait_library import STANCES, Gait
from cassie_gaits.names import DRIVES, LEGS
from cassie_gaits.records import FloatArray

YAW, PITCH, ROLL = 3, 4, 5
_NEWTON_STEPS = 30


def drive(leg: str, joint: str) -> int:
    """Index of a drive's joint in a rigid vector."""
    return 6 + DRIVES.index(f"{leg}_{joint}")


def legs(domain: int) -> tuple[str, str]:
    """Stance and swing leg of a domain."""
    stance = STANCES[domain].removesuffix("_stance")
    return stance, LEGS[1 - LEGS.index(stance)]


def curves(gait: Gait, domain: int, phase: float, order: int = 0) -> FloatArray:
    """The nine outputs and two passive coordinates, or a time derivative of them. Shape (11,)."""
    if gait.passive is None:
        raise GaitLibraryError("it has no passive motion to check")
    parts = (gait.coefficients[domain], gait.passive[domain])
    values = np.concatenate([polynomial(part, phase, order) for part in parts])
    result: FloatArray = values / gait.step_time**order
    return result


def polynomial(coefficients: FloatArray, phase: float, order: int = 0) -> FloatArray:
    """Bezier polynomials of any degree, one per row, or a derivative with respect to phase."""
    rows = coefficients
    for _ in range(order):
        rows = (rows.shape[1] - 1) * np.diff(rows, axis=1)
    degree = rows.shape[1] - 1
    powers = np.arange(degree + 1)
    basis = _binomials(degree) * phase**powers * (1.0 - phase) ** powers[::-1]
    result: FloatArray = rows @ basis
    return result


@cache
def _binomials(degree: int) -> FloatArray:
    return np.array([math.comb(degree, i) for i in range(degree + 1)], dtype=np.float64)


def torques(gait: Gait, domain: int, phase: float) -> FloatArray:
    """Torques of the drives. Shape (10,), in Nm."""
    if gait.torques is None:
        raise GaitLibraryError("it has no torques to check")
    return polynomial(gait.torques[domain], phase)


def state(walker: Walker, gait: Gait, domain: int, phase: float) -> tuple[FloatArray, FloatArray]:
    """q and v at a phase. Shape (20,) each.

    Raises:
        GaitLibraryError: if no posture has these outputs.
    """
    try:
        q = _posture(walker, domain, curves(gait, domain, phase))
    except KinematicsError as error:
        raise GaitLibraryError(f"no posture at phase {phase:.3f}: {error}") from None
    return q, _velocity(walker, domain, q, curves(gait, domain, phase, 1))


def outputs(domain: int, q: FloatArray) -> FloatArray:
    """The nine outputs of eq:h0 at q. Shape (9,)."""
    stance, swing = legs(domain)
    at = {name: i for i, name in enumerate(("hip_roll", "hip_yaw", "hip_pitch", "knee", "shin"))}
    first = {leg: 6 + 7 * LEGS.index(leg) for leg in LEGS}
    st, sw = q[first[stance] :][:7], q[first[swing] :][:7]
    return np.array(
        [
            q[ROLL],
            st[at["hip_yaw"]],
            q[PITCH],
            virtual_leg.length(st[at["knee"]]),
            virtual_leg.roll(q[ROLL], sw[at["hip_roll"]]),
            sw[at["hip_yaw"]],
            virtual_leg.pitch(q[PITCH], sw[at["hip_pitch"]], sw[at["knee"]]),
            virtual_leg.length(sw[at["knee"]]),
            virtual_leg.foot_pitch(q[PITCH], sw[at["hip_pitch"]], sw[6]),
        ]
    )


def _posture(walker: Walker, domain: int, y: FloatArray) -> FloatArray:
    stance, swing = legs(domain)
    roll, yaw_st, pitch, length_st, roll_sw, yaw_sw, pitch_sw, length_sw, foot, tilt, lean = y
    rigid = np.zeros(16)
    rigid[[PITCH, ROLL]] = pitch, roll
    for leg, hip_roll, hip_yaw, leg_pitch, length in (
        (stance, -roll, yaw_st, lean, length_st),
        (swing, roll_sw - roll, yaw_sw, pitch_sw, length_sw),
    ):
        hip = virtual_leg.hip_pitch_angle(leg_pitch, pitch, length)
        toe = virtual_leg.toe_angle(foot, pitch, hip)
        angles = (hip_roll, hip_yaw, hip, virtual_leg.knee_angle(length), toe)
        rigid[drive(leg, "hip_roll") :][:5] = angles
    return _stand(walker, stance, rigid, tilt)


def _stand(walker: Walker, stance: str, rigid: FloatArray, tilt: float) -> FloatArray:
    """Rotate and shift the robot so that the stance foot has its required pose."""
    c, s = math.cos(tilt), math.sin(tilt)
    target = walker.ground_axes() @ np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    free = [YAW, drive(stance, "hip_roll"), drive(stance, "toe")]
    for _ in range(_NEWTON_STEPS):
        q = rigid_pose(rigid[:6], rigid[6:])
        position, attitude = walker.tree.sole(q, stance)
        turn = target @ attitude.T
        error = 0.5 * np.array(
            [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
        )
        if np.abs(error).max() < 1e-13:
            break
        jacobian = walker.tree.sole_jacobian(q, stance)
        rigid[free] += np.linalg.solve(jacobian[3:, free], error)
    else:
        raise GaitLibraryError("the stance foot cannot stand level")
    rigid[:3] -= position
    return rigid_pose(rigid[:6], rigid[6:])


def _velocity(walker: Walker, domain: int, q: FloatArray, rates: FloatArray) -> FloatArray:
    """v for given rates of outputs and passive coordinates, while the stance foot only rolls."""
    stance, swing = legs(domain)
    rows, target = np.zeros((16, 16)), np.zeros(16)
    rows[:6] = walker.tree.sole_jacobian(q, stance)
    target[3:6] = rates[9] * walker.ground_axes()[:, 0]
    rows[6, ROLL] = rows[8, PITCH] = 1.0
    rows[7, drive(stance, "hip_yaw")] = rows[11, drive(swing, "hip_yaw")] = 1.0
    rows[10, [ROLL, drive(swing, "hip_roll")]] = 1.0
    knee = {leg: float(q[6 + 7 * LEGS.index(leg) + 3]) for leg in LEGS}
    for leg, length_row, pitch_row in ((stance, 9, 15), (swing, 13, 12)):
        bend = drive(leg, "knee")
        rows[length_row, bend] = virtual_leg.length_rate(knee[leg], 1.0)
        rows[pitch_row, [PITCH, drive(leg, "hip_pitch")]] = -1.0, 1.0
        rows[pitch_row, bend] = virtual_leg.pitch_rate(knee[leg], 0.0, 0.0, 1.0)
    rows[14, [PITCH, drive(swing, "hip_pitch"), drive(swing, "toe")]] = -1.0, 1.0, 1.0
    target[6:15], target[15] = rates[:9], rates[10]
    result: FloatArray = RIGID @ np.linalg.solve(rows, target)
    return result
