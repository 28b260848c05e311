"""The robot's true pose and twist as a serialized nav_msgs/Odometry, one a control tick.

Filling and serializing the message object costs 60 us in Python. Both names in it are fixed,
so its serialized form is a fixed table of offsets: the bytes are built once and the figures
written into them by compiled code. A test holds that they are what ROS itself would send.
"""

from __future__ import annotations

import struct

import numpy as np
import numpy.typing as npt

from cassie_sim.kernels import write_odometry
from cassie_sim.plant import Plant

FloatArray = npt.NDArray[np.float64]

TYPE = "nav_msgs/msg/Odometry"
TOPIC = "/cassie/ground_truth"
WORLD_FRAME = "odom"
BASE_FRAME = "base_link"

_STAMP = struct.Struct("<iI")
_ENCAPSULATION = b"\x00\x01\x00\x00"
_FIGURES = 7 + 36 + 6 + 36  # pose, twist and their covariances


class OdometryWriter:
    """Serialized odometry of a body in the world frame.

    Twist in the body's frame as Odometry asks, covariances zero.

    Args:
        frame: Name of the body's frame.
    """

    def __init__(self, frame: str) -> None:
        names = stamped(WORLD_FRAME)
        names += string(frame, len(names))
        names += bytes(-len(names) % 8)  # the doubles begin at a multiple of eight
        body = np.zeros(len(names) // 8 + _FIGURES)
        body.view(np.uint8)[: len(names)] = np.frombuffer(names, np.uint8)
        self._stamp, self._figures = body.data.cast("B"), body[len(names) // 8 :]
        self._body = body

    def write(
        self, stamp_ns: int, position: FloatArray, quaternion: FloatArray, twist: FloatArray
    ) -> bytes:
        """The message.

        Args:
            stamp_ns: Robot time. In ns.
            position: In the world. Shape (3,), in m.
            quaternion: Body to world, w x y z. Shape (4,).
            twist: Linear velocity in the world (m/s), angular in the body (rad/s). Shape (6,).
        """
        _STAMP.pack_into(self._stamp, 0, *divmod(stamp_ns, 1_000_000_000))
        write_odometry(position, quaternion, twist, self._figures)
        return _ENCAPSULATION + self._body.tobytes()


class GroundTruth:
    """Serialized true odometry of a plant's pelvis."""

    def __init__(self) -> None:
        self._writer = OdometryWriter(BASE_FRAME)

    def write(self, plant: Plant) -> bytes:
        """The message for the plant's present tick."""
        pose, twist = plant.pelvis_pose, plant.pelvis_twist
        return self._writer.write(plant.seq * plant.tick_ns, *pose, twist)


def stamped(frame: str) -> bytes:
    """The body of a std_msgs/Header at time 0."""
    return bytes(8) + string(frame, 8)


def string(text: str, offset: int) -> bytes:
    """A CDR string that begins at `offset` of the body, with the padding before it."""
    raw = text.encode() + b"\0"
    return bytes(-offset % 4) + struct.pack("<I", len(raw)) + raw
