"""Posture from the robot's state, for the supervisor: upright, on the ground, fallen, at rest."""

from __future__ import annotations

import math

from cassie_control.supervisor.config import SupervisorConfig
from cassie_gaits.robot import WEIGHT
from cassie_msgs.layout import RobotState

_CONTACT_FORCE = 50.0  # N, threshold of a foot's force for ground contact
_HANGING_LOAD = 0.25  # share of the weight on the feet, below which somebody lifts the robot
_HANGING_TIME = 0.5  # s with less load than that, after which the robot hangs
_LOW_TIME = 0.1  # s, delay with which the kinematic estimate finds the ground after a hang
_STEP_TIME = 0.4  # s, about one step: time constant of `velocity`, and memory of a lifted foot


class Posture:
    """Whether the robot stands, lies or hangs; `step` takes every state the supervisor answers.

    Attributes:
        height: Height of the pelvis above the ground. In m.
        grounded: Whether a foot is on the ground.
        hangs: Whether the feet have carried nearly nothing for a while.
        low: Whether the pelvis is too near to the ground.
        fallen: True from too large a tilt or too low a pelvis until `upright_time` of being
            upright.
        upright: Time for which the torso has been upright. In s.
        still: Time for which the CoM has been still. In s.
        velocity: CoM velocity, forward and to the left, low-passed over a step. In m/s.
    """

    def __init__(self) -> None:
        self.height = self.upright = self.still = 0.0
        self.grounded = self.low = self.fallen = self.hangs = False
        self.velocity = (0.0, 0.0)
        self._stepping_time = self._low_timer = self._unloaded_time = 0.0

    @property
    def speed(self) -> float:
        """Magnitude of `velocity`. In m/s."""
        return math.hypot(*self.velocity)

    @property
    def stepping(self) -> bool:
        """Whether a foot was in the air within about a step, the other one on the ground."""
        return self._stepping_time > 0.0

    def step(
        self, state: RobotState, moving: bool, config: SupervisorConfig, period: float
    ) -> None:
        """Update with a state.

        Args:
            state: The robot now.
            moving: Whether a controller holds the robot up, so that sinking is a fall.
            config: Bounds.
            period: Time since the last state. In s.
        """
        self._update_ground_contact(state, moving, config, period)
        tilt = max(abs(float(state.q[4])), abs(float(state.q[5])))
        upright = tilt < config.upright_tilt and not self.low
        self.upright = self.upright + period if upright else 0.0
        if tilt > config.fall_tilt or (self.low and moving):
            self.fallen = True
        elif self.upright >= config.upright_time:
            self.fallen = False
        vx, vy, _ = state.com_velocity.tolist()
        still = math.hypot(vx, vy) < config.still_speed
        self.still = self.still + period if still else 0.0
        share = period / _STEP_TIME
        self.velocity = (
            self.velocity[0] + share * (vx - self.velocity[0]),
            self.velocity[1] + share * (vy - self.velocity[1]),
        )

    def _update_ground_contact(
        self, state: RobotState, moving: bool, config: SupervisorConfig, period: float
    ) -> None:
        self.height = float(state.q[2])
        forces = state.foot_force.tolist()
        self.grounded = max(forces) > _CONTACT_FORCE
        unloaded = sum(forces) < _HANGING_LOAD * WEIGHT
        self._unloaded_time = self._unloaded_time + period if unloaded else 0.0
        self.hangs = self._unloaded_time >= _HANGING_TIME
        single_support = self.grounded and min(forces) < _CONTACT_FORCE
        left = max(0.0, self._stepping_time - period)
        self._stepping_time = _STEP_TIME if single_support else left
        low = self.grounded and self.height < config.fall_height
        self._low_timer = self._low_timer + period if low else 0.0
        self.low = low and (self._low_timer >= _LOW_TIME or not moving)
