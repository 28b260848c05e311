"""Estimate of a payload's mass from the feet's forces while walking."""

from __future__ import annotations

from cassie_gaits import robot

_SHARE = 0.15  # low-pass weight of a new pair of steps
_MOST = 30.0  # kg, saturation of the payload


class Payload:
    """Mean vertical force on both feet over two steps, divided by gravity, less the robot's mass.

    Over a stride that ends as it began, the mean acceleration of the centre of mass is 0.

    Attributes:
        mass: Low-passed over strides, 0 or more. In kg.
    """

    def __init__(self) -> None:
        self._own = robot.total_mass()
        self.reset()

    def reset(self) -> None:
        """No payload, and a new stride."""
        self.mass = 0.0
        self._forces = 0.0
        self._ticks, self._since = 0, -1

    def step(self, force: float, steps: int) -> None:
        """Update with one tick.

        Args:
            force: Sum of the vertical forces on both feet. In N.
            steps: Number of steps since walking began.
        """
        if not 0 <= steps - self._since < 2:
            if self._ticks and steps - self._since == 2:
                found = self._forces / self._ticks / robot.GRAVITY - self._own
                self.mass += _SHARE * (max(0.0, min(_MOST, found)) - self.mass)
            self._forces, self._ticks, self._since = 0.0, 0, steps
        self._forces += force
        self._ticks += 1
