"""Whether another node has become silent. Wall times come in as arguments, in s."""

from __future__ import annotations


class Silence:
    """Time-out of another node's messages.

    Args:
        limit: Time-out after the last message. In s.
        start_limit: Time-out before the first message. In s.
        now: Present time.
    """

    def __init__(self, limit: float, start_limit: float, now: float) -> None:
        self._limit, self._start_limit = limit, start_limit
        self._since = now
        self._ever = False

    @property
    def since(self) -> float:
        """When the last message came, or the time-out started anew. In s."""
        return self._since

    def heard(self, now: float) -> None:
        """A message has just arrived."""
        self._since = now
        self._ever = True

    def excuse(self, now: float) -> None:
        """Start the time-out anew, as no message was expected until now."""
        self._since = now

    def lost(self, now: float) -> bool:
        """Whether the time-out has passed."""
        return now - self._since > (self._limit if self._ever else self._start_limit)
