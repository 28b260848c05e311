"""State estimates of poses that tests choose, and their mirror images."""

from __future__ import annotations

import numpy as np

from cassie_control.control.robot import Readings, set_heading_from_pelvis
from cassie_gaits import robot, virtual_leg
from cassie_gaits.leg import LegPair, both_legs
from cassie_gaits.names import LEGS
from cassie_gaits.robot import WEIGHT
from cassie_gaits.vectors import turned
from cassie_msgs.layout import Mode, MotorCommand, RobotState

DRIVE_JOINTS = (0, 1, 2, 3, 6)
"""The driven ones of a leg's seven joints."""


def leg_joints(
    hip_roll: float = 0.0,
    hip_yaw: float = 0.0,
    hip_pitch: float = 0.5,
    knee: float = -1.15,
    toe: float | None = None,
) -> list[float]:
    """A leg's seven joints with relaxed springs, the sole level if no toe angle is given."""
    toe = virtual_leg.toe_angle(0.0, 0.0, hip_pitch) if toe is None else toe
    return [hip_roll, hip_yaw, hip_pitch, knee, 0.0, robot.NEUTRAL_TARSUS - knee, toe]


def state_of(
    left: list[float],
    right: list[float],
    *,
    yaw: float = 0.0,
    pitch: float = 0.0,
    roll: float = 0.0,
    height: float = 0.9,
    velocity: tuple[float, float] = (0.0, 0.0),
    forces: tuple[float, float] = (0.5 * WEIGHT, 0.5 * WEIGHT),
) -> RobotState:
    """State of a pose; the CoM moves like the pelvis, feet carry `forces` in N."""
    state = RobotState()
    state.q[2:6] = (height, yaw, pitch, roll)
    state.q[6:] = [*left, *right]
    c, s = np.cos(yaw), np.sin(yaw)
    state.v[:2] = (c * velocity[0] - s * velocity[1], s * velocity[0] + c * velocity[1])
    state.com_velocity[:2] = velocity
    R_HP = np.eye(3)
    set_heading_from_pelvis(pitch, roll, R_HP)
    moment, feet = robot.PELVIS.mass * np.array(robot.PELVIS.com), np.zeros(3)
    pair = LegPair()
    joints, up = np.array([left, right]), np.array([0.0, 0.0, 1.0])
    both_legs(joints, np.zeros((2, 7)), np.zeros(2), up, pair.records[0])
    for leg in pair.states:
        moment += leg["com_moment"]
        feet += 0.5 * leg["foot"]
    state.com_position[:] = turned(R_HP, moment / robot.MASS - feet)
    state.foot_force[:] = forces
    state.foot_load[:] = np.clip((np.array(forces) - 100.0) / 100.0, 0.0, 1.0)
    state.contact_probability[:] = np.array(forces) > 60.0
    state.power[...] = 1.0
    return state


def random_state(seed: int, *, roll: float = 0.0, pitch: float = 0.0) -> RobotState:
    """Legs, rates and velocities anywhere within a step; the torso as given."""
    rng = np.random.default_rng(seed)
    legs = [
        leg_joints(
            rng.uniform(-0.1, 0.1),
            rng.uniform(-0.2, 0.2),
            rng.uniform(0.3, 0.7),
            rng.uniform(-1.6, -0.9),
            rng.uniform(-1.9, -1.4),
        )
        for _ in LEGS
    ]
    state = state_of(
        *legs,
        yaw=rng.uniform(-1.0, 1.0),
        pitch=pitch,
        roll=roll,
        velocity=(rng.uniform(-0.5, 0.5), rng.uniform(-0.3, 0.3)),
        forces=(rng.uniform(0.0, 300.0), rng.uniform(0.0, 300.0)),
    )
    state.v[3:] = rng.normal(0.0, 0.3, 17)
    state.com_velocity[2] = rng.normal(0.0, 0.1)
    return state


_LEG_SIGN = np.array([-1.0, -1.0, 1.0, 1.0, 1.0, 1.0, 1.0])


def mirrored_state(state: RobotState) -> RobotState:
    """The state with left and right exchanged."""
    result = RobotState()
    result.copy_from(state)
    for values, source in ((result.q, state.q), (result.v, state.v)):
        values[1], values[3], values[5] = -source[1], -source[3], -source[5]
        values[6:13] = _LEG_SIGN * source[13:20]
        values[13:20] = _LEG_SIGN * source[6:13]
    for name in ("com_position", "com_velocity"):
        getattr(result, name)[1] *= -1.0
    for name in ("foot_force", "foot_load", "contact_probability"):
        getattr(result, name)[:] = getattr(state, name)[::-1]
    result.angular_velocity[[0, 2]] *= -1.0
    return result


def mirrored_mode(mode: Mode) -> Mode:
    """The mode with left and right exchanged."""
    result = Mode()
    result.copy_from(mode)
    for value in (result.vy, result.yaw_rate, result.roll, result.com_y):
        value[...] *= -1.0
    result.trims[[1, 3]] *= -1.0
    return result


def mirrored_command(command: MotorCommand) -> MotorCommand:
    """The command with left and right exchanged."""
    result = MotorCommand()
    result.copy_from(command)
    signs = {"torque": _LEG_SIGN, "position": _LEG_SIGN, "velocity": _LEG_SIGN}
    for name in ("torque", "position", "velocity", "kp", "kd"):
        legs = getattr(command, name).reshape(2, 5)[::-1].copy()
        if name in signs:
            legs *= signs[name][list(DRIVE_JOINTS)]
        getattr(result, name)[:] = legs.reshape(10)
    return result


def readings_of(state: RobotState) -> Readings:
    """What the control laws read of a state."""
    readings = Readings()
    readings.update(state)
    return readings


def mode_of(**set_points: float) -> Mode:
    """A mode with set-points, standing 0.9 m tall unless they say otherwise."""
    mode = Mode()
    for name, value in {"height": 0.9, **set_points}.items():
        getattr(mode, name)[...] = value
    return mode


def put(readings: Readings, **figures: tuple[float, ...]) -> None:
    """Have readings say something else, such as `velocity`; for Python and compiled functions."""
    for name, values in figures.items():
        setattr(readings, name, values)
        readings.records[0][name] = values


def put_toe_joint(readings: Readings, leg: int, toe_joint: tuple[float, float, float]) -> None:
    """The same for the place of a leg's toe joint. In m."""
    readings.legs[leg].toe_joint = toe_joint
    readings.records[0]["toe_joint"][leg] = toe_joint
