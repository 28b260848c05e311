"""Scheduling of the processes of the control lane: real-time priority, or a lower priority.

Where robot time follows the wall clock, the nodes of the loop run as real-time processes if the
system permits it. Linux runs a thread with the policy SCHED_FIFO before all ordinary ones, so a
busy machine delays it no more than an idle one. Locked memory is not swapped to disk. Both need a
permission, which two lines of limits.conf give.

In lock-step, robot time waits for late nodes. There, nodes outside the chain from sample to command
have a lower priority: one state goes to several nodes, and the chain's node must not run last.

The nodes with which a person drives, and the recorder, have a lower real-time priority than both,
but run before the browser that draws the page.

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
"""Real-time priority of nodes outside the chain, which have several ticks for their answers."""

OPERATOR_PRIORITY = 20
"""Real-time priority of a person's joystick or page, and of the recorder."""

BESIDE_NICENESS = 10
"""Niceness of nodes outside the chain, in lock-step."""

LIMITS = "'cassie - rtprio 60' and 'cassie - memlock unlimited' in /etc/security/limits.conf"
"""Lines that give a user, here called cassie, the permission."""

_CURRENT, _FUTURE, _ON_FAULT = 1, 2, 4
_libc = ctypes.CDLL(None, use_errno=True)


class Place(Enum):
    """Role of a node on the control lane, with its real-time priority."""

    CHAIN = CHAIN_PRIORITY
    BESIDE = BESIDE_PRIORITY
    OPERATOR = OPERATOR_PRIORITY


class Scheduling:
    """Sets the scheduling of a process by its place on the control lane.

    A child process of an operator's console, such as a recorder, starts as an ordinary process.

    Args:
        say: Called once, with one line, if the system does not permit real-time scheduling.
        place: Place of the node.
    """

    def __init__(self, say: Callable[[str], None], place: Place = Place.CHAIN) -> None:
        self._say = say
        self._place = place
        self._wall_paced: bool | None = None
        self._told = False

    def follow(self, wall_paced: bool) -> None:
        """Set the scheduling for robot time that follows the wall clock, or waits.

        This is cheap while `wall_paced` does not change.
        """
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
    """Run all threads before ordinary processes, in locked memory; returns what prevents it.

    A node with which a person drives calls this itself, as it does not follow robot time.
    """
    heirs = os.SCHED_RESET_ON_FORK if place is Place.OPERATOR else 0
    if problem := _schedule(os.SCHED_FIFO | heirs, place.value):
        return problem
    if _libc.mlockall(_CURRENT | _FUTURE | _ON_FAULT) == 0:
        return ""
    return f"memory: {os.strerror(ctypes.get_errno())}"


def step_back() -> None:
    """Run as an ordinary process again, before the process ends."""
    if os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO:
        _schedule(os.SCHED_OTHER, 0)


def _give_way(niceness: int) -> None:
    """Let other processes run first.

    Linux shares the processors among sessions, and niceness counts within a session only. A process
    that leads its own session, as a launcher starts it, sets the session's niceness as well. As a
    batch job, the process does not preempt a process that has just sent it a message.
    """
    for thread in _threads():
        with contextlib.suppress(OSError):  # the thread has just ended
            os.setpriority(os.PRIO_PROCESS, thread, niceness)
    _schedule(os.SCHED_BATCH, 0)
    if os.getsid(0) == os.getpid():
        with contextlib.suppress(OSError):  # no such groups, or too soon after the last change
            Path("/proc/self/autogroup").write_text(str(niceness), encoding="ascii")


def _schedule(policy: int, priority: int) -> str:
    """Set the policy of all threads of this process; returns what prevents it, or empty."""
    for thread in _threads():
        try:
            os.sched_setscheduler(thread, policy, os.sched_param(priority))
        except ProcessLookupError:
            continue  # the thread has just ended
        except OSError as error:
            return error.strerror or str(error)
    return ""


def _threads() -> list[int]:
    return [int(entry.name) for entry in Path("/proc/self/task").iterdir()]
