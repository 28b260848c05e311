"""Robot time against wall time. Wall times come in as arguments, in s."""

from __future__ import annotations

SLACK = 0.1
"""Delay behind the pace that is caught up; more is forgiven. In s."""


class Pace:
    """Says when the next tick is due.

    Args:
        tick: Length of a control tick in robot time. In s.
    """

    def __init__(self, tick: float) -> None:
        self._tick = tick
        self._due = 0.0

    def start(self, now: float) -> None:
        """Begin to count now."""
        self._due = now

    def next_due(self, now: float, rate: float) -> float:
        """Wall time at which the next tick is due.

        Args:
            now: Wall time.
            rate: Robot time per wall time, at most; 0 is as fast as it goes.
        """
        if rate <= 0.0:
            self._due = now
            return now
        self._due += self._tick / rate
        if now > self._due + SLACK:
            self._due = now
        return self._due


class RealTimeFactor:
    """Robot time per wall time over the last second or so."""

    WINDOW = 1.0

    def __init__(self) -> None:
        self._wall = 0.0
        self._robot = 0.0
        self.value = 0.0

    def start(self, robot: float, now: float) -> None:
        """Begin to count at a robot time and wall time."""
        self._robot, self._wall = robot, now

    def update(self, robot: float, now: float) -> None:
        """Take in a robot time and the wall time it was reached."""
        elapsed = now - self._wall
        if robot < self._robot:
            self.start(robot, now)
        elif elapsed >= self.WINDOW:
            self.value = (robot - self._robot) / elapsed
            self.start(robot, now)
