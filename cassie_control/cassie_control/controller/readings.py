"""What the control laws read of the robot each tick, as plain numbers with names."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cassie_control.controller.kernels import read_robot
from cassie_control.controller.leg_aim import HIP_BACK, HIP_DOWN, HIP_ROLL_X, HIP_Y
from cassie_control.controller.records import ESTIMATE_TYPE, ROBOT_TYPE, RecordArray
from cassie_control.controller.weight_kernels import holding_torques
from cassie_gaits import robot
from cassie_gaits.leg_chain import LegPair
from cassie_gaits.names import LEGS
from cassie_msgs.layout import RobotState

FloatArray = npt.NDArray[np.float64]
Vector = tuple[float, float, float]

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
        joints, rates: The seven joints. In rad and rad/s.
        ankle: Toe joint from the pelvis origin, heading frame. In m.
        foot: Middle of the sole from the pelvis origin, heading frame. In m.
        load: Share of the load threshold it carries, 0..1.
        force: Vertical force on the foot. In N.
        contact: Probability that the foot is on the ground, 0..1.
        hip_y: Sideways offset of the hip. In m.
    """

    def __init__(self, number: int, ankle_jacobian: FloatArray) -> None:
        self.number = number
        self.side = 1.0 - 2.0 * number
        self.hip_y = self.side * HIP_Y
        self._ankle_jacobian = ankle_jacobian
        self.joints = [0.0] * 7
        self.rates = [0.0] * 7
        self.ankle = (0.0, 0.0, 0.0)
        self.foot = (0.0, 0.0, 0.0)
        self.load = 0.0
        self.force = 0.0
        self.contact = 0.0

    def take(self, values: list[float]) -> None:
        """Take this leg's out of the figures of `records.ROBOT_TYPE`."""
        i = self.number
        self.load, self.force, self.contact = values[19 + i], values[21 + i], values[23 + i]
        self.joints = values[25 + 7 * i : 32 + 7 * i]
        self.rates = values[39 + 7 * i : 46 + 7 * i]
        x, y, z = values[53 + 3 * i : 56 + 3 * i]
        self.ankle = (x, y, z)
        x, y, z = values[59 + 3 * i : 62 + 3 * i]
        self.foot = (x, y, z)

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
        leg_states: Kinematics of both legs, see `leg_chain.LegPair`. Shape (2,).
    """

    def __init__(self) -> None:
        self.records: RecordArray = np.zeros(1, ROBOT_TYPE)
        self._values: FloatArray = self.records.view(np.float64)
        self._legs = LegPair()
        self._up, self._no_torques = np.array([0.0, 0.0, 1.0]), np.zeros(2)
        self.leg_states = self._legs.states
        self.legs = tuple(
            LegReadings(i, self.leg_states[i]["ankle_jacobian"]) for i in range(len(LEGS))
        )
        self.tilt: FloatArray = self.records[0]["tilt"]
        self.height = self.time = 0.0
        self.yaw = self.pitch = self.roll = 0.0
        self.yaw_rate = self.pitch_rate = self.roll_rate = 0.0
        self.com: Vector = (0.0, 0.0, 0.0)
        self.com_from_feet: Vector = (0.0, 0.0, 0.0)
        self.com_velocity: Vector = (0.0, 0.0, 0.0)
        self.velocity: Vector = (0.0, 0.0, 0.0)
        self._look_at(RobotState())

    def _look_at(self, state: RobotState) -> None:
        """Find the parts of an estimate, which the next one usually comes in as well."""
        self.state = state
        self.estimate: RecordArray = state.floats.view(ESTIMATE_TYPE)
        self._joints, self._rates = state.q[6:].reshape(2, 7), state.v[6:].reshape(2, 7)

    def update(self, state: RobotState) -> None:
        """Take in a state estimate."""
        if state is not self.state:
            self._look_at(state)
        self.time = state.stamp_ns * 1e-9
        self._legs.update(self._joints, self._rates, self._no_torques, self._up)
        read_robot(self.estimate, self.leg_states, self.records)
        values = self._values.tolist()
        self.height, self.yaw, self.pitch, self.roll = values[:4]
        self.yaw_rate, self.pitch_rate, self.roll_rate = values[4:7]
        self.com = (values[7], values[8], values[9])
        self.com_from_feet = (values[10], values[11], values[12])
        self.com_velocity = (values[13], values[14], values[15])
        self.velocity = (values[16], values[17], values[18])
        for leg in self.legs:
            leg.take(values)
