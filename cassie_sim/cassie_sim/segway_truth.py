"""A Segway's true motion, and the readings of its own IMU, as serialized messages for bags.

No node on the control lane reads them: the robot does not know the ground under its feet.
"""

from __future__ import annotations

import mujoco

from cassie_msgs.standard_messages import IMU, ODOMETRY, Writer
from cassie_sim.ground_truth import OdometryWriter
from cassie_sim.plant import Plant

TRUTH_TOPIC = "/segway/ground_truth"
IMU_TOPIC = "/segway/imu"
TYPES = {TRUTH_TOPIC: ODOMETRY.type, IMU_TOPIC: IMU.type}
"""Type of each topic."""

FRAME = "segway"
IMU_FRAME = "segway_imu"
RATE = 100
"""Highest rate of the messages, in robot time. In Hz."""

_UNKNOWN = -1.0  # first element of a covariance: the reading is not given
_ANGULAR, _FORCE = (slice(first, first + count) for first, count in IMU.fields.values())


class SegwayTruth:
    """Messages of the Segway in a plant, if there is one.

    They give pose and twist of its chassis, whose origin is the middle of the axle, and angular
    velocity and specific force there, without noise. The IMU gives no orientation.
    """

    def __init__(self) -> None:
        self._odometry = OdometryWriter(FRAME)
        self._imu = Writer(IMU, IMU_FRAME)
        self._imu.figures[3:5] = 1.0, _UNKNOWN  # w, and the first covariance of the orientation
        self._model: mujoco.MjModel | None = None
        self._is_there = False

    def _look(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._is_there = any(model.joint(index).name == "segway" for index in range(model.njnt))
        if self._is_there:
            joint = model.joint("segway")
            self._position, self._velocity = int(joint.qposadr[0]), int(joint.dofadr[0])
            self._gyro = int(model.sensor("segway_gyro").adr[0])
            self._force = int(model.sensor("segway_accelerometer").adr[0])

    def messages(self, plant: Plant) -> list[tuple[str, bytes]]:
        """Topic and bytes of each message that is due at the plant's present tick."""
        if plant.model is not self._model:
            self._look(plant.model)
        if not self._is_there or plant.seq % max(1, round(1e9 / (RATE * plant.tick_ns))):
            return []
        return [(TRUTH_TOPIC, self._write_truth(plant)), (IMU_TOPIC, self._write_imu(plant))]

    def _write_truth(self, plant: Plant) -> bytes:
        q, v = self._position, self._velocity
        position, quaternion = plant.data.qpos[q : q + 3], plant.data.qpos[q + 3 : q + 7]
        twist = plant.data.qvel[v : v + 6]
        return self._odometry.write(plant.seq * plant.tick_ns, position, quaternion, twist)

    def _write_imu(self, plant: Plant) -> bytes:
        felt = plant.data.sensordata
        self._imu.figures[_ANGULAR] = felt[self._gyro : self._gyro + 3]
        self._imu.figures[_FORCE] = felt[self._force : self._force + 3]
        return self._imu.to_bytes(plant.seq * plant.tick_ns)
