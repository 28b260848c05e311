"""Lower and upper bounds on the episode and seq of received messages.

A single number far ahead would make all later messages look old, and a number from the past would
set a node back. A node that works sends neither.
"""

from __future__ import annotations

import ctypes

LEAD = 600_000
"""Control ticks by which a stream may jump ahead: 20 minutes at 500 Hz, 5 at 2 kHz."""

EPISODE_LEAD = 1 << 31
"""Episodes by which a stream may jump ahead. The first episode's number is the time at which the
simulator started, in s."""

CONFIRMED = 3
"""Consecutive messages after which a jump beyond the bounds is accepted: the stream went on while
this node did not receive it."""


def outside(name: str, value: int, low: int, high: int) -> str:
    """Error message for a number outside `low` .. `high`; empty if it is not. Bounds are inside."""
    return "" if low <= value <= high else f"{name} = {value} is outside {low} .. {high}"


class Place(ctypes.Structure):
    """Place in a stream, in memory that compiled code reads and writes, too.

    Attributes:
        seq, episode: The place.
        known: Whether there is a place yet.
    """

    _fields_ = (("seq", ctypes.c_uint64), ("episode", ctypes.c_uint32), ("known", ctypes.c_bool))


class Progress:
    """Bounds on a stream whose messages carry a rising episode and seq, such as sensor samples.

    A message may repeat the last one, follow it within `LEAD` ticks of the same episode, or begin
    a later episode. A restarted sender is a new stream: `restart` forgets the old one.

    Args:
        last: Place of the message accepted last, which is kept there.
    """

    def __init__(self, last: Place | None = None) -> None:
        self._last = last or Place()
        self.restart()

    def restart(self) -> None:
        """Forget the stream: the next message may have any episode and seq."""
        self._last.known = False
        self._refused: tuple[int, int] | None = None
        self._in_a_row = 0

    def refusal(self, episode: int, seq: int) -> str:
        """Why a message is refused; empty if it is accepted, and the stream goes on from it."""
        last = self._last
        if not last.known:
            problem = ""
        elif episode == last.episode:
            problem = outside("seq", seq, last.seq, last.seq + LEAD)
        else:
            problem = outside("episode", episode, last.episode, last.episode + EPISODE_LEAD)
        if problem:
            if not self._is_confirmed(episode, seq):
                return problem
            self.restart()
        last.episode, last.seq, last.known = episode, seq, True
        return ""

    def _is_confirmed(self, episode: int, seq: int) -> bool:
        """Whether `CONFIRMED` refused messages have followed each other in order."""
        before, self._refused = self._refused, (episode, seq)
        follows = before is not None and before[0] == episode and 0 < seq - before[1] <= LEAD
        self._in_a_row = self._in_a_row + 1 if follows else 1
        return self._in_a_row >= CONFIRMED
