"""Work that other threads hand to the loop, done between ticks."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

T = TypeVar("T")


class Requests:
    """A queue of calls. `call` from any thread, `run_pending` from the loop's."""

    def __init__(self) -> None:
        self._queue: deque[Callable[[], None]] = deque()
        self.wake: Callable[[], None] = _nothing
        """Called after each new request, to end a wait of the loop."""

    def call(self, function: Callable[[], T]) -> Future[T]:
        """Have `function` called by the loop; its result or error comes in the future."""
        future: Future[T] = Future()

        def run() -> None:
            try:
                future.set_result(function())
            except Exception as error:
                future.set_exception(error)

        self._queue.append(run)
        self.wake()
        return future

    @property
    def pending(self) -> bool:
        """Whether something is asked for."""
        return bool(self._queue)

    def run_pending(self) -> None:
        """Do what was asked for."""
        while self._queue:
            self._queue.popleft()()


def _nothing() -> None:
    return None
