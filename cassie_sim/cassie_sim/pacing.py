"""Pacing of robot time by wall time. Wall times come in as arguments, in s."""

from __future__ import annotations

from cassie_msgs.layout import Sensors

SLACK = 0.1
"""Largest delay behind the pace that is caught up; a larger one is dropped. In s."""

SHORTEST_TICK = 0.5
"""Least share of a tick for an answer while a delay is caught up: robot time then runs at twice
wall time at most. Otherwise a simulator that the system woke late would leave the controller no
time to answer, and its own delay would count as ticks without a command."""


class Pace:
    """Computes when the next tick is due.

    Args:
        tick: Length of a control tick in robot time. In s.
    """

    def __init__(self, tick: float) -> None:
        self._tick = tick
        self._due = 0.0

    def start(self, now: float) -> None:
        """Begin to count at wall time `now`."""
        self._due = now

    def next_due(self, now: float, rate: float, least: float = 0.0) -> float:
        """Wall time at which the next tick is due.

        Args:
            now: Wall time.
            rate: Largest ratio of robot time to wall time; 0 is no limit.
            least: Least share of a tick until the next one is due, while a delay is caught up.
        """
        if rate <= 0.0:
            self._due = now
            return now
        self._due += self._tick / rate
        if now > self._due + SLACK:
            self._due = now
        return max(self._due, now + least * self._tick / rate)


class RealTimeFactor:
    """Ratio of robot time to wall time over about the last second."""

    WINDOW = 1.0

    def __init__(self) -> None:
        self._wall = 0.0
        self._robot = 0.0
        self.value = 0.0

    def start(self, robot: float, now: float) -> None:
        """Begin to count at a robot time and wall time."""
        self._robot, self._wall = robot, now

    def update(self, robot: float, now: float) -> None:
        """Take in a robot time and the wall time at which it was reached."""
        elapsed = now - self._wall
        if robot < self._robot:
            self.start(robot, now)
        elif elapsed >= self.WINDOW:
            self.value = (robot - self._robot) / elapsed
            self.start(robot, now)


class TickTiming:
    """Counts missed and late control ticks while robot time is paced by the wall clock.

    Args:
        tick: Length of a control tick. In s.

    Attributes:
        missed: Ticks without a new command, counted from the first tick with one.
        late: Ticks that ended more than half a tick late.
        longest_delay: Longest delay of a tick. In s.
    """

    def __init__(self, tick: float) -> None:
        self._tick = tick
        self.restart()

    def restart(self) -> None:
        """Begin a new episode."""
        self.missed = self.late = 0
        self.longest_delay = 0.0
        self._begun = False

    def tick(self, delay: float, *, answered: bool) -> None:
        """Take in the end of a tick: its delay, in s, and whether a new command had come."""
        self._begun = self._begun or answered
        if not self._begun:
            return
        self.missed += not answered
        self.late += delay > 0.5 * self._tick
        self.longest_delay = max(self.longest_delay, delay)

    def write(self, sample: Sensors) -> None:
        """Fill in the timing fields of a sample."""
        sample.wall_paced[...] = 1
        sample.missed_ticks[...] = self.missed
        sample.late_ticks[...] = self.late
        sample.longest_delay[...] = self.longest_delay
