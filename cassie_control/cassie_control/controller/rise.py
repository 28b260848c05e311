"""Rising under a push: legs that push up brake more than the weight alone does."""

from __future__ import annotations

from cassie_control.controller.approach import approach
from cassie_control.controller.standing_config import StandConfig

_TOP = 1.03  # m, pelvis height above which nothing is gained: the knees are all but straight
_HOLD = 0.3  # s, for which the height is kept once the capture point is safe again
_BACK = 0.2  # m/s, at which it is given back, with
_SETTLE = 1.0  # m/s^2
_BRAKING = 3.0  # m/s^2, or with the springs' own bounce the feet would leave the ground


class Rise:
    """Height on top of what is commanded, while a push has brought the capture point to the edge.

    With the CoM at x and height z, and the feet pressing at p,

        x'' = (x - p) (g + z'') / z.

    While the CoM is still inside of p, the more the legs push up the more it is braked; when they
    let go again, it is nearer to p, and less is lost than was gained. By 0.1 m it is worth some
    6 mm of capture point.

    Attributes:
        height: On top of what is commanded. In m.
        rate: Of that. In m/s.
        acceleration: Of that. In m/s^2.

    Args:
        period: Of control. In s.

    Source:
        Koolen, Posa, Tedrake, "Balance control using center of mass height variation: limitations
        imposed by unilateral contact", Humanoids 2016.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self.start()

    def start(self) -> None:
        """Begin at the height that is commanded."""
        self.height = self.rate = self.acceleration = 0.0
        self._hold = 0.0

    def step(self, config: StandConfig, height: float, urgent: bool, footed: bool) -> None:
        """Move on by a period.

        Args:
            config: Gains.
            height: Of the pelvis, as commanded. In m.
            urgent: Whether the capture point is at the edge of the support.
            footed: Whether both feet carry: on one foot a push would tip it over.
        """
        before = self.rate
        self._hold = _HOLD if urgent and footed else max(0.0, self._hold - self._period)
        if urgent and footed:
            goal = max(self.height, min(config.rise, _TOP - height))
        else:
            goal = self.height if self._hold > 0.0 else 0.0
        fastest, acceleration, braking = config.rise_rate, config.rise_acceleration, _BRAKING
        if self._hold <= 0.0:
            fastest, acceleration, braking = _BACK, _SETTLE, _SETTLE
        self.height, self.rate = approach(
            self.height, self.rate, goal, fastest, acceleration, self._period, braking
        )
        self.acceleration = (self.rate - before) / self._period
