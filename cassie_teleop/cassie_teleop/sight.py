"""The rider's measurements of the robot: position, heading and speed."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass

from cassie_msgs.sample import LayoutError
from cassie_msgs.standard_messages import ODOMETRY, read_rows

TOPIC = "/cassie/ground_truth"
"""nav_msgs/Odometry of the true pelvis, the source of these measurements."""


class SightError(ValueError):
    """A message that is no odometry."""


@dataclass(frozen=True)
class Sight:
    """The robot at one moment.

    Attributes:
        stamp_ns: Robot time. In ns.
        x, y: Position of the pelvis. In m.
        heading: Heading to the left of the world's x axis. In rad.
        speed: Speed forward. In m/s.
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
    """The measurement in a serialized odometry message.

    Raises:
        SightError: if it is too short to be one.
    """
    try:
        (row,) = read_rows(ODOMETRY, [raw])
    except LayoutError as error:
        raise SightError(str(error)) from None
    x, y, _ = row["position"].tolist()
    qx, qy, qz, qw = row["orientation"].tolist()
    vx, vy, vz = row["linear"].tolist()
    # The first two rows of the rotation, body to world.
    row_x = (1.0 - 2.0 * (qy * qy + qz * qz), 2.0 * (qx * qy - qz * qw), 2.0 * (qx * qz + qy * qw))
    row_y = (2.0 * (qx * qy + qz * qw), 1.0 - 2.0 * (qx * qx + qz * qz), 2.0 * (qy * qz - qx * qw))
    heading = math.atan2(row_y[0], row_x[0])
    world_x = row_x[0] * vx + row_x[1] * vy + row_x[2] * vz
    world_y = row_y[0] * vx + row_y[1] * vy + row_y[2] * vz
    speed = math.cos(heading) * world_x + math.sin(heading) * world_y
    return Sight(stamp_of(raw), x, y, heading, speed)
