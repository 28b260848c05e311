"""The robot's true pose and twist as a serialized nav_msgs/Odometry, one a control tick."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cassie_msgs.standard_messages import ODOMETRY, Writer
from cassie_sim.kernels import write_odometry
from cassie_sim.plant import Plant

FloatArray = npt.NDArray[np.float64]

TOPIC = "/cassie/ground_truth"
WORLD_FRAME = "odom"
BASE_FRAME = "base_link"


class OdometryWriter:
    """Serialized odometry of a body in the world frame.

    Twist in the body's frame as Odometry asks, covariances zero.

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
            position: In the world. Shape (3,), in m.
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
