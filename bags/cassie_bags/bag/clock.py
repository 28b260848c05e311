"""Robot time of the messages of a recording, continued over episodes.

Robot time begins at 0 again in each episode. For one time axis in a bag, each new episode begins
where the last one ended.

Any node may publish any time. As the nodes of the robot do, the clock follows one writer of each
topic: the one whose samples continue robot time. A time that does not continue it is believed once
`CONFIRMED` samples of one writer have followed each other and no followed writer is heard any more.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cassie_bags.bag.recording import LANE_TOPICS, TYPES
from cassie_msgs.bounds import CONFIRMED
from cassie_msgs.layout import OperatorCommand

CLOCK_TOPIC = "/clock"

_EPISODIC = frozenset(LANE_TOPICS) - {OperatorCommand.TOPIC}  # a person's command carries wall time
_STAMPED = (frozenset(TYPES) - frozenset(LANE_TOPICS)) | {CLOCK_TOPIC}
_STAMP = struct.Struct("<4xiI")
_STAMP_AND_EPISODE = struct.Struct("<4xiII")
# By so much a stamp of another writer, or one without episode, may differ from robot time. In ns.
_PLAUSIBLE = 1_000_000_000
_LEAD = 60_000_000_000  # ns by which a followed writer may jump ahead
_SILENT = 500_000_000  # ns of wall time after which a writer counts as silent


class _Source(NamedTuple):
    """Where a time comes from; `episode` is None where the message has none."""

    topic: str
    writer: bytes
    episode: int | None = None


@dataclass
class _Doubt:
    """Samples of a source in a row that do not continue robot time.

    Attributes:
        source: Their source.
        first, last: First and last stamp. In ns.
        received: When the first one came. In ns.
        time: Robot time then; 0 if it was not known. In ns.
        count: Number of samples.
    """

    source: _Source
    first: int
    last: int
    received: int
    time: int
    count: int = 1

    def is_continued_by(self, source: _Source, stamp: int) -> bool:
        return source == self.source and 0 <= stamp - self.last <= _LEAD


class RobotClock:
    """Gives each message of a recording its robot time.

    A recording may begin while the robot runs. The time of messages is unknown until a writer has
    shown that its time goes on.

    Attributes:
        now: Newest robot time, continued over episodes. In ns.
        known: Whether robot time is known: a writer has it, or `run_on_wall` was called.
    """

    def __init__(self) -> None:
        self.now = 0
        self.known = False
        self._start = self._first = 0
        self._last: dict[str, int] = {}  # robot time by topic without an episode
        self._starts: dict[int, int] = {}  # start time by episode
        self._episode: int | None = None
        self._followed: dict[str, bytes] = {}  # writer by topic
        self._heard = 0  # when a followed writer was heard, in ns
        self._doubts: dict[str, _Doubt] = {}
        self._wall_start: int | None = None
        # Robot time by time of receipt, since the last call of `times_at`. Both in ns.
        self._points: list[tuple[int, int]] = []
        self._interpolated = 0  # newest time of receipt in that call, in ns

    def run_on_wall(self, wall_time: int) -> None:
        """Let time run as the wall clock does until a writer has robot time.

        Args:
            wall_time: Wall time of the first message. In ns.
        """
        self.known = True
        self._wall_start = wall_time

    def time_of(self, topic: str, raw: bytes, received: int, writer: bytes = b"") -> int | None:
        """Robot time that a message carries, in ns; None if it has none that is believed.

        Args:
            topic: Topic of the message.
            raw: Serialized message.
            received: Wall time of receipt. In ns.
            writer: Identity of the message's writer.
        """
        try:
            if topic in _EPISODIC:
                seconds, nanoseconds, episode = _STAMP_AND_EPISODE.unpack_from(raw)
                stamp = seconds * 1_000_000_000 + nanoseconds
                return self._of_lane(_Source(topic, writer, episode), stamp, received)
            if topic in _STAMPED:
                seconds, nanoseconds = _STAMP.unpack_from(raw)
                stamp = seconds * 1_000_000_000 + nanoseconds
                if self._episode is None:
                    return self._of_clock(_Source(topic, writer), stamp, received)
                return self._beside_lane(topic, stamp)
        except struct.error:  # any publisher may send bytes of another type
            pass
        return None

    def times_at(self, received: Sequence[int]) -> list[int]:
        """Robot time at wall times of receipt, between the samples that carry it. Both in ns.

        The times of all samples received until then must have been taken in by `time_of`.
        """
        if self._wall_start is not None and received:
            self._note(max(received), self._on_wall(max(received)))
        # A sample may be taken after others that came later; no time goes back for it.
        points = sorted(each for each in self._points if each[0] >= self._interpolated)
        if not points:
            return [self.now] * len(received)
        wall, robot = np.array(points, np.int64).T
        robot = np.maximum.accumulate(robot)
        self._interpolated = int(wall[-1])
        self._points = [(self._interpolated, int(robot[-1]))]
        since = np.array(received, np.int64) - wall[0]  # from a start: floats have 53 bits
        if self._wall_start is not None:
            times = np.maximum(since + wall[0] - self._wall_start, 0)
        else:
            passed = np.interp(since, wall - wall[0], robot - robot[0])
            times = robot[0] + passed.astype(np.int64)
        found: list[int] = times.tolist()
        return found

    def _of_lane(self, source: _Source, stamp: int, received: int) -> int | None:
        topic, writer, episode = source.topic, source.writer, source.episode
        follows = self._followed.get(topic, writer) == writer
        time = self._start + stamp
        if episode == self._episode:
            ahead = _LEAD if follows else _PLAUSIBLE
            if self._first - _PLAUSIBLE <= time <= self.now + ahead:
                return self._believe(source, time, received)
        elif episode in self._starts:  # a late message of an earlier episode
            time = self._starts[episode] + stamp
            return max(0, time) if self._first - _PLAUSIBLE <= time <= self.now else None
        elif self._follows_with_next_episode(source) and 0 <= stamp <= _LEAD:
            self._begin(episode, self.now)
            return self._believe(source, self._start + stamp, received)
        doubt = self._confirmed(source, stamp, received)
        if doubt is None:
            return None
        if episode != self._episode:
            self._begin(episode, self._continued(doubt, received))
            self._note(doubt.received, self._start + doubt.first)
        return self._believe(source, self._start + stamp, received)

    def _of_clock(self, source: _Source, stamp: int, received: int) -> int | None:
        """Time of a stamp without an episode, where there is no robot."""
        topic, writer = source.topic, source.writer
        if self.known and self._wall_start is None:
            time = self._start + stamp
            follows = self._followed.get(topic, writer) == writer
            last = self._last.get(topic, self._first - _PLAUSIBLE)
            if last <= time <= self.now + (_LEAD if follows else _PLAUSIBLE):
                self._last[topic] = time
                return self._believe(source, time, received)
        doubt = self._confirmed(source, stamp, received)
        if doubt is None:
            return None
        self._begin(None, self._continued(doubt, received))
        self._note(doubt.received, self._start + doubt.first)
        self._last[topic] = self._start + stamp
        return self._believe(source, self._start + stamp, received)

    def _follows_with_next_episode(self, source: _Source) -> bool:
        """Whether a followed writer begins an episode, as all nodes do when the robot is reset."""
        if self._episode is None or source.episode is None:
            return False
        followed = self._followed.get(source.topic) == source.writer
        return followed and source.episode > self._episode

    def _beside_lane(self, topic: str, stamp: int) -> int | None:
        """Time of a stamp without an episode, where the control lane tells robot time."""
        time = self._start + stamp
        # Where the recorder was held up, one topic may lie far behind another.
        oldest = self._last.get(topic, self._first)
        if not oldest - _PLAUSIBLE <= time <= self.now + _PLAUSIBLE:
            return None  # of another episode
        self._last[topic] = time
        return max(0, time)

    def _confirmed(self, source: _Source, stamp: int, received: int) -> _Doubt | None:
        """What a sample that does not continue robot time confirms; None if it is in doubt."""
        topic = source.topic
        doubt = self._doubts.get(topic)
        if doubt is not None and doubt.is_continued_by(source, stamp):
            doubt.last = stamp
            doubt.count += 1
        else:
            now = self._now_at(received)
            doubt = self._doubts[topic] = _Doubt(source, stamp, stamp, received, now)
        if doubt.count < CONFIRMED:
            return None
        begins_lane = source.episode is not None and self._episode is None
        own = self._followed.get(topic) == source.writer
        silent = received - self._heard >= _SILENT
        return doubt if begins_lane or own or silent else None

    def _continued(self, doubt: _Doubt, received: int) -> int:
        """Start of a run of samples that goes on from the time at which its first one came."""
        if not self.known:
            self._first = doubt.first
            return 0
        time = max(doubt.time, self._now_at(received) - doubt.last + doubt.first)
        begins_lane = doubt.source.episode is not None and self._episode is None
        if begins_lane and abs(self._start + doubt.first - time) <= _PLAUSIBLE:
            return self._start  # the clock was the robot's own
        return time - doubt.first

    def _begin(self, episode: int | None, start: int) -> None:
        self.known = True
        self._wall_start = None
        self._start, self._episode = start, episode
        if episode is not None:
            self._starts[episode] = start

    def _believe(self, source: _Source, time: int, received: int) -> int:
        time = max(0, time)
        self._followed[source.topic] = source.writer
        self._doubts.pop(source.topic, None)
        self._heard = max(self._heard, received)
        self._note(received, time)
        return time

    def _note(self, received: int, time: int) -> None:
        self.now = max(self.now, time)
        self._points.append((received, time))

    def _now_at(self, received: int) -> int:
        return self.now if self._wall_start is None else max(self.now, self._on_wall(received))

    def _on_wall(self, received: int) -> int:
        return 0 if self._wall_start is None else received - self._wall_start
