"""What the supervisor makes of the robot's state: upright, on the ground, fallen, at rest."""

from __future__ import annotations

import math

from cassie_control.supervisor.config import SupervisorConfig
from cassie_gaits.robot import WEIGHT
from cassie_msgs.layout import RobotState

_GROUNDED = 50.0  # N on a foot, from which it counts as on the ground
_HANGING = 0.25  # of the weight on the feet, below which somebody lifts it
_HANGING_TIME = 0.5  # s
_SUNK_TIME = 0.1  # s; so late the kinematic estimate finds the ground when let down
_STEP_TIME = 0.4  # s, about one: so long the sway is averaged, and a lifted foot is a step


class Posture:
    """How it stands, lies or hangs; `step` takes every state that the supervisor answers.

    Attributes:
        height: Of the pelvis above the ground. In m.
        grounded: Whether a foot is on the ground.
        hangs: Whether its feet have carried nearly nothing for a while.
        low: Whether the pelvis is too near to it.
        fallen: Since it tilted or sank too far, until it has been upright for `upright_time`.
        upright: For how long it has been. In s.
        still: For how long the CoM has been. In s.
        velocity: Of the CoM, ahead and to the left, averaged over a step. In m/s.
    """

    def __init__(self) -> None:
        self.height = self.upright = self.still = 0.0
        self.grounded = self.low = self.fallen = self.hangs = False
        self.velocity = (0.0, 0.0)
        self._lifted = self._sunk = self._unloaded = 0.0

    @property
    def speed(self) -> float:
        """Magnitude of `velocity`. In m/s."""
        return math.hypot(*self.velocity)

    @property
    def stepping(self) -> bool:
        """Whether a foot was in the air within about a step, the other one on the ground."""
        return self._lifted > 0.0

    def step(
        self, state: RobotState, moving: bool, config: SupervisorConfig, period: float
    ) -> None:
        """Take in a state.

        Args:
            state: The robot now.
            moving: Whether a controller holds it up, so that sinking is a fall.
            config: Bounds.
            period: Since the last state. In s.
        """
        self._feel_ground(state, moving, config, period)
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
        share = min(1.0, period / _STEP_TIME)
        self.velocity = (
            self.velocity[0] + share * (vx - self.velocity[0]),
            self.velocity[1] + share * (vy - self.velocity[1]),
        )

    def _feel_ground(
        self, state: RobotState, moving: bool, config: SupervisorConfig, period: float
    ) -> None:
        self.height = float(state.q[2])
        forces = state.foot_force.tolist()
        self.grounded = max(forces) > _GROUNDED
        unloaded = sum(forces) < _HANGING * WEIGHT
        self._unloaded = self._unloaded + period if unloaded else 0.0
        self.hangs = self._unloaded >= _HANGING_TIME
        single = self.grounded and min(forces) < _GROUNDED
        self._lifted = _STEP_TIME if single else max(0.0, self._lifted - period)
        low = self.grounded and self.height < config.fall_height
        self._sunk = self._sunk + period if low else 0.0
        self.low = low and (self._sunk >= _SUNK_TIME or not moving)
