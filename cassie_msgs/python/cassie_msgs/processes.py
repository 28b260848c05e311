"""How local processes end: with the process that started them, and within a time-out."""

from __future__ import annotations

import contextlib
import ctypes
import signal
import time

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


def end_with_parent() -> None:
    """Have this child process terminated when its parent process dies, for whatever reason.

    This works on Linux; elsewhere it does nothing. The child must be started by a thread that lives
    as long as the parent process.
    """
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PARENT_DIES, signal.SIGTERM)


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
