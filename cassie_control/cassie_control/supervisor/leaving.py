"""When riding a Segway may end."""

from __future__ import annotations

from cassie_control.supervisor.config import SupervisorConfig
from cassie_gaits.robot import WEIGHT

_HANGING = 0.25  # of the weight on the feet, below which somebody lifts it
_HANGING_TIME = 0.5  # s


class Leaving:
    """Whether the law of standing may come in again.

    It shakes a Segway that nobody holds, also one at rest, and a robot cannot feel whether it
    stands on one, nor its speed. So riding ends only

    - when it hangs: its feet have carried nearly nothing for a while; or
    - when the operator confirms that what it stands on is held, or is plain ground: he asks to
      stand, upon which it brakes for `ride_stop_time`, then for riding, and within
      `ride_confirm_time` to stand again.

    Attributes:
        confirmed: Whether he did.
        hangs: Whether it does.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Riding begins, or nobody is there to confirm."""
        self.confirmed = self.hangs = False
        self._asked: bool | None = False
        self._braked = self._window = self._unloaded = 0.0

    def step(
        self, asked: bool | None, carried: float, config: SupervisorConfig, period: float
    ) -> None:
        """Take in a moment of riding.

        Args:
            asked: Whether the operator asks to stand; None without one.
            carried: Force on the feet. In N.
            config: Times.
            period: Since the last moment. In s.
        """
        self._asked = asked
        unloaded = carried < _HANGING * WEIGHT
        self._unloaded = self._unloaded + period if unloaded else 0.0
        self.hangs = self._unloaded >= _HANGING_TIME
        if asked is None:
            self.confirmed, self._braked, self._window = False, 0.0, 0.0
        elif asked:
            self.confirmed = self.confirmed or self._window > 0.0
            self._braked, self._window = self._braked + period, 0.0
        else:
            braked = self._braked >= config.ride_stop_time
            self._window = config.ride_confirm_time if braked else max(0.0, self._window - period)
            self.confirmed, self._braked = False, 0.0

    def refusal(self, config: SupervisorConfig, restless: str) -> str:
        """Why it goes on riding; empty if it hangs, or the operator confirmed and it rests.

        Args:
            config: Times.
            restless: Why it does not rest, or empty.
        """
        if self._asked is None:
            return "riding on without the operator"
        if self.hangs:
            return ""
        if self.confirmed:
            return restless
        left = config.ride_stop_time - self._braked
        if left > 0.0:
            return f"braking for {left:.1f} s more"
        return "lift it, or ask for segway and stand once more if what it stands on is held"
