"""Joint angles and torso attitude from outputs and passive coordinates, in closed form.

The right foot is level along the world's x axis on ground that rises by `slope` ahead, free
to roll about the middle line of its sole. Nine outputs and two passive coordinates then
determine every joint.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from cassie_gaits import robot
from cassie_gaits.gait_library import OUTPUTS, PASSIVE
from cassie_gaits.optimize import bodies, rods
from cassie_gaits.optimize.bodies import CHAIN
from cassie_gaits.optimize.inverse_dynamics import foot_frame
from cassie_gaits.virtual_leg import HIP_OFFSET, KNEE_OFFSET, SHIN, THIGH, TOE_OFFSET

COORDINATES = (*OUTPUTS, *PASSIVE)
"""The eleven coordinates of a step: the nine outputs, then the two passive coordinates."""

SIZE = len(COORDINATES)
_AT = {name: i for i, name in enumerate(COORDINATES)}


@dataclass(frozen=True)
class Posture:
    """One posture in a step.

    Attributes:
        stance, swing: Angles of hip_roll, hip_yaw, hip_pitch, knee, toe. Shape (5, 1), in rad.
        torso: Yaw, pitch and roll. Shape (3, 1), in rad.
        foot_to_ground: Rotation of the level stance foot (ahead, left, up) to the world. (3, 3).
    """

    stance: ca.SX
    swing: ca.SX
    torso: ca.SX
    foot_to_ground: ca.SX


def posture(y: ca.SX, slope: ca.SX) -> Posture:
    """Posture at coordinates `y`, of shape (11, 1) in the order of `COORDINATES`.

    Source:
        eq:IK with its errata for knee, hip pitch and toe. Torso yaw, stance hip roll and the
        stance foot follow from R_torso = R_foot Ry(foot pitch) Rz(-q2) Rx(-q1) with the foot's
        attitude given.
    """
    roll, pitch = y[_AT["torso_roll"]], y[_AT["torso_pitch"]]
    yaw_st, yaw_sw = y[_AT["stance_hip_yaw"]], y[_AT["swing_hip_yaw"]]
    ground = ca.mtimes(_about_y(-slope), about_x(y[_AT["stance_foot_roll"]]))
    row = ground[2, :]
    lift = (ca.sin(pitch) - row[1] * ca.sin(yaw_st)) / ca.cos(yaw_st)
    reach = ca.sqrt(row[0] ** 2 + row[2] ** 2)
    bend_st = ca.atan2(row[0], row[2]) + ca.asin(lift / reach)
    hip = ca.mtimes([ground, _about_y(bend_st), rods.about_z(-yaw_st)])
    roll_st = ca.atan2(hip[2, 1], hip[2, 2]) - roll
    torso_yaw = ca.atan2(hip[1, 0], hip[0, 0])

    knee_st, lean_st = knee_and_lean(y[_AT["stance_leg_length"]])
    pitch_st = y[_AT["stance_leg_pitch"]] + pitch + lean_st - HIP_OFFSET
    toe_st = bend_st - pitch_st - robot.NEUTRAL_TARSUS - TOE_OFFSET
    knee_sw, lean_sw = knee_and_lean(y[_AT["swing_leg_length"]])
    pitch_sw = y[_AT["swing_leg_pitch"]] + pitch + lean_sw - HIP_OFFSET
    foot_sw = y[_AT["swing_foot_pitch"]]
    toe_sw = foot_sw + pitch - pitch_sw - robot.NEUTRAL_TARSUS - TOE_OFFSET
    roll_sw = y[_AT["swing_leg_roll"]] - roll
    return Posture(
        ca.vertcat(roll_st, yaw_st, pitch_st, knee_st, toe_st),
        ca.vertcat(roll_sw, yaw_sw, pitch_sw, knee_sw, toe_sw),
        ca.vertcat(torso_yaw, pitch, roll),
        ground,
    )


def knee_and_lean(length: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Knee angle, and angle at the hip between thigh and virtual leg, as in `virtual_leg`."""
    cosine = (length**2 - THIGH**2 - SHIN**2) / (2.0 * THIGH * SHIN)
    knee = -ca.acos(cosine) - KNEE_OFFSET
    return knee, ca.acos((length**2 + THIGH**2 - SHIN**2) / (2.0 * THIGH * length))


def places(at: Posture) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Pelvis and swing sole relative to the stance sole, and the swing foot's attitude.

    Returns:
        Positions in the world of shape (3, 1) in m, and the rotation of the level swing foot
        (ahead, left, up) to the world. Shape (3, 3).
    """
    torso = ca.mtimes([rods.about_z(at.torso[0]), _about_y(at.torso[1]), about_x(at.torso[2])])
    stance, _ = _sole_in_pelvis("right", at.stance)
    swing, attitude = _sole_in_pelvis("left", at.swing)
    pelvis = ca.mtimes(torso, -stance)
    foot = ca.mtimes([torso, attitude, ca.DM(foot_frame())])
    return pelvis, pelvis + ca.mtimes(torso, swing), foot


def _sole_in_pelvis(leg: str, joints: ca.SX) -> tuple[ca.SX, ca.SX]:
    numbers = bodies.leg(leg)
    roll, yaw, pitch, knee, toe = (joints[i] for i in range(5))
    angles = (roll, yaw, pitch, knee, robot.NEUTRAL_TARSUS - knee, toe)
    position, rotation = ca.SX.zeros(3), ca.SX.eye(3)
    for name, angle in zip(CHAIN, angles, strict=True):
        hinge = numbers.hinges[name]
        position += ca.mtimes(rotation, ca.DM(hinge.position))
        turn = ca.mtimes(ca.DM(hinge.rotation), rods.about_z(angle - hinge.zero))
        rotation = ca.mtimes(rotation, turn)
    return position + ca.mtimes(rotation, ca.DM(numbers.sole)), rotation


def about_x(angle: ca.SX) -> ca.SX:
    """Rotation about x. Shape (3, 3)."""
    c, s = ca.cos(angle), ca.sin(angle)
    return ca.vertcat(ca.horzcat(1.0, 0.0, 0.0), ca.horzcat(0.0, c, -s), ca.horzcat(0.0, s, c))


def _about_y(angle: ca.SX) -> ca.SX:
    c, s = ca.cos(angle), ca.sin(angle)
    return ca.vertcat(ca.horzcat(c, 0.0, s), ca.horzcat(0.0, 1.0, 0.0), ca.horzcat(-s, 0.0, c))
