"""The robot's true pose and twist as a serialized nav_msgs/Odometry, one per control tick."""

from __future__ import annotations

from cassie_gaits.compiled import compiled
from cassie_gaits.records import FloatArray
from cassie_msgs.standard_messages import ODOMETRY, Writer
from cassie_sim.plant import Plant


@compiled
def write_odometry(
    position: FloatArray, quaternion: FloatArray, twist: FloatArray, figures: FloatArray
) -> None:
    """Write pose and twist of a nav_msgs/Odometry, with the twist in the body's frame.

    Args:
        position: Position in the world. Shape (3,), in m.
        quaternion: Body to world, w x y z, of length 1. Shape (4,).
        twist: Linear velocity in the world (m/s), angular in the body (rad/s). Shape (6,).
        figures: Result: position, orientation x y z w, 36 covariances of the pose, twist, 36
            covariances of the twist. Shape (85,); covariances are not changed.
    """
    w, x, y, z = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    vx, vy, vz = twist[0], twist[1], twist[2]
    tx, ty, tz = 2.0 * (vy * z - vz * y), 2.0 * (vz * x - vx * z), 2.0 * (vx * y - vy * x)
    for k in range(3):
        figures[k] = position[k]
        figures[43 + 3 + k] = twist[3 + k]
    figures[3], figures[4], figures[5], figures[6] = x, y, z, w
    figures[43] = vx + w * tx + ty * z - tz * y
    figures[44] = vy + w * ty + tz * x - tx * z
    figures[45] = vz + w * tz + tx * y - ty * x


TOPIC = "/cassie/ground_truth"
WORLD_FRAME = "odom"
BASE_FRAME = "base_link"


class OdometryWriter:
    """Serialized odometry of a body in the world frame.

    The twist is in the body's frame, as Odometry requires; covariances are zero.

    Args:
        frame: Name of the body's frame.
    """

    def __init__(self, frame: str) -> None:
        self._writer = Writer(ODOMETRY, WORLD_FRAME, frame)

    def write(
        self, stamp_ns: int, position: FloatArray, quaternion: FloatArray, twist: FloatArray
    ) -> bytes:
        """The message.

        Args:
            stamp_ns: Robot time. In ns.
            position: Position in the world. Shape (3,), in m.
            quaternion: Body to world, w x y z. Shape (4,).
            twist: Linear velocity in the world (m/s), angular in the body (rad/s). Shape (6,).
        """
        write_odometry(position, quaternion, twist, self._writer.figures)
        return self._writer.to_bytes(stamp_ns)


class GroundTruth:
    """Serialized true odometry of a plant's pelvis."""

    def __init__(self) -> None:
        self._writer = OdometryWriter(BASE_FRAME)

    def write(self, plant: Plant) -> bytes:
        """The message for the plant's present tick."""
        pose, twist = plant.pelvis_pose, plant.pelvis_twist
        return self._writer.write(plant.seq * plant.tick_ns, *pose, twist)
