"""When riding a Segway may end."""

from __future__ import annotations

from cassie_control.supervisor.config import SupervisorConfig


class Leaving:
    """Whether the law of standing may come in again.

    It shakes a Segway that nobody holds, also one at rest, and a robot cannot feel whether it
    stands on one, nor its speed. So riding ends only

    - when it hangs; or
    - when the operator confirms that what it stands on is held, or is plain ground: he asks to
      stand, upon which it brakes for `ride_stop_time`, then for riding, and within
      `ride_confirm_time` to stand again.

    Attributes:
        confirmed: Whether he did.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Riding begins, or nobody is there to confirm."""
        self.confirmed = False
        self._asked: bool | None = False
        self._braked = self._window = 0.0

    def step(self, asked: bool | None, config: SupervisorConfig, period: float) -> None:
        """Take in a moment of riding.

        Args:
            asked: Whether the operator asks to stand; None without one.
            config: Times.
            period: Since the last moment. In s.
        """
        self._asked = asked
        if asked is None:
            self.confirmed, self._braked, self._window = False, 0.0, 0.0
        elif asked:
            self.confirmed = self.confirmed or self._window > 0.0
            self._braked, self._window = self._braked + period, 0.0
        else:
            braked = self._braked >= config.ride_stop_time
            self._window = config.ride_confirm_time if braked else max(0.0, self._window - period)
            self.confirmed, self._braked = False, 0.0

    def refusal(self, config: SupervisorConfig, restless: str, *, hangs: bool) -> str:
        """Why it goes on riding; empty if it hangs, or the operator confirmed and it rests.

        Args:
            config: Times.
            restless: Why it does not rest, or empty.
            hangs: Whether somebody lifted it.
        """
        if self._asked is None:
            return "riding on without the operator"
        if hangs:
            return ""
        if self.confirmed:
            return restless
        left = config.ride_stop_time - self._braked
        if left > 0.0:
            return f"braking for {left:.1f} s more"
        return "lift it, or ask for segway and stand once more if what it stands on is held"
