"""What the control laws read of the robot each tick, as plain numbers with names."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
import numpy.typing as npt

from cassie_control.controller.kernels import read_robot
from cassie_control.controller.leg_aim import HIP_BACK, HIP_DOWN, HIP_ROLL_X, HIP_Y
from cassie_control.controller.records import ROBOT_TYPE, RecordArray
from cassie_control.controller.weight_kernels import holding_torques
from cassie_gaits import robot
from cassie_gaits.leg_chain import LegPair
from cassie_gaits.names import LEGS
from cassie_msgs.layout import RobotState

FloatArray = npt.NDArray[np.float64]
Vector = tuple[float, float, float]

_VALUES = struct.Struct("51d")
"""Figures of `records.ROBOT_TYPE` that are looked at every tick: up to the joints' rates."""

HIP_X = HIP_ROLL_X - HIP_BACK
HIP_Z = -HIP_DOWN
"""Hip pitch axis in the pelvis frame with hip roll and yaw at zero; left, y mirrored. In m."""

ANKLE_HEIGHT = 0.0570
"""Toe joint above the ground with a level sole. In m."""

HIP_TO_PELVIS = -HIP_Z
WEIGHT = robot.total_mass() * 9.81


class LegReadings:
    """One leg: its joints and where its toe joint is.

    Attributes:
        number: 0 for the left leg, 1 for the right.
        side: 1 for the left leg, -1 for the right.
        joints: The seven joints. In rad.
        ankle: Toe joint from the pelvis origin, heading frame. In m.
        foot: Middle of the sole from the pelvis origin, heading frame. In m.
        load: Share of the load threshold it carries, 0..1.
        force: Vertical force on the foot. In N.
        contact: Probability that the foot is on the ground, 0..1.
        hip_y: Sideways offset of the hip. In m.
    """

    def __init__(self, number: int, rates: FloatArray, ankle_jacobian: FloatArray) -> None:
        self.number = number
        self._rates = rates
        self.side = 1.0 - 2.0 * number
        self.hip_y = self.side * HIP_Y
        self._ankle_jacobian = ankle_jacobian
        self.joints: tuple[float, ...] = (0.0,) * 7
        self.ankle: Vector = (0.0, 0.0, 0.0)
        self.foot: Vector = (0.0, 0.0, 0.0)
        self.load = 0.0
        self.force = 0.0
        self.contact = 0.0

    def take(self, values: tuple[Any, ...]) -> None:
        """Take this leg's out of the figures of `records.ROBOT_TYPE`."""
        i = self.number
        self.load, self.force, self.contact = values[19 + i : 25 : 2]
        self.joints = values[25 + 7 * i : 32 + 7 * i]
        self.ankle = values[39 + 3 * i : 42 + 3 * i]
        self.foot = values[45 + 3 * i : 48 + 3 * i]

    @property
    def rates(self) -> list[float]:
        """Of the joints, which are not looked at every tick. In rad/s."""
        rates: list[float] = self._rates.tolist()
        return rates

    def weight_torques(
        self, tilt: FloatArray, force: float, lean_x: float, lean_y: float
    ) -> tuple[float, float, float, float]:
        """Torques of hip roll, yaw, pitch and knee that hold a ground force on the foot.

        Args:
            tilt: Pelvis to heading frame. Shape (3, 3).
            force: Its vertical part. In N.
            lean_x, lean_y: Its horizontal parts over the vertical one, heading frame.

        Returns:
            Torques. In Nm.

        Source:
            u = -J^T F on the model with rigid springs, where the tarsus turns against the knee.
        """
        return holding_torques(self._ankle_jacobian, tilt, force, lean_x, lean_y)


class Readings:
    """The robot at one tick.

    Attributes:
        yaw, pitch, roll, yaw_rate, pitch_rate, roll_rate: Torso. In rad and rad/s.
        com: Centre of mass from the pelvis origin, heading frame. In m.
        com_from_feet: The same from the midpoint of the feet. In m.
        com_velocity: Of the centre of mass, heading frame. In m/s.
        velocity: Of the pelvis origin, heading frame. In m/s.
        height: Pelvis origin above the loaded soles. In m.
        time: Of the state, robot time. In s.
        legs: Left and right.
        state: The estimate itself.
        tilt: Rotation pelvis to heading frame. Shape (3, 3).
        records: Most of this for compiled functions, of `records.ROBOT_TYPE`. Shape (1,).
        pair: Kinematics of both legs, `leg_chain.LegPair.record`. Shape (1,).
    """

    def __init__(self) -> None:
        self.records: RecordArray = np.zeros(1, ROBOT_TYPE)
        self._memory = self.records.view(np.uint8).data
        pair = LegPair()
        self.pair = pair.record
        self.legs = tuple(
            LegReadings(i, self.records[0]["rates"][i], pair.states[i]["ankle_jacobian"])
            for i in range(len(LEGS))
        )
        self.tilt: FloatArray = self.records[0]["tilt"]
        self.height = self.time = 0.0
        self.yaw = self.pitch = self.roll = 0.0
        self.yaw_rate = self.pitch_rate = self.roll_rate = 0.0
        self.com: Vector = (0.0, 0.0, 0.0)
        self.com_from_feet: Vector = (0.0, 0.0, 0.0)
        self.com_velocity: Vector = (0.0, 0.0, 0.0)
        self.velocity: Vector = (0.0, 0.0, 0.0)
        self.state = RobotState()

    def update(self, state: RobotState) -> None:
        """Take in a state estimate."""
        self.state = state
        self.time = state.stamp_ns * 1e-9
        read_robot(state.record, self.pair, self.records)
        values = _VALUES.unpack_from(self._memory)
        self.height, self.yaw, self.pitch, self.roll = values[:4]
        self.yaw_rate, self.pitch_rate, self.roll_rate = values[4:7]
        self.com, self.com_from_feet = values[7:10], values[10:13]
        self.com_velocity, self.velocity = values[13:16], values[16:19]
        for leg in self.legs:
            leg.take(values)
