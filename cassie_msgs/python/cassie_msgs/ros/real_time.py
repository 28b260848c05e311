"""Real-time scheduling of a process, where the system permits it.

Linux runs a thread with the policy SCHED_FIFO before all ordinary ones, so that a busy machine
delays it no more than an idle one does. Locked memory is not written out to disk. Both take a
permission, which one line in limits.conf gives.

Source:
    Linux, sched(7) and mlock(2).
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable
from pathlib import Path

CHAIN_PRIORITY = 50
"""Of the nodes between a sample and its command: simulator, estimator, controller."""

BESIDE_PRIORITY = 30
"""Of the supervisor, which has several ticks for its answers."""

LIMITS = "cassie - rtprio 60 and cassie - memlock unlimited in /etc/security/limits.d/cassie.conf"
"""What gives a user, here called cassie, the permission."""

_CURRENT, _FUTURE, _ON_FAULT = 1, 2, 4
_libc = ctypes.CDLL(None, use_errno=True)


class RealTime:
    """Switches a process between ordinary and real-time scheduling.

    Args:
        priority: Of all its threads while it is real-time, 1..99.
        say: Gets one line, once, where the system does not permit it.
    """

    def __init__(self, priority: int, say: Callable[[str], None]) -> None:
        self._priority = priority
        self._say = say
        self._wanted = False
        self._told = False

    def follow(self, wanted: bool) -> None:
        """Be real-time or not; cheap while that stays as it is."""
        if wanted == self._wanted:
            return
        self._wanted = wanted
        policy, priority = (os.SCHED_FIFO, self._priority) if wanted else (os.SCHED_OTHER, 0)
        problem = schedule(policy, priority)
        if wanted:
            problem = problem or lock_memory()
        if problem and wanted and not self._told:
            self._told = True
            self._say(
                f"no real-time scheduling ({problem}): on a busy machine control ticks will be "
                f"missed; to permit it, put {LIMITS} and log in again"
            )


def schedule(policy: int, priority: int) -> str:
    """Give all threads of this process a policy; says what prevents it, empty if nothing does."""
    try:
        for thread in Path("/proc/self/task").iterdir():
            os.sched_setscheduler(int(thread.name), policy, os.sched_param(priority))
    except ProcessLookupError:
        return ""  # a thread that has just ended
    except OSError as error:
        return error.strerror or str(error)
    return ""


def lock_memory() -> str:
    """Keep in memory what this process touches; says what prevents it."""
    if _libc.mlockall(_CURRENT | _FUTURE | _ON_FAULT) == 0:
        return ""
    return os.strerror(ctypes.get_errno())
