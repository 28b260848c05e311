"""Which way is up for a robot that is carried off."""

from __future__ import annotations

import math
from collections.abc import Sequence

from cassie_msgs.layout import RobotState

_CALM = 0.1  # m/s^2


class Level:
    """Roll and pitch by the gyro, with the estimate as their mean over a long time.

    The estimator takes standing feet to be at rest: on a vehicle that accelerates by a it tilts the
    vertical towards that of a pendulum, by up to a / g. The gyro does not feel that, and over a
    minute drifts by some milliradians. With w the angular velocity of the torso and t the estimate:

        pitch' = w_y cos(roll) - w_z sin(roll)                      - (pitch - t) / T,
        roll'  = w_x + tan(pitch) (w_y sin(roll) + w_z cos(roll))   - (roll - t) / T,
        T      = time (1 + |a|^2 / (0.1 m/s^2)^2).

    The estimated velocity, too, takes the accelerations for the robot's own. That of the CoM seen
    from the feet is the difference of its positions.

    Args:
        period: Of control. In s.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self._state = RobotState()
        self.start(self._state)

    def start(self, state: RobotState) -> None:
        """Begin with the estimate as it is."""
        self._pitch, self._roll = state.q[4:6].tolist()
        self._com: list[float] | None = None

    def corrected(
        self, state: RobotState, time: float, acceleration: Sequence[float]
    ) -> RobotState:
        """The state with another vertical and the CoM's velocity as seen from the feet; reused.

        Args:
            state: The estimate.
            time: In which the estimate's own tilt comes in again. In s.
            acceleration: Of the ground, forward and to the left. In m/s^2.
        """
        pitch, roll = state.q[4:6].tolist()
        wx, wy, wz = state.angular_velocity.tolist()
        cos, sin = math.cos(self._roll), math.sin(self._roll)
        share = self._period / (time * (1.0 + (math.hypot(*acceleration) / _CALM) ** 2))
        pitch_rate = wy * cos - wz * sin
        roll_rate = wx + math.tan(self._pitch) * (wy * sin + wz * cos)
        self._pitch += self._period * pitch_rate + share * (pitch - self._pitch)
        self._roll += self._period * roll_rate + share * (roll - self._roll)
        self._state.copy_from(state)
        self._state.q[4], self._state.q[5] = self._pitch, self._roll
        self._state.v[4], self._state.v[5] = pitch_rate, roll_rate
        com = self._state.com_position
        com[0] += (self._pitch - pitch) * com[2]
        com[1] -= (self._roll - roll) * com[2]
        now = com.tolist()
        if self._com is not None:
            for k in (0, 1):
                self._state.com_velocity[k] = (now[k] - self._com[k]) / self._period
        self._com = now
        return self._state
