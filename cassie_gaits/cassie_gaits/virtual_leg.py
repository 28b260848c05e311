"""The virtual leg: from the hip pitch axis to the toe joint, for one leg, on plain floats.

Functions for a control tick are compiled, for Python and for other compiled functions.

With relaxed springs (eq:SpringRelaxed) the tarsus is at 13 degrees to the thigh. So two sides of
constant length connect hip and toe joint: thigh with tarsus, and shin. Length and pitch of the
virtual leg follow from the law of cosines.

Signs: `pitch` and `roll` of the torso are the Euler angles of eq:qdef (pitch > 0 is nose down,
roll > 0 is right side down); leg pitch > 0 puts the toe in front of the hip; leg roll > 0 puts the
toe to the left; foot pitch > 0 lifts its tip. All angles in rad, lengths in m, rates per second.
"""

from __future__ import annotations

import math

from cassie_gaits import robot
from cassie_gaits.compiled import compiled
from cassie_gaits.errors import LegLengthError

THIGH = 0.5292
"""Side of thigh plus tarsus, from the hip pitch axis to the toe joint without the shin. In m."""

SHIN = 0.5
"""Side from the knee axis to the tarsus axis. In m."""

KNEE_OFFSET = 0.035
"""Knee angle at which the sides are parallel, negated. In rad."""

HIP_OFFSET = 0.1
"""Leg pitch of the side `THIGH` when hip pitch and torso pitch are zero. In rad."""

TOE_OFFSET = math.radians(50.0)
"""Foot pitch when all joint angles between torso and foot are zero. In rad."""

SHORTEST = THIGH - SHIN
"""Leg length with folded sides, which the stops prevent. In m."""

LONGEST = THIGH + SHIN
"""Leg length with stretched sides, which the stops prevent. In m."""

_SUM_OF_SQUARES = THIGH * THIGH + SHIN * SHIN
_PRODUCT = 2.0 * THIGH * SHIN


@compiled
def length(knee: float) -> float:
    """Leg length.

    Source:
        Fourth and eighth row of eq:AbsolteQuantities. The print rounds 0.5292^2 + 0.5^2 up to
        0.5301, 0.03 mm of leg length at 0.8 m; here every formula follows from the two sides, so
        that functions and their inverses are exact.
    """
    return math.sqrt(_SUM_OF_SQUARES + _PRODUCT * math.cos(knee + KNEE_OFFSET))


@compiled
def length_rate(knee: float, knee_rate: float) -> float:
    """Time derivative of `length`. In m/s."""
    bend = knee + KNEE_OFFSET
    return (
        -0.5
        * _PRODUCT
        * math.sin(bend)
        / math.sqrt(_SUM_OF_SQUARES + _PRODUCT * math.cos(bend))
        * knee_rate
    )


@compiled
def lean(knee: float) -> float:
    """Angle at the hip between the side `THIGH` and the virtual leg, >= 0 for a bent knee."""
    bend = knee + KNEE_OFFSET
    return math.atan2(-SHIN * math.sin(bend), SHIN * math.cos(bend) + THIGH)


@compiled
def pitch(torso_pitch: float, hip_pitch: float, knee: float) -> float:
    """Leg pitch against the vertical, in the plane of the leg.

    Source:
        Seventh row of eq:AbsolteQuantities with arccos((0.5 c + 0.5292) / LL); the print has the
        bracket in the wrong place (README, Errata). The inverse tangent here gives the same
        angle and is exact also for a nearly straight leg.
    """
    return -torso_pitch + hip_pitch - lean(knee) + HIP_OFFSET


@compiled
def pitch_rate(
    knee: float, torso_pitch_rate: float, hip_pitch_rate: float, knee_rate: float
) -> float:
    """Time derivative of `pitch`. In rad/s."""
    cosine = math.cos(knee + KNEE_OFFSET)
    share = SHIN * (SHIN + THIGH * cosine) / (_SUM_OF_SQUARES + _PRODUCT * cosine)
    return -torso_pitch_rate + hip_pitch_rate + share * knee_rate


@compiled
def roll(torso_roll: float, hip_roll: float) -> float:
    """Leg roll. Source: fifth row of eq:AbsolteQuantities."""
    return torso_roll + hip_roll


@compiled
def foot_pitch(
    torso_pitch: float,
    hip_pitch: float,
    toe: float,
    thigh_to_tarsus: float = robot.NEUTRAL_TARSUS,
) -> float:
    """Foot pitch against the ground, in the plane of the leg; tip up is positive.

    Args:
        torso_pitch: Pitch of the torso.
        hip_pitch: q3.
        toe: q7.
        thigh_to_tarsus: q4 + q5 + q6; 13 degrees with relaxed springs. Pass the measured sum
            to include the springs' deflection.

    Source:
        Last row of eq:AbsolteQuantities. The print leaves q3 out and rounds 63 degrees to 1.1
        (README, Errata).
    """
    return -torso_pitch + hip_pitch + thigh_to_tarsus + toe + TOE_OFFSET


def knee_angle(leg_length: float) -> float:
    """Knee angle that gives the leg length, in [-pi - 0.035, -0.035].

    Raises:
        LegLengthError: if no knee angle does, or `leg_length` is not a number.

    Source:
        Third row of eq:IK. The print has the positive inverse cosine; Cassie's knee bends
        negative, so this is the other branch (README, Errata).
    """
    if not SHORTEST <= leg_length <= LONGEST:
        raise LegLengthError.outside(leg_length, SHORTEST, LONGEST)
    return nearest_knee_angle(leg_length)


@compiled
def nearest_knee_angle(leg_length: float) -> float:
    """`knee_angle` for any number, which is clamped to the range of leg lengths."""
    cosine = (leg_length * leg_length - _SUM_OF_SQUARES) / _PRODUCT
    return -math.acos(min(1.0, max(-1.0, cosine))) - KNEE_OFFSET


@compiled
def knee_rate(knee: float, leg_length: float, leg_length_rate: float) -> float:
    """Knee rate that gives the rate of leg length; `knee` is `knee_angle(leg_length)`.

    At the ends of the range no knee rate gives a rate of leg length; `clamp_length` avoids these
    ends.
    """
    return -leg_length * leg_length_rate / (0.5 * _PRODUCT * math.sin(knee + KNEE_OFFSET))


def hip_pitch_angle(leg_pitch: float, torso_pitch: float, leg_length: float) -> float:
    """Hip pitch angle q3 that gives leg pitch at this leg length.

    Raises:
        LegLengthError: as `knee_angle`.

    Source:
        Second row of eq:IK, with (0.9448 LL^2 + 0.0284) / LL: the print has the wrong sign there
        and in eq:hdtilde, whose row 7 also has the wrong sign at 0.1 (README, Errata).
    """
    return leg_pitch + torso_pitch + lean(knee_angle(leg_length)) - HIP_OFFSET


@compiled
def hip_pitch_rate(
    knee: float, leg_pitch_rate: float, torso_pitch_rate: float, knee_rate_: float
) -> float:
    """Hip pitch rate that gives the rate of leg pitch while the knee moves. In rad/s."""
    return leg_pitch_rate - pitch_rate(knee, torso_pitch_rate, 0.0, knee_rate_)


@compiled
def toe_angle(
    pitch_of_foot: float,
    torso_pitch: float,
    hip_pitch: float,
    thigh_to_tarsus: float = robot.NEUTRAL_TARSUS,
) -> float:
    """Toe angle q7 that gives the foot pitch; the inverse of `foot_pitch`.

    Source:
        Last row of eq:IK with q3 and 63 degrees (README, Errata).
    """
    return pitch_of_foot + torso_pitch - hip_pitch - thigh_to_tarsus - TOE_OFFSET


def _limits(joint: str) -> tuple[float, float]:
    limits = next(link.joint.limits for link in robot.LEFT_LEG if link.name == joint)
    if limits is None:
        raise TypeError(f"joint {joint} has no stops")
    return limits


# With relaxed springs the tarsus reaches its stops at these knee angles.
_KNEE_LOW = max(_limits("knee")[0], robot.NEUTRAL_TARSUS - _limits("tarsus")[1])
_KNEE_HIGH = min(_limits("knee")[1], robot.NEUTRAL_TARSUS - _limits("tarsus")[0])

LENGTH_LIMITS = (length(_KNEE_LOW), length(_KNEE_HIGH))
"""Leg lengths at the stops of knee and tarsus, about 0.225 and 0.982. In m."""


def clamp_length(
    leg_length: float, low: float = LENGTH_LIMITS[0], high: float = LENGTH_LIMITS[1]
) -> float:
    """A leg length, clamped to the stops, for set-points."""
    return min(high, max(low, leg_length))
