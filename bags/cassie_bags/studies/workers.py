"""Workers that compute the trials of studies: local processes, or a Dask cluster.

Also runs that continue from a common beginning, each in a copy of this process.
"""

from __future__ import annotations

import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    CancelledError,
    Future,
    ProcessPoolExecutor,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from itertools import islice
from multiprocessing import connection, get_context
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any, Protocol, TypeVar, cast

from tqdm import tqdm

from cassie_bags.errors import RunError
from cassie_gaits.processes import DIED, available_cores, end_with_starter, obey_parent

Item = TypeVar("Item")
Result = TypeVar("Result")
Function = Callable[[Item], Result]
Indexed = Iterator[tuple[int, Result]]

CONNECT_TIMEOUT = 10
"""Time-out of a scheduler's answer. In s of wall time."""

_NICENESS = 5


class Workers(Protocol):
    """Workers that apply a function to items, several at a time."""

    count: int

    def results(self, function: Function[Item, Result], items: Sequence[Item]) -> Indexed[Result]:
        """Yield index and result of each item on completion; items not asked for are not begun."""
        ...

    def close(self) -> None:
        """End the workers."""
        ...


class ThisProcess:
    """Computes in this process, one item at a time."""

    count = 1

    def results(self, function: Function[Item, Result], items: Sequence[Item]) -> Indexed[Result]:
        """See `Workers.results`."""
        for index, item in enumerate(items):
            yield index, function(item)

    def close(self) -> None:
        """Nothing to end."""


class CachedWorkers:
    """Computes nothing twice: rows with the same runs share their results.

    Args:
        pool: Workers that compute.
    """

    def __init__(self, pool: Workers) -> None:
        self.count = pool.count
        self._pool = pool
        self._known: dict[str, Any] = {}

    def results(self, function: Function[Item, Result], items: Sequence[Item]) -> Indexed[Result]:
        """See `Workers.results`; items with the same `repr` are the same."""
        keys = [repr(item) for item in items]
        known = {index: self._known[key] for index, key in enumerate(keys) if key in self._known}
        yield from known.items()
        rest = [index for index in range(len(items)) if index not in known]
        for place, result in self._pool.results(function, [items[index] for index in rest]):
            self._known[keys[rest[place]]] = result
            yield rest[place], result

    def close(self) -> None:
        """End the workers."""
        self._pool.close()


class LocalProcesses:
    """Computes in processes of this machine.

    Args:
        count: Number of processes.
    """

    def __init__(self, count: int) -> None:
        self.count = count
        self._pool = ProcessPoolExecutor(count, get_context("spawn"), _begin)
        self._starting = threading.Lock()
        self._given: set[Future[Any]] = set()

    def results(self, function: Function[Item, Result], items: Sequence[Item]) -> Indexed[Result]:
        """See `Workers.results`.

        The pool gets no more items than its processes can run at once, and no callbacks: a pool
        that is ended while it has cancelled work writes a traceback.

        Raises:
            RunError: if a process died, as for lack of memory.
        """
        waiting = iter(enumerate(items))
        running: dict[Future[Result], int] = {}
        while True:
            try:
                for index, item in islice(waiting, self.count + 1 - len(running)):
                    running[self._submit(function, item)] = index
                if not running:
                    return
                future = next(completed(running))
                index, result = running.pop(future), future.result()
            except BrokenProcessPool:
                raise RunError(DIED) from None
            yield index, result

    def _submit(self, function: Function[Item, Result], item: Item) -> Future[Result]:
        # `close` does not see a half-started process, and such a process cannot handle Ctrl-C yet.
        with self._starting, ctrl_c_at_the_end(), children_without_ctrl_c():
            future = self._pool.submit(function, item)
            self._given = {other for other in self._given if not other.done()} | {future}
        return future

    def close(self) -> None:
        """End the processes; unfinished work is lost.

        It waits for the pool's thread. If a thread closed its pipes while Python ends, Python could
        write to closed pipes and report "Bad file descriptor".
        """
        with self._starting:
            if not all(future.done() for future in self._given):
                for process in list((self._pool._processes or {}).values()):
                    process.kill()  # first, so that no process writes to a closed pipe
            self._pool.shutdown(cancel_futures=True)


class DaskCluster:
    """Computes on the workers of a Dask scheduler, which need the same packages.

    Args:
        address: Address of the scheduler, for example tcp://10.0.0.1:8786.

    Raises:
        RunError: if the scheduler does not answer, or has no worker.
    """

    def __init__(self, address: str) -> None:
        from distributed import Client

        try:
            self._client = Client(address, timeout=CONNECT_TIMEOUT)
        except (OSError, ValueError, TimeoutError) as error:
            raise RunError(f"no Dask scheduler at {address}: {error}") from None
        try:
            self._client.wait_for_workers(1, timeout=CONNECT_TIMEOUT)
        except TimeoutError:
            self._client.close()
            raise RunError(
                f"the Dask scheduler at {address} had no worker within {CONNECT_TIMEOUT} s"
            ) from None
        self._address = address
        self.count = max(1, sum(self._client.nthreads().values()))

    def results(self, function: Function[Item, Result], items: Sequence[Item]) -> Indexed[Result]:
        """See `Workers.results`.

        Raises:
            RunError: if workers die on an item or lack these packages, or the scheduler has gone.
        """
        from distributed import KilledWorker, as_completed

        futures = {
            self._client.submit(function, item, pure=False): index
            for index, item in enumerate(items)
        }
        try:
            for future in as_completed(futures):
                yield futures[future], future.result()
        except (KilledWorker, CancelledError, ImportError) as error:
            reason = " ".join(str(error).split()) or type(error).__name__
            raise RunError(f"the Dask cluster at {self._address}: {reason}") from None
        finally:
            for pending in futures:
                pending.cancel()

    def close(self) -> None:
        """Leave the cluster, which continues to run."""
        self._client.close()


def workers(jobs: int | None, scheduler: str | None) -> Workers:
    """Workers according to a command line.

    Args:
        jobs: Number of local processes; None for one on each core.
        scheduler: Address of a Dask scheduler instead of local processes.

    Raises:
        RunError: if the scheduler does not answer.
    """
    if scheduler is not None:
        return DaskCluster(scheduler)
    return LocalProcesses(jobs or available_cores())


def all_results(
    pool: Workers, function: Function[Item, Result], items: Sequence[Item], bar: tqdm
) -> list[Result]:
    """Results in the order of the items.

    Args:
        pool: Workers that apply the function.
        function: Function of an item.
        items: Items.
        bar: Progress bar, which advances by one for each item.
    """
    results: dict[int, Result] = {}
    for index, result in pool.results(function, items):
        results[index] = result
        bar.update()
    return [results[index] for index in range(len(items))]


def in_copies(
    function: Function[Item, Result], items: Sequence[Item], jobs: int
) -> Iterator[Result]:
    """Apply a function to items, each in a copy of this process, made when the item's turn comes.

    Args:
        function: Function that each copy applies; its exceptions are raised here.
        items: Items, one for each copy.
        jobs: Number of copies at a time.

    Yields:
        Results in the order of the items.

    Raises:
        RunError: if a copy died, as for lack of memory.
    """
    waiting = deque(enumerate(items))
    running: dict[Connection, tuple[int, BaseProcess]] = {}
    results: dict[int, Result] = {}
    try:
        for due in range(len(items)):
            while due not in results:
                while waiting and len(running) < jobs:
                    index, item = waiting.popleft()
                    receiver, process = _begin_copy(function, item)
                    running[receiver] = (index, process)
                for ready in connection.wait(list(running)):
                    receiver = cast(Connection, ready)
                    results[running[receiver][0]] = _received(receiver)
                    _, process = running.pop(receiver)
                    process.join()
                    receiver.close()
            yield results.pop(due)
    finally:
        for _, process in running.values():
            process.kill()
            process.join()


def _begin_copy(function: Function[Item, Result], item: Item) -> tuple[Connection, BaseProcess]:
    context = get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_answer, args=(sender, function, item), daemon=True)
    with children_without_ctrl_c():
        process.start()
    sender.close()  # so that receiving ends when the copy ends
    return receiver, process


def _received(receiver: Connection) -> Any:
    try:
        result, error = receiver.recv()
    except EOFError:
        raise RunError(DIED) from None
    if error is not None:
        raise error
    return result


def _answer(sender: Connection, function: Function[Item, Result], item: Item) -> None:
    end_with_starter()
    try:
        answer: tuple[Result | None, Exception | None] = (function(item), None)
    except Exception as error:
        answer = (None, error)
    sender.send(answer)


def completed(futures: Iterable[Future[Result]]) -> Iterator[Future[Result]]:
    """Yield futures as they complete.

    It wakes up twice a second: an endless wait can miss a Ctrl-C at its beginning.
    """
    pending = set(futures)
    while pending:
        done, pending = wait(pending, 0.5, FIRST_COMPLETED)
        yield from done


@contextmanager
def ctrl_c_at_the_end() -> Iterator[list[int]]:
    """Delay Ctrl-C and SIGTERM to the end of the block; yields the list of signals that came."""
    received: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield received  # only the main thread gets signals
        return
    signals = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(each, lambda number, _: received.append(number)) for each in signals]
    try:
        yield received
    finally:
        for each, handler in zip(signals, before, strict=True):
            signal.signal(each, handler)
        if received:
            signal.raise_signal(received[0])


@contextmanager
def children_without_ctrl_c() -> Iterator[None]:
    """Block Ctrl-C for processes that the block starts, until they can ignore it themselves."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin() -> None:
    """Start a worker, with a lower priority than other processes of the machine."""
    obey_parent()
    os.nice(_NICENESS)
