"""A made-up recording with known answers: a robot that glides along a given path."""

from __future__ import annotations

import math

import numpy as np

from cassie_bags.bag.recording import GROUND_TRUTH_TOPIC, Recording, from_messages
from cassie_bags.signals.leg_geometry import leg_points
from cassie_gaits.robot import NEUTRAL_TARSUS, SOLE_RADIUS
from cassie_msgs.layout import (
    SAMPLE_TYPES,
    ControllerStatus,
    Mode,
    MotorCommand,
    OperatorCommand,
    RobotMode,
    RobotState,
    Sensors,
)
from cassie_sim.ground_truth import GroundTruth

TICK_NS = 2_000_000

LEG = (0.0, 0.0, 0.5, -1.15, 0.0, NEUTRAL_TARSUS + 1.15, -1.6)
"""Joint angles of each leg, q1 to q7. In rad."""


def standing_height() -> float:
    """Pelvis height above the soles in the pose `LEG`. In m."""
    soles = leg_points(np.array([LEG + LEG]))[0, :, -2:, 2]
    return float(SOLE_RADIUS - soles.mean())


def glide(
    seconds: float = 4.0,
    *,
    vx: float = 0.5,
    yaw_rate: float = 0.0,
    lift: float = 0.0,
    tilt_from: float | None = None,
    episode: int = 1,
    mode: RobotMode = RobotMode.WALK,
) -> Recording:
    """A recording of a robot that moves at constant speed in a fixed pose.

    Args:
        seconds: Its length.
        vx: Forward speed. In m/s.
        yaw_rate: In rad/s.
        lift: Pelvis height above that of the pose. In m.
        tilt_from: When it topples over (pitch of 90 degrees), or None. In s.
        episode: Number of the episode.
        mode: Mode in which it is.
    """
    messages = glide_messages(seconds, vx, yaw_rate, lift, tilt_from, episode, mode)
    return from_messages(messages, wall_time=seconds / 2.0)


def glide_messages(
    seconds: float,
    vx: float = 0.5,
    yaw_rate: float = 0.0,
    lift: float = 0.0,
    tilt_from: float | None = None,
    episode: int = 1,
    mode: RobotMode = RobotMode.WALK,
) -> dict[str, list[bytes]]:
    """The messages of `glide` by topic."""
    messages: dict[str, list[bytes]] = {kind.TOPIC: [] for kind in SAMPLE_TYPES}
    truth = messages[GROUND_TRUTH_TOPIC] = []
    writer = GroundTruth()
    position = np.array([0.0, 0.0, standing_height() + lift])
    for seq in range(round(seconds * 1e9 / TICK_NS)):
        time = seq * TICK_NS * 1e-9
        yaw = yaw_rate * time
        pitch = math.pi / 2 if tilt_from is not None and time >= tilt_from else 0.0
        for sample in _samples(seq, vx, yaw_rate, mode):
            sample.seq[...] = seq
            sample.episode[...] = episode
            sample.stamp_ns = seq * TICK_NS
            messages[sample.TOPIC].append(sample.to_bytes())
        pose = _Pose(seq, position, yaw, pitch)
        pose.pelvis_twist[:2] = vx * math.cos(yaw), vx * math.sin(yaw)
        pose.pelvis_twist[3:] = -yaw_rate * math.sin(pitch), 0.0, yaw_rate * math.cos(pitch)
        truth.append(writer.write(pose))
        period = TICK_NS * 1e-9
        middle = yaw + 0.5 * yaw_rate * period
        position = position + vx * period * np.array([math.cos(middle), math.sin(middle), 0.0])
    return messages


def _samples(seq: int, vx: float, yaw_rate: float, robot_mode: RobotMode) -> list:
    state = RobotState()
    state.q[6:] = LEG + LEG
    state.foot_load[:] = 1.0
    sensors = Sensors()
    sensors.drive_torque[3] = -50.0
    sensors.drive_position[3] = math.sin(seq * 0.02)
    sensors.drive_velocity[3] = 10.0 * math.cos(seq * 0.02)
    samples = [sensors, state, MotorCommand()]
    if seq % 10 == 0:
        operator, mode, status = OperatorCommand(), Mode(), ControllerStatus()
        operator.scripted[...] = True
        for command in (operator, mode):
            command.effective_seq[...] = seq + 10 if seq else 0
            command.mode[...] = robot_mode
            command.vx[...] = vx
            command.yaw_rate[...] = yaw_rate
            command.height[...] = standing_height()
        samples += [operator, mode, status]
    return samples


class _Pose:
    """As much of a plant as `GroundTruth` reads."""

    tick_ns = TICK_NS

    def __init__(self, seq: int, position: np.ndarray, yaw: float, pitch: float) -> None:
        self.seq = seq
        half_yaw, half_pitch = 0.5 * yaw, 0.5 * pitch
        quaternion = (  # w x y z
            math.cos(half_yaw) * math.cos(half_pitch),
            -math.sin(half_yaw) * math.sin(half_pitch),
            math.cos(half_yaw) * math.sin(half_pitch),
            math.sin(half_yaw) * math.cos(half_pitch),
        )
        self.pelvis_pose = (position, np.array(quaternion))
        self.pelvis_twist = np.zeros(6)
