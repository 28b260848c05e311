"""The robot as the control laws read it: one record, computed once a tick, with names."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np

from cassie_gaits.compiled import compiled
from cassie_gaits.leg import LegPair, place_legs
from cassie_gaits.records import FloatArray, Record, RecordArray, Records, array
from cassie_gaits.robot import FOOT_CONTACTS, LEFT_LEG, NEUTRAL_TARSUS, SOLE_RADIUS
from cassie_gaits.vectors import Vector, turned
from cassie_msgs.layout import RobotState

HIP_ROLL_X, HIP_Y, _ = LEFT_LEG[0].position
"""Left hip roll axis in the pelvis frame; mirrored in y for the right leg. In m."""

HIP_BACK, HIP_DOWN = -LEFT_LEG[1].position[2], -LEFT_LEG[2].position[2]
"""From the hip roll axis back and down to the hip pitch axis, under the yaw axis. In m."""

HIP_X = HIP_ROLL_X - HIP_BACK
HIP_Z = -HIP_DOWN
"""Left hip pitch axis in the pelvis frame with hip roll and yaw at zero. In m."""


def _level_foot() -> tuple[float, float, float]:
    """Half of the sole's length, its middle ahead of the toe joint, and the toe joint's height.

    Returns:
        With a level sole, to 0.1 mm. In m.
    """
    (tip_x, tip_y, _), (heel_x, heel_y, _) = FOOT_CONTACTS
    x, y = tip_x - heel_x, tip_y - heel_y
    length = math.hypot(x, y)
    middle = 0.5 * ((tip_x + heel_x) * x + (tip_y + heel_y) * y) / length
    height = SOLE_RADIUS + abs(tip_x * heel_y - tip_y * heel_x) / length
    return round(0.5 * length, 4), round(middle, 4), round(height, 4)


SOLE_HALF_LENGTH, SOLE_MIDDLE, TOE_JOINT_HEIGHT = _level_foot()

MIN_LEVER = 0.4
"""Least height or leg length by which a law divides, so that a low robot gets no large angles.
In m."""

MAX_LEG_LENGTH = 0.95
"""Longest leg that walking plans: a straighter knee hardly controls the leg's length. In m."""

MAX_COMMANDED_LENGTH = 0.97
"""Longest leg that is commanded, 4 degrees of the knee before its stop: a late touchdown, and
unequal loads while standing, make a leg longer than planned. In m."""


@compiled
def aim_leg(
    x: float, y: float, down: float, hip_yaw: float, torso_pitch: float
) -> tuple[float, float, float]:
    """Leg roll, leg pitch and leg length that put the toe joint at a point.

    Args:
        x, y, down: Point from the hip roll joint, heading frame. In m.
        hip_yaw: Hip yaw angle. In rad.
        torso_pitch: Pitch of the torso. In rad.

    Returns:
        Roll and pitch in rad, as the outputs of eq:h0, and length in m.

    Source:
        Inverse of eq:AbsoluteQuantities with the hip yaw between roll and pitch: the leg lies in a
        plane that the yaw turns about the pelvis's vertical axis.
    """
    c, s = math.cos(torso_pitch), math.sin(torso_pitch)
    forward, low = x * c + down * s + HIP_BACK, down * c - x * s  # pelvis frame, from the yaw axis
    across = forward * math.tan(hip_yaw)
    below = math.sqrt(max(0.04, y * y + low * low - across * across))
    roll = math.atan2(y, low) - math.atan2(across, below)
    along, depth = forward / math.cos(hip_yaw), below - HIP_DOWN
    return roll, math.atan2(along, depth) - torso_pitch, math.hypot(along, depth)


class Robot(Record):
    """The robot as input of the control laws; positions and velocities in the heading frame.

    Attributes:
        height: Pelvis origin above the loaded soles. In m.
        yaw, pitch, roll: Euler angles of the torso. In rad.
        yaw_rate, pitch_rate, roll_rate: Rates of the torso's angles. In rad/s.
        com: Centre of mass from the pelvis origin. In m.
        com_from_feet: Centre of mass from the midpoint of the feet. In m.
        com_velocity: Velocity of the centre of mass. In m/s.
        velocity: Velocity of the pelvis origin. In m/s.
        load: How far each foot is loaded, 0..1: `RobotState.foot_load`.
        force: Vertical force on each foot. In N.
        contact: Probability that each foot is on the ground, 0..1.
        joints: The seven joints of each leg. In rad.
        toe_joint: Toe joint of each leg from the pelvis origin. In m.
        foot: Middle of each sole from the pelvis origin. In m.
        rates: Rates of the joints. In rad/s.
        R_HP: Rotation from the pelvis to the heading frame.
        angular_velocity: Angular velocity of the pelvis, pelvis frame. In rad/s.
    """

    height: float
    yaw: float
    pitch: float
    roll: float
    yaw_rate: float
    pitch_rate: float
    roll_rate: float
    com: FloatArray = array(3)
    com_from_feet: FloatArray = array(3)
    com_velocity: FloatArray = array(3)
    velocity: FloatArray = array(3)
    load: FloatArray = array(2)
    force: FloatArray = array(2)
    contact: FloatArray = array(2)
    joints: FloatArray = array(2, 7)
    toe_joint: FloatArray = array(2, 3)
    foot: FloatArray = array(2, 3)
    rates: FloatArray = array(2, 7)
    R_HP: FloatArray = array(3, 3)
    angular_velocity: FloatArray = array(3)


@compiled
def set_heading_from_pelvis(pitch: float, roll: float, R_HP: FloatArray) -> None:
    """Rotation from pelvis to heading frame, from pitch and roll in rad, into `R_HP` (3, 3)."""
    cp, sp = math.cos(pitch), math.sin(pitch)
    cr, sr = math.cos(roll), math.sin(roll)
    R_HP[0, 0], R_HP[0, 1], R_HP[0, 2] = cp, sp * sr, sp * cr
    R_HP[1, 0], R_HP[1, 1], R_HP[1, 2] = 0.0, cr, -sr
    R_HP[2, 0], R_HP[2, 1], R_HP[2, 2] = -sp, cp * sr, cp * cr


@compiled
def read_robot(
    states: RecordArray,
    com_error: tuple[float, float],
    pairs: Records[LegPair],
    robots: Records[Robot],
) -> None:
    """Compute the inputs of the control laws from a state estimate.

    Args:
        states: `RobotState.record`. Shape (1,).
        com_error: Offset of the CoM from the estimate, forward and to the left. In m.
        pairs: Result, pose of both legs. Shape (1,).
        robots: Result. Shape (1,).
    """
    estimate, pair, robot = states[0], pairs[0], robots[0]
    q, v = estimate.q, estimate.v
    place_legs(q[6:].reshape(2, 7), pair)
    legs = pair.states
    robot.height, robot.yaw, robot.pitch, robot.roll = q[2], q[3], q[4], q[5]
    robot.yaw_rate, robot.pitch_rate, robot.roll_rate = v[3], v[4], v[5]
    set_heading_from_pelvis(q[4], q[5], robot.R_HP)
    for i in range(2):
        for k in range(7):
            robot.joints[i, k], robot.rates[i, k] = q[6 + 7 * i + k], v[6 + 7 * i + k]
        robot.load[i], robot.force[i] = estimate.foot_load[i], estimate.foot_force[i]
        robot.contact[i] = estimate.contact_probability[i]
        toe_joint, foot = turned(robot.R_HP, legs[i].toe_joint), turned(robot.R_HP, legs[i].foot)
        for k in range(3):
            robot.toe_joint[i, k], robot.foot[i, k] = toe_joint[k], foot[k]
    for k in range(3):
        robot.angular_velocity[k] = estimate.angular_velocity[k]
        middle = 0.5 * (robot.foot[0, k] + robot.foot[1, k])
        robot.com_from_feet[k] = estimate.com_position[k]
        robot.com[k] = estimate.com_position[k] + middle
        robot.com_velocity[k] = estimate.com_velocity[k]
    for k in range(2):
        robot.com_from_feet[k] += com_error[k]
        robot.com[k] += com_error[k]
    c, s = math.cos(q[3]), math.sin(q[3])
    robot.velocity[0] = c * v[0] + s * v[1]
    robot.velocity[1] = c * v[1] - s * v[0]
    robot.velocity[2] = v[2]


def _places(first: str, last: str = "", leg: int | None = None) -> slice:
    """Slice of the fields `first` to `last` in a flat `Robot`, all of it or one leg's half."""
    assert Robot.TYPE.fields is not None
    begin = Robot.TYPE.fields[first][1] // 8
    kind, offset = Robot.TYPE.fields[last or first][:2]
    end = (offset + kind.itemsize) // 8
    if leg is None:
        return slice(begin, end)
    each = (end - begin) // 2
    return slice(begin + leg * each, begin + (leg + 1) * each)


_VALUES = struct.Struct(f"{_places('rates').start}d")
"""Numbers that laws in Python read: all up to the joints' rates."""

_HEIGHT_AND_ANGLES = _places("height", "roll_rate")
_COM, _COM_FROM_FEET, _COM_VELOCITY, _VELOCITY = (
    _places(name) for name in ("com", "com_from_feet", "com_velocity", "velocity")
)
_LOAD, _FORCE, _CONTACT, _JOINTS, _TOE_JOINT, _FOOT = (
    [_places(name, leg=leg) for leg in range(2)]
    for name in ("load", "force", "contact", "joints", "toe_joint", "foot")
)


@compiled
def pendulum_height(robot: Robot, stance: int) -> float:
    """Height of the CoM above a toe joint, as the length of a pendulum. In m."""
    height: float = max(MIN_LEVER, robot.com[2] - robot.toe_joint[stance, 2])
    return height


@compiled
def hip_pitch_ahead(robot: Robot) -> float:
    """Distance of the hip pitch axes ahead of the pelvis origin, with level hips. In m."""
    ahead: float = robot.R_HP[0, 0] * HIP_X + robot.R_HP[0, 2] * HIP_Z
    return ahead


@dataclass(slots=True)
class LegReadings:
    """One leg: fields of `Robot` with its part of each.

    Attributes:
        side: 1 for the left leg, -1 for the right.
        toe_jacobian: Of the toe joint's position by the joints, pelvis frame. Shape (3, 7), in
            m/rad.
    """

    side: float
    toe_jacobian: FloatArray
    joints: tuple[float, ...]
    toe_joint: Vector
    foot: Vector
    load: float
    force: float
    contact: float


class Readings:
    """The robot at one tick, for laws in Python as plain numbers.

    numpy reads a number of an array ten times as slowly as Python reads one of a tuple. So all are
    unpacked together, when the first is read after an update: compiled laws, which take `records`,
    need none of them.

    Attributes without a line here are fields of `Robot`.

    Attributes:
        legs: Left and right leg.
        state: The state estimate.
        R_HP: Rotation from pelvis to heading frame. Shape (3, 3).
        records: `Robot`, for compiled functions. Shape (1,).
        pair: Pose of both legs, `leg.LegPair`. Shape (1,).
    """

    height: float
    yaw: float
    pitch: float
    roll: float
    yaw_rate: float
    pitch_rate: float
    roll_rate: float
    com: Vector
    com_from_feet: Vector
    com_velocity: Vector
    velocity: Vector
    legs: tuple[LegReadings, LegReadings]

    def __init__(self) -> None:
        robot, pair = Robot(), LegPair()
        self.records = robot.records
        self.pair = pair.records
        self.R_HP: FloatArray = robot.R_HP
        self.state = RobotState()
        self._toe_jacobians = pair.records["states"]["toe_jacobian"][0]
        self._memory = self.records.view(np.uint8).data
        self._bare = dict(self.__dict__)

    def update(self, state: RobotState, com_error: tuple[float, float] = (0.0, 0.0)) -> None:
        """Update with a state estimate.

        Args:
            state: The state estimate.
            com_error: Offset of the CoM from the estimate, forward and to the left. In m.
        """
        self.__dict__ = {**self._bare, "_bare": self._bare, "state": state}
        read_robot(state.record, com_error, self.pair, self.records)

    def __getattr__(self, name: str) -> Any:
        if name not in type(self).__annotations__:
            raise AttributeError(f"{type(self).__name__} has no {name}")
        self._unpack()
        return self.__dict__[name]

    def _unpack(self) -> None:
        values = _VALUES.unpack_from(self._memory)
        self.height, *angles = values[_HEIGHT_AND_ANGLES]
        self.yaw, self.pitch, self.roll, self.yaw_rate, self.pitch_rate, self.roll_rate = angles
        self.com, self.com_from_feet = values[_COM], values[_COM_FROM_FEET]
        self.com_velocity, self.velocity = values[_COM_VELOCITY], values[_VELOCITY]
        self.legs = self._leg(0, values), self._leg(1, values)

    def _leg(self, i: int, values: tuple[Any, ...]) -> LegReadings:
        (load,), (force,), (contact,) = values[_LOAD[i]], values[_FORCE[i]], values[_CONTACT[i]]
        joints, toe_joint, foot = values[_JOINTS[i]], values[_TOE_JOINT[i]], values[_FOOT[i]]
        jacobian = self._toe_jacobians[i]
        return LegReadings(1.0 - 2.0 * i, jacobian, joints, toe_joint, foot, load, force, contact)

    @property
    def time(self) -> float:
        """Stamp of the state, robot time. In s."""
        return self.state.stamp_ns * 1e-9


def nominal_readings() -> Readings:
    """Readings of a robot that stands, for the first call of compiled functions."""
    state, readings = RobotState(), Readings()
    state.q[2] = state.com_position[2] = 0.9
    state.q[6:] = (0.0, 0.0, 0.5, -1.2, 0.0, NEUTRAL_TARSUS + 1.2, -1.6) * 2
    readings.update(state)
    return readings
