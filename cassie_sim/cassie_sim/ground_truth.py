"""The robot's true pose and twist as a serialized nav_msgs/Odometry, one a control tick.

Filling and serializing the message object costs 60 us in Python. Both names in it are fixed,
so its serialized form is a fixed table of offsets: the bytes are built once and the figures
written into them. A test holds that they are what ROS itself would send.
"""

from __future__ import annotations

import struct

from cassie_sim.plant import Plant

TYPE = "nav_msgs/msg/Odometry"
TOPIC = "/cassie/ground_truth"
WORLD_FRAME = "odom"
BASE_FRAME = "base_link"

_STAMP = struct.Struct("<iI")
_POSE = struct.Struct("<7d")
_TWIST = struct.Struct("<6d")
_ENCAPSULATION = b"\x00\x01\x00\x00"
_COVARIANCE = 36 * 8


class GroundTruth:
    """Serialized true odometry of a plant's pelvis.

    Pose in the world frame, twist in the pelvis frame as Odometry asks, covariances zero.
    """

    def __init__(self) -> None:
        names = _string(WORLD_FRAME, 8)
        names += _string(BASE_FRAME, 8 + len(names))
        names += bytes(-(8 + len(names)) % 8)  # the doubles begin at a multiple of eight
        self._pose = 4 + 8 + len(names)
        self._twist = self._pose + _POSE.size + _COVARIANCE
        tail = bytes(_POSE.size + _COVARIANCE + _TWIST.size + _COVARIANCE)
        self._bytes = bytearray(_ENCAPSULATION + bytes(8) + names + tail)

    def write(self, plant: Plant) -> bytes:
        """The message for the plant's present tick."""
        _STAMP.pack_into(self._bytes, 4, *divmod(plant.seq * plant.tick_ns, 1_000_000_000))
        position, quaternion = plant.pelvis_pose
        w, x, y, z = quaternion.tolist()
        _POSE.pack_into(self._bytes, self._pose, *position.tolist(), x, y, z, w)
        vx, vy, vz, wx, wy, wz = plant.pelvis_twist.tolist()
        linear = _into_frame(w, x, y, z, vx, vy, vz)
        _TWIST.pack_into(self._bytes, self._twist, *linear, wx, wy, wz)
        return bytes(self._bytes)


def _string(text: str, offset: int) -> bytes:
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
