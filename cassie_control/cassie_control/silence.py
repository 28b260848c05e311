"""Whether another node has fallen silent. Wall times come in as arguments, in s."""

from __future__ import annotations


class Silence:
    """Watches how long ago something was last heard.

    Args:
        limit: Silence after which it counts as lost. In s.
        start_limit: The same before it was first heard. In s.
        now: Present time.
    """

    def __init__(self, limit: float, start_limit: float, now: float) -> None:
        self._limit, self._start_limit = limit, start_limit
        self._since = now
        self._ever = False

    def heard(self, now: float) -> None:
        """It was heard just now."""
        self._since = now
        self._ever = True

    def excuse(self, now: float) -> None:
        """Start to count anew: it has had no reason to be heard until now."""
        self._since = now

    def lost(self, now: float) -> bool:
        """Whether it has been silent for too long."""
        return now - self._since > (self._limit if self._ever else self._start_limit)
