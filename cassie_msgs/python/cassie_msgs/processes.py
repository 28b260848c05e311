"""How local processes start, and how they end: by Ctrl-C, with their parent, at a time-out."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import sys
import time
from collections.abc import Callable
from importlib import import_module
from types import FrameType

STOPPED = 130
"""Exit code of a process that Ctrl-C stopped, as shells have it."""

_IMPORT = "<frozen importlib._bootstrap>"  # file name of the functions that import
_AGAIN = 0.02  # s until a signal that came during an import is raised again
_PARENT_DIES = 1  # PR_SET_PDEATHSIG
_BY_THREAD = 2  # SIGEV_THREAD


class _Event(ctypes.Structure):
    """`struct sigevent` of 64 bytes, for a function that is called in a thread of its own."""

    _fields_ = (
        ("value", ctypes.c_void_p),
        ("signal", ctypes.c_int),
        ("notify", ctypes.c_int),
        ("function", ctypes.c_void_p),
        ("attributes", ctypes.c_void_p),
        ("rest", ctypes.c_byte * 32),
    )


class _Timer(ctypes.Structure):
    """`struct itimerspec`."""

    _fields_ = tuple(
        (name, ctypes.c_long) for name in ("period_s", "period_ns", "value_s", "value_ns")
    )


def entry_point(module: str) -> Callable[[], int | None]:
    """Function for a console script: imports a module, and returns what its `main()` returns.

    The imports of a node take up to a second. A Ctrl-C during them ends the process at once with
    `STOPPED` and without output. Later a Ctrl-C is a KeyboardInterrupt, see `interrupt`; `main()`
    may handle it, otherwise it also ends the process with `STOPPED`. A process that ignores Ctrl-C,
    as in the background, continues to.
    """

    def start() -> int | None:
        handled = signal.getsignal(signal.SIGINT) is signal.default_int_handler
        try:
            if handled:
                signal.signal(signal.SIGINT, lambda *_: os._exit(STOPPED))
            main: Callable[[], int | None] = import_module(module).main
            if handled:
                signal.signal(signal.SIGINT, interrupt)
            return main()
        except KeyboardInterrupt:
            return STOPPED

    return start


def interrupt(number: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt: handler of a signal, which waits while a module is imported.

    Compiled modules turn an exception during their imports into an error of their own, or lose it.
    Imports within functions come while processes run and files are open, which are to be ended and
    closed. So the signal is raised again until the import is over. SIGALRM serves for that.
    """
    while frame is not None:
        if frame.f_code.co_filename == _IMPORT:
            signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(number))
            signal.setitimer(signal.ITIMER_REAL, _AGAIN)
            return
        frame = frame.f_back
    raise KeyboardInterrupt


def run_command(name: str, run: Callable[[], int], *, stopped: str, no_reader: int) -> int:
    """Run a command, and flush its output; SIGTERM ends it as Ctrl-C does.

    Args:
        name: Name of the command, for its message.
        run: Returns the exit status.
        stopped: Message after Ctrl-C, on stderr; the status then is `STOPPED`.
        no_reader: Status where the reader of the output has ended, such as `head`.
    """
    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        status = run()
        if sys.stdout is not None:  # None if stdout is closed
            sys.stdout.flush()
        return status
    except KeyboardInterrupt:
        print(f"{name}: {stopped}", file=sys.stderr)
        return STOPPED
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return no_reader
    finally:
        signal.signal(signal.SIGTERM, before)


def end_with_parent(parent: int) -> None:
    """Have this child process terminated when its parent process dies, for whatever reason.

    This works on Linux; elsewhere it does nothing. The child must be started by a thread that lives
    as long as the parent process.

    Args:
        parent: Process ID of the parent, from before the fork. Where the parent has died since, no
            signal would come any more, and the child is terminated at once.
    """
    # A handler that the parent has set would only note the signal, and be gone after `exec`.
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PARENT_DIES, signal.SIGTERM)
        if os.getppid() != parent:
            os.kill(os.getpid(), signal.SIGTERM)


def end_within(seconds: int, status: int) -> None:
    """End this process after a time, even if no Python code can run any more.

    Then nothing is cleaned up, so use it where only the shutdown remains. A timer of the C library
    calls `_exit`, which needs no interpreter.

    Args:
        seconds: Time from now. In s.
        status: Exit status.
    """
    library = ctypes.CDLL(None)
    function = ctypes.cast(library._exit, ctypes.c_void_p)
    event = _Event(value=status, notify=_BY_THREAD, function=function)
    timer = ctypes.c_void_p()
    with contextlib.suppress(AttributeError):  # a system without such timers
        if library.timer_create(time.CLOCK_MONOTONIC, ctypes.byref(event), ctypes.byref(timer)):
            return
        library.timer_settime(timer, 0, ctypes.byref(_Timer(value_s=seconds)), None)
