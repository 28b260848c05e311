"""Where in a step the robot is, when the step ends, and how fast it walks on the whole."""

from __future__ import annotations

import math

from cassie_control.config import WalkConfig
from cassie_control.control.robot import Readings

LEFT, RIGHT = 0, 1
"""Legs, as numbers of the stance leg."""


_RATE_TIME = 0.02  # s
_LATE = 0.9  # phase from which a step's time is settled


class StepTiming:
    """Phase and stance leg of the present step, and the velocities read from it.

    A step ends when the swing foot carries `touchdown_force` after phase `earliest_touchdown`,
    or at phase `latest_touchdown`.

    Attributes:
        stance: LEFT or RIGHT.
        phase: The paper's tau, 0 at touchdown, 1 at the planned end of the step.
        steps: Steps ended since walking began.
        step_time: Planned duration of the step. In s.
        elapsed: Time since the last touchdown. In s.
        rate: Of the phase. In 1/s.
        velocity: Low-passed velocity of the pelvis, forward and to the left. In m/s.

    Args:
        config: Conditions of touchdown, cut-off of the low-pass.
        step_time: Planned duration of the first step. In s.
        period: Of control. In s.
    """

    def __init__(self, config: WalkConfig, step_time: float, period: float) -> None:
        self._period = period
        self.step_time = step_time
        self.configure(config)
        self.start(LEFT)

    def configure(self, config: WalkConfig) -> None:
        """Take over new figures; the step goes on."""
        self._config = config
        self._filter = 1.0 - math.exp(-2.0 * math.pi * config.speed_filter * self._period)

    def start(self, stance: int) -> None:
        """Begin the first step, on a stance leg."""
        self.stance = stance
        self.phase = 0.0
        self.steps = 0
        self.elapsed = 0.0
        self.rate = 1.0 / self.step_time
        self.velocity = (0.0, 0.0)
        self._travel = (0.0, 0.0)
        self._means: list[tuple[float, float]] = []

    def advance(self, readings: Readings) -> bool:
        """Go on by one period; says whether the step ended. `end_step` then begins the next."""
        vx, vy = self.velocity
        vx += self._filter * (readings.velocity[0] - vx)
        vy += self._filter * (readings.velocity[1] - vy)
        self.velocity = (vx, vy)
        self._travel = (
            self._travel[0] + self._period * readings.velocity[0],
            self._travel[1] + self._period * readings.velocity[1],
        )
        self.elapsed += self._period
        self.phase += self._period * self.rate
        return self._ended(readings)

    def plan(self, remaining: float) -> None:
        """Go on so that the planned end of the step comes after a time, in s.

        The rate follows within `_RATE_TIME`; near the end it stays as it is.
        """
        if self.phase > _LATE:
            return
        rate = (1.0 - self.phase) / max(remaining, 1e-3)
        self.rate += min(1.0, self._period / _RATE_TIME) * (rate - self.rate)

    def _ended(self, readings: Readings) -> bool:
        c = self._config
        if self.phase >= c.latest_touchdown:
            return True
        swing = readings.legs[1 - self.stance]
        return self.phase >= c.earliest_touchdown and swing.force > c.touchdown_force

    def end_step(self) -> tuple[float, float]:
        """Exchange the legs and begin a step.

        Returns:
            Mean velocity of the last two steps, or of the only one. In m/s.
        """
        duration = max(self.elapsed, 1e-6)
        self._means.append((self._travel[0] / duration, self._travel[1] / duration))
        del self._means[:-2]
        self.stance = 1 - self.stance
        self.steps += 1
        self.phase = 0.0
        self.elapsed = 0.0
        self.rate = 1.0 / self.step_time
        self._travel = (0.0, 0.0)
        return (
            sum(mean[0] for mean in self._means) / len(self._means),
            sum(mean[1] for mean in self._means) / len(self._means),
        )
