"""When a process of the control lane runs: before all others, or after the chain it stands beside.

Where robot time follows the wall clock, the nodes of the loop run as real-time processes if the
system permits it: Linux runs a thread with the policy SCHED_FIFO before all ordinary ones, so that
a busy machine delays it no more than an idle one does, and locked memory is not written out to
disk. Both take a permission, which two lines of limits.conf give.

In lock-step, robot time waits for whoever is late. There, nodes beside the chain from sample to
command give way: one state goes to several nodes, and the one in the chain must not get it last.

What a person drives with stands behind both, but before the browser that draws the page.

Source:
    Linux, sched(7) and mlock(2).
"""

from __future__ import annotations

import contextlib
import ctypes
import os
from collections.abc import Callable
from enum import Enum
from pathlib import Path

CHAIN_PRIORITY = 50
"""Real-time priority of the nodes from a sample to its command."""

BESIDE_PRIORITY = 30
"""That of nodes beside the chain, which have several ticks for their answers."""

OPERATOR_PRIORITY = 20
"""That of a person's stick or page, for which a person waits."""

BESIDE_NICENESS = 10
"""Niceness of nodes beside the chain, in lock-step."""

LIMITS = "'cassie - rtprio 60' and 'cassie - memlock unlimited' in /etc/security/limits.conf"
"""What gives a user, here called cassie, the permission."""

_CURRENT, _FUTURE, _ON_FAULT = 1, 2, 4
_libc = ctypes.CDLL(None, use_errno=True)


class Place(Enum):
    """Where a node stands on the control lane."""

    CHAIN = CHAIN_PRIORITY
    BESIDE = BESIDE_PRIORITY
    OPERATOR = OPERATOR_PRIORITY


class Scheduling:
    """Has a process run as its place on the control lane wants it.

    What an operator's console starts, such as a recorder, runs as an ordinary process.

    Args:
        say: Gets one line, once, where the system does not permit real-time scheduling.
        place: Of the node.
    """

    def __init__(self, say: Callable[[str], None], place: Place = Place.CHAIN) -> None:
        self._say = say
        self._place = place
        self._wall_paced: bool | None = None
        self._told = False

    def follow(self, wall_paced: bool) -> None:
        """Robot time follows the wall clock, or waits; cheap while that stays as it is."""
        if wall_paced is self._wall_paced:
            return
        before, self._wall_paced = self._wall_paced, wall_paced
        if wall_paced:
            problem = run_as(self._place)
            if problem and not self._told:
                self._told = True
                self._say(
                    f"no real-time scheduling ({problem}): on a busy machine control ticks will be "
                    f"missed; to permit it, put {LIMITS} and log in again"
                )
            return
        if before:
            _schedule(os.SCHED_OTHER, 0)
        if self._place is Place.BESIDE:
            _give_way(BESIDE_NICENESS)


def run_as(place: Place) -> str:
    """Run all threads before ordinary processes, in locked memory; says what prevents it.

    For a node that a person drives with, which does not follow robot time.
    """
    heirs = os.SCHED_RESET_ON_FORK if place is Place.OPERATOR else 0
    if problem := _schedule(os.SCHED_FIFO | heirs, place.value):
        return problem
    if _libc.mlockall(_CURRENT | _FUTURE | _ON_FAULT) == 0:
        return ""
    return f"memory: {os.strerror(ctypes.get_errno())}"


def step_back() -> None:
    """Run as an ordinary process again, for one that takes leave."""
    if os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO:
        _schedule(os.SCHED_OTHER, 0)


def _give_way(niceness: int) -> None:
    """Have other processes come first.

    Linux shares the processors among sessions, and niceness counts inside of each only. A process
    that leads its own session, as a launcher starts it, sets that of the session as well. As a
    batch job it takes no processor from whoever has just sent it something.
    """
    for thread in _threads():
        with contextlib.suppress(OSError):  # it has just ended
            os.setpriority(os.PRIO_PROCESS, thread, niceness)
    _schedule(os.SCHED_BATCH, 0)
    if os.getsid(0) == os.getpid():
        with contextlib.suppress(OSError):  # no such groups, or changed a moment ago
            Path("/proc/self/autogroup").write_text(str(niceness), encoding="ascii")


def _schedule(policy: int, priority: int) -> str:
    """Give all threads of this process a policy; says what prevents it, empty if nothing does."""
    for thread in _threads():
        try:
            os.sched_setscheduler(thread, policy, os.sched_param(priority))
        except ProcessLookupError:
            continue  # it has just ended
        except OSError as error:
            return error.strerror or str(error)
    return ""


def _threads() -> list[int]:
    return [int(entry.name) for entry in Path("/proc/self/task").iterdir()]
