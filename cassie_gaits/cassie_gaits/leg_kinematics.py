"""Leg length, leg pitch, leg roll and foot pitch of both legs, and the way back to the joints.

Arrays are of shape (2,), left then right. Angles in rad, lengths in m, rates per second. The
formulas, their sources and where they depart from the paper's print are in `virtual_leg`, which
serves one leg on plain floats and is what a control loop calls.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from cassie_gaits import robot, virtual_leg
from cassie_gaits.errors import KinematicsError, LegLengthError
from cassie_gaits.names import LEGS

FloatArray = npt.NDArray[np.float64]
Pair = tuple[float, float]


def leg_length(knee: npt.ArrayLike) -> FloatArray:
    """Distance from hip to top of foot.

    Args:
        knee: q4. Shape (2,), in rad.

    Returns:
        Leg lengths. Shape (2,), in m.

    Raises:
        KinematicsError: if `knee` is not of shape (2,) or not finite.

    Source:
        Fourth and eighth row of eq:AbsolteQuantities.
    """
    return _both([virtual_leg.length(angle) for angle in _pair(knee, "knee")])


def leg_length_rate(knee: npt.ArrayLike, knee_rate: npt.ArrayLike) -> FloatArray:
    """Time derivative of `leg_length`. Shape (2,), in m/s."""
    rows = zip(_pair(knee, "knee"), _pair(knee_rate, "knee_rate"), strict=True)
    return _both([virtual_leg.length_rate(*row) for row in rows])


def leg_pitch(pitch: float, hip_pitch: npt.ArrayLike, knee: npt.ArrayLike) -> FloatArray:
    """Angle of each virtual leg to the vertical; a toe in front of its hip is positive.

    Args:
        pitch: Torso pitch of eq:qdef. In rad.
        hip_pitch: q3. Shape (2,), in rad.
        knee: q4. Shape (2,), in rad.

    Returns:
        Leg pitches. Shape (2,), in rad.

    Raises:
        KinematicsError: if an array is not of shape (2,) or not finite.

    Source:
        Seventh row of eq:AbsolteQuantities with its bracket put right (README, Errata).
    """
    rows = zip(_pair(hip_pitch, "hip_pitch"), _pair(knee, "knee"), strict=True)
    return _both([virtual_leg.pitch(pitch, hip, bend) for hip, bend in rows])


def leg_pitch_rate(
    knee: npt.ArrayLike,
    pitch_rate: float,
    hip_pitch_rate: npt.ArrayLike,
    knee_rate: npt.ArrayLike,
) -> FloatArray:
    """Time derivative of `leg_pitch`. Shape (2,), in rad/s."""
    rows = zip(
        _pair(knee, "knee"),
        _pair(hip_pitch_rate, "hip_pitch_rate"),
        _pair(knee_rate, "knee_rate"),
        strict=True,
    )
    return _both([virtual_leg.pitch_rate(bend, pitch_rate, hip, rate) for bend, hip, rate in rows])


def leg_roll(roll: float, hip_roll: npt.ArrayLike) -> FloatArray:
    """Angle of each leg to the vertical seen from behind; a foot to the left is positive.

    Source:
        Fifth row of eq:AbsolteQuantities.
    """
    return _both([virtual_leg.roll(roll, hip) for hip in _pair(hip_roll, "hip_roll")])


def foot_pitch(
    pitch: float,
    hip_pitch: npt.ArrayLike,
    toe: npt.ArrayLike,
    thigh_to_tarsus: npt.ArrayLike = (robot.NEUTRAL_TARSUS, robot.NEUTRAL_TARSUS),
) -> FloatArray:
    """Angle of each foot to the ground; the tip up is positive.

    Args:
        pitch: Torso pitch of eq:qdef. In rad.
        hip_pitch: q3. Shape (2,), in rad.
        toe: q7. Shape (2,), in rad.
        thigh_to_tarsus: q4 + q5 + q6, 13 degrees with relaxed springs. Shape (2,), in rad.

    Returns:
        Foot pitches. Shape (2,), in rad.

    Raises:
        KinematicsError: if an array is not of shape (2,) or not finite.

    Source:
        Last row of eq:AbsolteQuantities with q3 and 63 degrees (README, Errata).
    """
    rows = zip(
        _pair(hip_pitch, "hip_pitch"),
        _pair(toe, "toe"),
        _pair(thigh_to_tarsus, "thigh_to_tarsus"),
        strict=True,
    )
    return _both([virtual_leg.foot_pitch(pitch, *row) for row in rows])


def knee_angle(length: npt.ArrayLike) -> FloatArray:
    """Knee angle that gives each virtual leg the requested length.

    Args:
        length: Distance from hip to top of foot. Shape (2,), in m.

    Returns:
        q4. Shape (2,), in rad, in [-pi - 0.035, -0.035]: a more negative knee is a shorter leg.

    Raises:
        LegLengthError: if `length` is not of shape (2,), or no knee angle reaches it; the
            message names the leg, the value and the reachable range.

    Source:
        Third row of eq:IK. The paper prints the positive inverse cosine; Cassie's knee bends
        negative, so this is the other branch (README, Errata).
    """
    return _both([virtual_leg.knee_angle(value) for value in _lengths(length)])


def knee_angle_rate(length: npt.ArrayLike, length_rate: npt.ArrayLike) -> FloatArray:
    """Time derivative of `knee_angle` for a rate of leg length. Shape (2,), in rad/s.

    Raises:
        LegLengthError: as `knee_angle`, and where the leg is folded or stretched: no knee rate
            gives a rate of length there.
    """
    rates = []
    for leg, value, rate in zip(
        LEGS, _lengths(length), _pair(length_rate, "length_rate"), strict=True
    ):
        if not virtual_leg.SHORTEST < value < virtual_leg.LONGEST:
            raise LegLengthError(f"{leg} leg length {value:.4f} m is singular: it has no rate")
        rates.append(virtual_leg.knee_rate(virtual_leg.knee_angle(value), value, rate))
    return _both(rates)


def hip_pitch_angle(leg_pitch: npt.ArrayLike, pitch: float, length: npt.ArrayLike) -> FloatArray:
    """Hip pitch that gives each leg its pitch at its length.

    Args:
        leg_pitch: Wanted leg pitches. Shape (2,), in rad.
        pitch: Torso pitch of eq:qdef. In rad.
        length: Leg lengths. Shape (2,), in m.

    Returns:
        q3. Shape (2,), in rad.

    Raises:
        KinematicsError: if an array is not of shape (2,) or not finite.
        LegLengthError: as `knee_angle`.

    Source:
        Second row of eq:IK with + 0.0284 (README, Errata).
    """
    rows = zip(_pair(leg_pitch, "leg_pitch"), _lengths(length), strict=True)
    return _both([virtual_leg.hip_pitch_angle(angle, pitch, value) for angle, value in rows])


def hip_pitch_angle_rate(
    length: npt.ArrayLike,
    leg_pitch_rate: npt.ArrayLike,
    pitch_rate: float,
    length_rate: npt.ArrayLike,
) -> FloatArray:
    """Time derivative of `hip_pitch_angle`. Shape (2,), in rad/s.

    Raises:
        LegLengthError: as `knee_angle_rate`.
    """
    rows = zip(
        knee_angle(length).tolist(),
        _pair(leg_pitch_rate, "leg_pitch_rate"),
        knee_angle_rate(length, length_rate).tolist(),
        strict=True,
    )
    return _both(
        [virtual_leg.hip_pitch_rate(bend, leg, pitch_rate, rate) for bend, leg, rate in rows]
    )


def toe_angle(
    foot_pitch: npt.ArrayLike,
    pitch: float,
    hip_pitch: npt.ArrayLike,
    thigh_to_tarsus: npt.ArrayLike = (robot.NEUTRAL_TARSUS, robot.NEUTRAL_TARSUS),
) -> FloatArray:
    """Toe angle that gives each foot its pitch: the inverse of `foot_pitch`.

    Returns:
        q7. Shape (2,), in rad.

    Source:
        Last row of eq:IK with q3 and 63 degrees (README, Errata).
    """
    rows = zip(
        _pair(foot_pitch, "foot_pitch"),
        _pair(hip_pitch, "hip_pitch"),
        _pair(thigh_to_tarsus, "thigh_to_tarsus"),
        strict=True,
    )
    return _both([virtual_leg.toe_angle(foot, pitch, hip, sum_) for foot, hip, sum_ in rows])


def clamp_leg_length(length: npt.ArrayLike) -> FloatArray:
    """The nearest leg lengths between the stops of knee and tarsus, for set-points.

    Raises:
        LegLengthError: if `length` is not of shape (2,) or not finite.
    """
    return _both(
        [virtual_leg.clamp_length(value) for value in _pair(length, "length", LegLengthError)]
    )


def _both(values: list[float]) -> FloatArray:
    return np.array(values, dtype=np.float64)


def _pair(values: npt.ArrayLike, name: str, error: type[KinematicsError] = KinematicsError) -> Pair:
    array = np.asarray(values, dtype=np.float64)
    if array.shape != (2,):
        raise error(f"{name} has shape {array.shape}, expected (2,): left and right")
    left, right = array.tolist()
    if not (math.isfinite(left) and math.isfinite(right)):
        raise error(f"{name} is ({left}, {right}), expected finite numbers")
    return left, right


def _lengths(values: npt.ArrayLike) -> Pair:
    pair = _pair(values, "length", LegLengthError)
    for leg, value in zip(LEGS, pair, strict=True):
        if not virtual_leg.SHORTEST <= value <= virtual_leg.LONGEST:
            raise LegLengthError.outside(value, virtual_leg.SHORTEST, virtual_leg.LONGEST, leg)
    return pair
