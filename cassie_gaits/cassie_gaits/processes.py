"""Local processes that end with their parent process, for whatever reason that ends."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool

from cassie_gaits.errors import GaitLibraryError
from cassie_msgs.processes import end_with_parent

DIED = "a worker process died, perhaps for lack of memory"
"""Error message for a worker that ended by itself."""


def available_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0))


@contextlib.contextmanager
def local_processes(count: int) -> Iterator[Executor]:
    """Executor of forked processes, which share everything that is loaded and set up by now.

    An exception in the block ends the processes at once; their present work is lost.

    Args:
        count: Number of processes.

    Raises:
        GaitLibraryError: if a process died, for example because the system ran out of memory.
    """
    context = multiprocessing.get_context("fork")
    pool = ProcessPoolExecutor(count, mp_context=context, initializer=end_with_starter)
    try:
        yield pool
    except BaseException as error:
        # The present work of a process can take a minute, and its result is not needed.
        for process in list((pool._processes or {}).values()):
            process.terminate()
        if isinstance(error, BrokenProcessPool):
            raise GaitLibraryError(DIED) from None
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def obey_parent() -> None:
    """Let a worker ignore Ctrl-C, which its parent handles, and end when the parent ends it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


def end_with_starter() -> None:
    """Have this forked worker obey its parent, and end when that dies, for whatever reason.

    It must be started by a thread that lives as long as the parent.
    """
    obey_parent()
    parent = multiprocessing.parent_process()
    assert parent is not None and parent.pid is not None
    end_with_parent(parent.pid)
