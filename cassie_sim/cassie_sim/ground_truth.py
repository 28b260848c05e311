"""The robot's true pose and twist as a serialized nav_msgs/Odometry, one a control tick.

Filling and serializing the message object costs 60 us in Python. Both names in it are fixed,
so its serialized form is a fixed table of offsets: the bytes are built once and the figures
written into them. A test holds that they are what ROS itself would send.
"""

from __future__ import annotations

import struct

import numpy as np
import numpy.typing as npt

from cassie_sim.plant import Plant

FloatArray = npt.NDArray[np.float64]

TYPE = "nav_msgs/msg/Odometry"
TOPIC = "/cassie/ground_truth"
WORLD_FRAME = "odom"
BASE_FRAME = "base_link"

_STAMP = struct.Struct("<iI")
_POSE = struct.Struct("<7d")
_TWIST = struct.Struct("<6d")
_ENCAPSULATION = b"\x00\x01\x00\x00"
_COVARIANCE = 36 * 8


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
        self._pose = 4 + len(names)
        self._twist = self._pose + _POSE.size + _COVARIANCE
        tail = bytes(_POSE.size + _COVARIANCE + _TWIST.size + _COVARIANCE)
        self._bytes = bytearray(_ENCAPSULATION + names + tail)

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
        _STAMP.pack_into(self._bytes, 4, *divmod(stamp_ns, 1_000_000_000))
        w, x, y, z = quaternion.tolist()
        _POSE.pack_into(self._bytes, self._pose, *position.tolist(), x, y, z, w)
        vx, vy, vz, wx, wy, wz = twist.tolist()
        linear = _into_frame(w, x, y, z, vx, vy, vz)
        _TWIST.pack_into(self._bytes, self._twist, *linear, wx, wy, wz)
        return bytes(self._bytes)


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


def _into_frame(
    w: float, x: float, y: float, z: float, vx: float, vy: float, vz: float
) -> tuple[float, float, float]:
    """World vector in the frame whose orientation is the unit quaternion w, x, y, z."""
    tx, ty, tz = 2.0 * (vy * z - vz * y), 2.0 * (vz * x - vx * z), 2.0 * (vx * y - vy * x)
    return (
        vx + w * tx + ty * z - tz * y,
        vy + w * ty + tz * x - tx * z,
        vz + w * tz + tx * y - ty * x,
    )
