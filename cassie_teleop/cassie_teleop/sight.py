"""What an operator beside the robot sees of it: place, heading and speed."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass

TOPIC = "/cassie/ground_truth"
"""nav_msgs/Odometry of the true pelvis, which stands for the operator's eyes."""

_NUMBERS = struct.Struct("<7d")


class SightError(ValueError):
    """A message that is no odometry."""


@dataclass(frozen=True)
class Sight:
    """The robot at one moment.

    Attributes:
        stamp_ns: Robot time. In ns.
        x, y: Of the pelvis. In m.
        heading: To the left of the world's x axis. In rad.
        speed: Forward. In m/s.
    """

    stamp_ns: int
    x: float
    y: float
    heading: float
    speed: float


def stamp_of(raw: bytes) -> int:
    """Robot time of a serialized odometry message. In ns.

    Raises:
        SightError: if it is too short to be one.
    """
    if len(raw) < 12:
        raise SightError(f"{len(raw)} bytes are no odometry")
    seconds, nanoseconds = struct.unpack_from("<iI", raw, 4)
    return int(seconds) * 1_000_000_000 + int(nanoseconds)


def see(raw: bytes) -> Sight:
    """What a serialized odometry message shows.

    Raises:
        SightError: if it is too short to be one.
    """
    try:
        end = _after_string(raw, 12)
        end = _after_string(raw, 4 + -(-(end - 4) // 4) * 4)
        pose = 4 + -(-(end - 4) // 8) * 8
        x, y, _, qx, qy, qz, qw = _NUMBERS.unpack_from(raw, pose)
        vx, vy, vz, *_ = struct.unpack_from("<3d", raw, pose + 8 * (7 + 36))
    except struct.error:
        raise SightError(f"{len(raw)} bytes are no odometry") from None
    # The first two rows of the rotation, body to world.
    row_x = (1.0 - 2.0 * (qy * qy + qz * qz), 2.0 * (qx * qy - qz * qw), 2.0 * (qx * qz + qy * qw))
    row_y = (2.0 * (qx * qy + qz * qw), 1.0 - 2.0 * (qx * qx + qz * qz), 2.0 * (qy * qz - qx * qw))
    heading = math.atan2(row_y[0], row_x[0])
    world_x = row_x[0] * vx + row_x[1] * vy + row_x[2] * vz
    world_y = row_y[0] * vx + row_y[1] * vy + row_y[2] * vz
    speed = math.cos(heading) * world_x + math.sin(heading) * world_y
    return Sight(stamp_of(raw), x, y, heading, speed)


def _after_string(raw: bytes, start: int) -> int:
    (length,) = struct.unpack_from("<I", raw, start)
    return start + 4 + int(length)
