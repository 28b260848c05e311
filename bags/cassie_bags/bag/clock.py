"""Robot time of the messages of a recording, continued over episodes.

Robot time begins at 0 again in each episode. For one time axis in a bag, each new episode begins
where the last one ended.
"""

from __future__ import annotations

import struct
from contextlib import suppress

from cassie_bags.bag.recording import LANE_TOPICS, TYPES
from cassie_msgs.layout import OperatorCommand

CLOCK_TOPIC = "/clock"

_EPISODIC = frozenset(LANE_TOPICS) - {OperatorCommand.TOPIC}  # a person's command carries wall time
_STAMPED = (frozenset(TYPES) - frozenset(LANE_TOPICS)) | {CLOCK_TOPIC}
_STAMP = struct.Struct("<4xiI")
_STAMP_AND_EPISODE = struct.Struct("<4xiII")
# A stamp without episode may lie so far before the last one of its topic, or after the newest
# time, in ns.
_PLAUSIBLE = 1_000_000_000


class RobotClock:
    """Gives each message of a recording its robot time.

    A recording may begin while the robot runs. The time of messages without a stamp is unknown
    until the first message with robot time.

    Attributes:
        now: Newest robot time, continued over episodes. In ns.
        known: Whether robot time is known: a message carried it, or `run_on_wall` was called.
    """

    def __init__(self) -> None:
        self.now = 0
        self.known = False
        self._start = self._first = 0
        self._last: dict[str, int] = {}  # robot time by topic without an episode
        self._starts: dict[int, int] = {}  # start time by episode
        self._episode: int | None = None
        self._wall_start: int | None = None

    def run_on_wall(self, wall_time: int) -> None:
        """Let time run as the wall clock does until a message carries robot time.

        Args:
            wall_time: Wall time of the first message. In ns.
        """
        self.known = True
        self._wall_start = wall_time

    def time_of(self, topic: str, raw: bytes, wall_time: int) -> int:
        """Robot time of a message; the newest known one if it carries none. In ns.

        Args:
            topic: Topic of the message.
            raw: Serialized message.
            wall_time: Wall time of receipt. In ns.
        """
        # Any publisher may send bytes of another type, or a time before the first.
        with suppress(struct.error):
            if topic in _EPISODIC:
                return max(0, self._of_lane(raw))
            if topic in _STAMPED:
                return max(0, self._of_stamped(topic, raw))
        if self._wall_start is not None:
            self.now = max(self.now, wall_time - self._wall_start)
        return self.now

    def _of_lane(self, raw: bytes) -> int:
        seconds, nanoseconds, episode = _STAMP_AND_EPISODE.unpack_from(raw)
        stamp = seconds * 1_000_000_000 + nanoseconds
        if self._episode is None:
            self._begin(stamp)
            self._episode = episode
        elif episode > self._episode:
            self._start = self.now
            self._episode = episode
        elif episode < self._episode:  # a late message of an earlier episode
            start = self._starts.get(episode)
            return self.now if start is None else start + stamp
        self._starts[episode] = self._start
        time: int = self._start + stamp
        self.now = max(self.now, time)
        return time

    def _of_stamped(self, topic: str, raw: bytes) -> int:
        seconds, nanoseconds = _STAMP.unpack_from(raw)
        stamp = seconds * 1_000_000_000 + nanoseconds
        if self._episode is None:
            self._begin(stamp)
        time: int = self._start + stamp
        # Where the recorder was held up, one topic may lie far behind another.
        oldest = self._last.get(topic, self._first)
        plausible = oldest - _PLAUSIBLE <= time <= self.now + _PLAUSIBLE
        if self._episode is not None and not plausible:
            return self.now  # of another episode
        self._last[topic] = time
        self.now = max(self.now, time)
        return time

    def _begin(self, stamp: int) -> None:
        """Use the first robot time: set the start of the time axis."""
        if self._wall_start is not None:
            self._start = self.now - stamp
            self._wall_start = None
        self._first = self._start + stamp
        self.known = True
