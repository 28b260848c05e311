"""Robot time against wall time. Wall times come in as arguments, in s."""

from __future__ import annotations

from cassie_msgs.layout import Sensors

SLACK = 0.1
"""Delay behind the pace that is caught up; more is forgiven. In s."""

SHORTEST_TICK = 0.5
"""Share of a tick that an answer has while a delay is caught up: robot time then runs at twice
wall time at most. Otherwise a simulator that the system woke late would deny its own delay to
the controller, as ticks without a command."""


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

    def next_due(self, now: float, rate: float, least: float = 0.0) -> float:
        """Wall time at which the next tick is due.

        Args:
            now: Wall time.
            rate: Robot time per wall time, at most; 0 is as fast as it goes.
            least: Share of a tick that is left until then, also while a delay is caught up.
        """
        if rate <= 0.0:
            self._due = now
            return now
        self._due += self._tick / rate
        if now > self._due + SLACK:
            self._due = now
        return max(self._due, now + least * self._tick / rate)


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


class TickTiming:
    """Counts control ticks that went wrong while robot time is paced by the wall clock.

    Args:
        tick: Length of a control tick. In s.

    Attributes:
        missed: Ticks without a new command, counted from the first one that had one.
        late: Ticks that began more than half a tick late.
        longest_delay: Of a tick. In s.
    """

    def __init__(self, tick: float) -> None:
        self._tick = tick
        self.restart()

    def restart(self) -> None:
        """A new episode."""
        self.missed = self.late = 0
        self.longest_delay = 0.0
        self._begun = False

    def tick(self, delay: float, *, answered: bool) -> None:
        """Take in a tick: how late it ends, in s, and whether a new command had come."""
        self._begun = self._begun or answered
        if not self._begun:
            return
        self.missed += not answered
        self.late += delay > 0.5 * self._tick
        self.longest_delay = max(self.longest_delay, delay)

    def write(self, sample: Sensors) -> None:
        """Fill in what a sample tells of them."""
        sample.wall_paced[...] = 1
        sample.missed_ticks[...] = self.missed
        sample.late_ticks[...] = self.late
        sample.longest_delay[...] = self.longest_delay
