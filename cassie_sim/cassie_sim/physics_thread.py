"""Physics in a thread of its own, while another one computes the command.

Handing work from thread to thread through Python takes as long as the physics of a tick. So the
thread waits in compiled code, without the interpreter, for a word in memory to change; only when
nothing has come for some milliseconds does it go to sleep. It wants a processor of its own: where
others take that, whoever waits for it is told.
"""

from __future__ import annotations

import threading
import time
import weakref
from typing import Any

import numpy as np

from cassie_gaits.compiled import compiled
from cassie_sim.native import call, libc_address, load, store
from cassie_sim.physics import physics_steps

_STEPS, _AWAKE, _ENDS = 0, 8, 16  # bytes from the first word to those that threads share:
# physics steps asked for, whether the thread looks at that, whether it is to end
_LOOKS = 20_000  # at the word until it gives way to others: some hundredths of a millisecond
_TURNS = 200  # that it gives way until it goes to sleep
_STALLED = 0.001  # s of waiting, ten times as long as the physics takes


def _serve(words: int, give_way: int, arguments: Any) -> None:
    """Make physics steps as they are asked for, until none are for a while.

    Args:
        words: Address of the shared words.
        give_way: Address of `sched_yield`.
        arguments: Of `physics_steps`, before and after the number of steps.
    """
    (step, model, data), arrays = arguments
    looks = 0
    while looks < _LOOKS * _TURNS and load(words + _ENDS) == 0:
        steps = load(words + _STEPS)
        if steps > 0:
            physics_steps(step, model, data, steps, *arrays)
            store(words + _STEPS, 0)
            looks = 0
        looks += 1
        if looks % _LOOKS == 0:
            call(give_way, 0, 0)


def _wait(words: int, give_way: int) -> None:
    """Return when the steps that were asked for are made."""
    looks = 0
    while load(words + _STEPS) > 0:
        looks += 1
        if looks % _LOOKS == 0:
            call(give_way, 0, 0)


@compiled
def exchange(words: int, set_word: int, value: int, asked_word: int) -> int:
    """Set a shared word, then tell another one: of two threads that do so one sees the other's."""
    store(words + set_word, value)
    asked: int = load(words + asked_word)
    return asked


serve, wait = compiled(_serve, nogil=True), compiled(_wait, nogil=True)


class PhysicsThread:
    """Makes physics steps beside the thread that asks for them.

    Args:
        native, arrays: Arguments of `physics_steps` before and after the number of steps.
    """

    def __init__(self, native: tuple[int, ...], arrays: tuple[Any, ...]) -> None:
        words, called = np.zeros(3, np.int64), threading.Event()
        self._words, self._called = words, called
        self._address, self._give_way = int(words.ctypes.data), libc_address("sched_yield")
        arguments = (words, self._give_way, called, (native, arrays))
        thread = threading.Thread(target=_work, args=arguments, name="physics", daemon=True)
        thread.start()
        self.end = weakref.finalize(self, _end, words, called, thread)

    def begin(self, steps: int) -> None:
        """Ask for physics steps; `finish` before anything else."""
        if not exchange(self._address, _STEPS, steps, _AWAKE):
            self._called.set()

    def finish(self) -> bool:
        """Wait until they are made; says whether the thread had no processor meanwhile."""
        started = time.perf_counter()
        wait(self._address, self._give_way)
        return time.perf_counter() - started > _STALLED


def _work(words: Any, give_way: int, called: threading.Event, arguments: Any) -> None:
    address = int(words.ctypes.data)
    while True:
        called.wait()
        called.clear()
        exchange(address, _AWAKE, 1, _STEPS)
        serve(address, give_way, arguments)
        if words[2]:
            return
        if exchange(address, _AWAKE, 0, _STEPS):  # asked for meanwhile
            called.set()


def _end(words: Any, called: threading.Event, thread: threading.Thread) -> None:
    words[2] = 1
    called.set()
    thread.join()
