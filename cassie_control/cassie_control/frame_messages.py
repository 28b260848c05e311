"""The robot's frames for ROS tools, as messages of /tf and /tf_static."""

from __future__ import annotations

import numpy as np

from cassie_gaits.link_frames import (
    BASE_FRAME,
    FIXED_FRAMES,
    MOVING_FRAMES,
    ODOM_FRAME,
    LinkFrame,
    LinkPoses,
)
from cassie_msgs.layout import RobotState
from cassie_msgs.standard_messages import TransformWriter

RATE = 50
"""Highest rate of /tf, in robot time. In Hz."""


class FrameMessages:
    """Pose of the base in the odometry frame, and of each link in its parent, decimated.

    Args:
        control_rate: Rate of control ticks. In Hz.
    """

    def __init__(self, control_rate: int) -> None:
        self._period = max(1, control_rate // RATE)
        self._offset = min(3, self._period - 1)  # a tick that has little else to publish
        self._links = LinkPoses()
        self._writer = TransformWriter([(ODOM_FRAME, BASE_FRAME), *map(_pair, MOVING_FRAMES)])

    def due(self, seq: int) -> bool:
        """Whether there is a message at a tick."""
        return seq % self._period == self._offset

    def moving(self, state: RobotState) -> bytes:
        """Message of /tf."""
        return self._writer.to_bytes(state.stamp_ns, self._links.at(state.q))


def fixed_frames() -> bytes:
    """Message of /tf_static."""
    poses = np.array([frame.rest for frame in FIXED_FRAMES])
    return TransformWriter([*map(_pair, FIXED_FRAMES)]).to_bytes(0, poses)


def _pair(frame: LinkFrame) -> tuple[str, str]:
    return frame.parent, frame.name
