"""Local processes that end with the one that started them, however that ends."""

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


def available_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0))


@contextlib.contextmanager
def local_processes(count: int) -> Iterator[Executor]:
    """Forked processes, which share what is loaded and set up by now.

    An exception in the block ends them at once; what they are at is lost.

    Args:
        count: Of processes.

    Raises:
        GaitLibraryError: if one of them died, as when the system had no memory left for it.
    """
    context = multiprocessing.get_context("fork")
    pool = ProcessPoolExecutor(count, mp_context=context, initializer=_begin_worker)
    try:
        yield pool
    except BaseException as error:
        # What they are at can take a minute and nobody waits for it.
        for process in list((pool._processes or {}).values()):
            process.terminate()
        if isinstance(error, BrokenProcessPool):
            reason = "a worker process died, perhaps for want of memory"
            raise GaitLibraryError(reason) from None
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _begin_worker() -> None:
    """A worker leaves Ctrl-C to its parent, which ends it, and ends when that one is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    end_with_parent()
