"""Estimate of a payload's mass from the feet's forces while walking."""

from __future__ import annotations

from cassie_gaits import robot

_LOW_PASS_WEIGHT = 0.15  # of a new pair of steps
_MAX_PAYLOAD = 30.0  # kg, saturation of the payload


class Payload:
    """Mean vertical force on both feet over two steps, divided by gravity, less the robot's mass.

    Over a stride that ends as it began, the mean acceleration of the centre of mass is 0.

    Attributes:
        mass: Low-passed over strides, 0 or more. In kg.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """No payload, and a new stride."""
        self.mass = 0.0
        self._force_sum = 0.0
        self._ticks, self._stride_start = 0, -1

    def step(self, force: float, steps: int) -> None:
        """Update with one tick.

        Args:
            force: Sum of the vertical forces on both feet. In N.
            steps: Number of steps since walking began.
        """
        if not 0 <= steps - self._stride_start < 2:
            if self._ticks and steps - self._stride_start == 2:
                payload = self._force_sum / self._ticks / robot.GRAVITY - robot.MASS
                self.mass += _LOW_PASS_WEIGHT * (max(0.0, min(_MAX_PAYLOAD, payload)) - self.mass)
            self._force_sum, self._ticks, self._stride_start = 0.0, 0, steps
        self._force_sum += force
        self._ticks += 1
