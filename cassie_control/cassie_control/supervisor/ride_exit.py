"""When riding a Segway may end."""

from __future__ import annotations

from cassie_control.supervisor.config import SupervisorConfig


class RideExit:
    """Whether riding may end, so that the law of standing is used again.

    That law shakes a Segway that nobody holds, also one at rest. The robot has no sensor for
    whether it stands on a Segway, nor for the Segway's speed. So riding ends only

    - when the robot hangs; or
    - when the operator confirms that the Segway is held, or that the robot is on fixed ground. The
      operator asks to stand, upon which the robot brakes for `ride_stop_time`, then for riding, and
      within `ride_confirm_time` to stand again.

    Attributes:
        confirmed: Whether the operator has confirmed.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Begin anew, without a confirmation."""
        self.confirmed = False
        self._stand_requested: bool | None = False
        self._braking_time = self._confirm_time_left = 0.0

    def step(self, stand_requested: bool | None, config: SupervisorConfig, period: float) -> None:
        """Update with one period of riding.

        Args:
            stand_requested: Whether the operator asks to stand; None without an operator.
            config: Times.
            period: Time since the last update. In s.
        """
        self._stand_requested = stand_requested
        if stand_requested is None:
            self.confirmed, self._braking_time, self._confirm_time_left = False, 0.0, 0.0
        elif stand_requested:
            self.confirmed = self.confirmed or self._confirm_time_left > 0.0
            self._braking_time, self._confirm_time_left = self._braking_time + period, 0.0
        else:
            braked = self._braking_time >= config.ride_stop_time
            left = max(0.0, self._confirm_time_left - period)
            self._confirm_time_left = config.ride_confirm_time if braked else left
            self.confirmed, self._braking_time = False, 0.0

    def refusal(self, config: SupervisorConfig, unrest: str, *, hangs: bool) -> str:
        """Why riding goes on; empty if the robot hangs, or rests and the operator confirmed.

        Args:
            config: Times.
            unrest: Why the robot is not at rest, or empty.
            hangs: Whether somebody has lifted the robot.
        """
        if self._stand_requested is None:
            return "riding on without the operator"
        if hangs:
            return ""
        if self.confirmed:
            return unrest
        left = config.ride_stop_time - self._braking_time
        if left > 0.0:
            return f"braking for {left:.1f} s more"
        return "lift it, or ask for segway and stand once more if what it stands on is held"
