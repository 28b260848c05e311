"""What the control laws read of the robot each tick, as plain numbers with names."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from cassie_control.controller.kernels import holding_torques, set_tilt, turned
from cassie_control.controller.pendulum import HIP_BACK, HIP_DOWN, HIP_ROLL_X, HIP_Y
from cassie_gaits import robot
from cassie_gaits.leg_chain import LegChain, LegState
from cassie_gaits.names import LEGS
from cassie_msgs.layout import RobotState

FloatArray = npt.NDArray[np.float64]

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
        joints, rates: The seven joints. In rad and rad/s.
        side: 1 for the left leg, -1 for the right.
        ankle: Toe joint from the pelvis origin, heading frame. In m.
        foot: Middle of the sole from the pelvis origin, heading frame. In m.
        load: Share of the load threshold it carries, 0..1.
        force: Vertical force on the foot. In N.
        contact: Probability that the foot is on the ground, 0..1.
        hip_y: Sideways offset of the hip. In m.
    """

    def __init__(self, leg: str) -> None:
        self._chain = LegChain(leg)
        self.hip_y = HIP_Y if leg == "left" else -HIP_Y
        self.side = 1.0 if leg == "left" else -1.0
        self.joints = [0.0] * 7
        self.rates = [0.0] * 7
        self.ankle = (0.0, 0.0, 0.0)
        self.foot = (0.0, 0.0, 0.0)
        self.load = 0.0
        self.force = 0.0
        self.contact = 0.0
        self.chain: LegState = self._chain.state

    def update(self, joints: FloatArray, rates: FloatArray, rotation: FloatArray) -> None:
        """Take in joints (7,) and rates (7,), with the pelvis's tilt (3, 3)."""
        self.joints = joints.tolist()
        self.rates = rates.tolist()
        self.chain = self._chain.update(joints, rates)
        self.ankle = turned(rotation, self.chain.ankle)
        self.foot = turned(rotation, self.chain.foot)

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
        return holding_torques(self.chain.ankle_jacobian, tilt, force, lean_x, lean_y)


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
    """

    def __init__(self) -> None:
        self.legs = tuple(LegReadings(leg) for leg in LEGS)
        self.tilt = np.eye(3)
        self.yaw = self.pitch = self.roll = 0.0
        self.yaw_rate = self.pitch_rate = self.roll_rate = 0.0
        self.com = (0.0, 0.0, 0.0)
        self.com_velocity = (0.0, 0.0, 0.0)
        self.com_from_feet = (0.0, 0.0, 0.0)
        self.velocity = (0.0, 0.0, 0.0)
        self.height = 0.0
        self.time = 0.0
        self.state = RobotState()

    def update(self, state: RobotState) -> None:
        """Take in a state estimate."""
        self.state = state
        q, v = state.q, state.v
        self.time = state.stamp_ns * 1e-9
        self.height, self.yaw, self.pitch, self.roll = q[2:6].tolist()
        self.yaw_rate, self.pitch_rate, self.roll_rate = v[3:6].tolist()
        set_tilt(self.pitch, self.roll, self.tilt)
        for i, leg in enumerate(self.legs):
            leg.update(q[6 + 7 * i : 13 + 7 * i], v[6 + 7 * i : 13 + 7 * i], self.tilt)
        left, right = self.legs
        left.load, right.load = state.foot_load.tolist()
        left.force, right.force = state.foot_force.tolist()
        left.contact, right.contact = state.contact_probability.tolist()
        x, y, z = state.com_position.tolist()
        self.com_from_feet = (x, y, z)
        self.com = (
            x + 0.5 * (left.foot[0] + right.foot[0]),
            y + 0.5 * (left.foot[1] + right.foot[1]),
            z + 0.5 * (left.foot[2] + right.foot[2]),
        )
        x, y, z = state.com_velocity.tolist()
        self.com_velocity = (x, y, z)
        vx, vy, vz = v[:3].tolist()
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        self.velocity = (c * vx + s * vy, c * vy - s * vx, vz)
