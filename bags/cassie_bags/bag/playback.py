"""Timing of a playback: when each message is due, with rate, pause, step, seek and loop.

Wall time comes in as an argument; nothing here waits.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence

RATES = (0.01, 1000.0)
"""Smallest and largest ratio of robot time to wall time."""


class Playback:
    """Position in a recording that is played.

    Attributes:
        rate: Ratio of robot time to wall time.
        paused: Whether the playback is paused.
        rounds: How often the playback began again.
    """

    def __init__(
        self,
        times: Sequence[int],
        *,
        rate: float = 1.0,
        loop: bool = False,
        paused: bool = False,
        begin: int | None = None,
        end: int | None = None,
    ) -> None:
        """Prepare to play.

        Args:
            times: Log time of each message, ascending. In ns.
            rate: Ratio of robot time to wall time.
            loop: Whether the playback begins again at the end.
            paused: Whether the playback waits at the beginning.
            begin: Time of the first message to be played; the first of all by default. In ns.
            end: Time up to which messages are played; the last of all by default. In ns.
        """
        self._times = times
        self.begin = times[0] if begin is None else begin
        self.end = times[-1] if end is None else end
        self._first = bisect_left(times, self.begin)
        self._last = bisect_right(times, self.end)
        self._loop = loop
        self.rate = rate
        self.paused = paused
        self.rounds = 0
        self._index = self._first
        self._anchor = self.begin  # log time at the wall time `_wall`
        self._wall: int | None = None

    @property
    def finished(self) -> bool:
        """Whether nothing is left to be played."""
        return self._index >= self._last and not self._loop

    def position(self, wall: int) -> int:
        """Log time of the position at a wall time. Both in ns."""
        if self.paused or self._wall is None:
            return self._anchor
        return min(self.end, self._anchor + int((wall - self._wall) * self.rate))

    def next(self, wall: int) -> tuple[int | None, float]:
        """The next message if it is due at a wall time (ns), or the time to wait for it.

        Returns:
            Index of a message, which then counts as played, and 0. If no message is due: None, and
            wall time to wait, in s; infinite while paused or finished.
        """
        if self._wall is None:
            self._wall = wall
        if self._index >= self._last:
            if not self._loop or self._first >= self._last or self.paused:
                return None, float("inf")
            self.rounds += 1
            self.seek(self.begin, wall)
        due = self._times[self._index]
        left = due - self.position(wall)
        if left <= 0:
            self._index += 1
            return self._index - 1, 0.0
        return None, float("inf") if self.paused else left * 1e-9 / self.rate

    def pause(self, paused: bool, wall: int) -> None:
        """Pause the playback, or resume it."""
        self._anchor, self._wall = self.position(wall), wall
        self.paused = paused

    def set_rate(self, rate: float, wall: int) -> None:
        """Play faster or slower from now on."""
        self._anchor, self._wall = self.position(wall), wall
        self.rate = min(max(rate, RATES[0]), RATES[1])

    def seek(self, time: int, wall: int) -> range:
        """Continue from another log time, limited to the played part, at a wall time. In ns.

        Returns:
            Indices of the messages that are skipped; none after a seek backward.
        """
        before = self._index
        self._anchor, self._wall = min(max(time, self.begin), self.end), wall
        self._index = max(self._first, bisect_left(self._times, self._anchor))
        return range(before, self._index)

    @property
    def before(self) -> range:
        """Indices of the messages before the played part."""
        return range(self._first)

    def step(self, wall: int) -> bool:
        """While paused, advance to the next time that has a message; False if there is none."""
        if not self.paused or self._index >= self._last:
            return False
        self._anchor, self._wall = self._times[self._index], wall
        return True
