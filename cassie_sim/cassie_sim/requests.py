"""Requests of other threads, which the loop runs between ticks."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

T = TypeVar("T")


class Requests:
    """A queue of calls: `call` is for any thread, `run_pending` for the loop's thread."""

    def __init__(self) -> None:
        self._queue: deque[Callable[[], None]] = deque()
        self.wake: Callable[[], None] = _nothing
        """Called after each new request, to end a wait of the loop."""

    def call(self, function: Callable[[], T]) -> Future[T]:
        """Future with the result or error of `function`, which the loop calls."""
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
        """Whether there are requests in the queue."""
        return bool(self._queue)

    def run_pending(self) -> None:
        """Run the requests in the queue."""
        while self._queue:
            self._queue.popleft()()


def _nothing() -> None:
    return None
