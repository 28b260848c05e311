"""Physics in its own thread, while another one computes the command.

To pass work from thread to thread through Python takes as long as the physics of a tick. So the
thread waits in compiled code, without the interpreter, for a word in memory to change. It goes to
sleep only after some milliseconds without work. It needs a processor of its own; `finish` tells the
caller when other processes had taken it.
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

_STEPS, _AWAKE, _ENDS = 0, 8, 16  # offsets, in bytes, of the words that the threads share:
# requested physics steps, whether the thread polls that word, whether the thread is to end
_LOOKS = 20_000  # polls of the word until the thread yields: some hundredths of a millisecond
_TURNS = 200  # yields of the thread until it goes to sleep
_STALLED = 0.001  # s of waiting that mean no free processor; ten times the duration of the physics


def _serve(words: int, give_way: int, arguments: Any) -> None:
    """Compute requested physics steps, until there are none for some milliseconds.

    Args:
        words: Address of the shared words.
        give_way: Address of `sched_yield`.
        arguments: Arguments of `physics_steps`, before and after the number of steps.
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
    """Return when the requested steps are computed."""
    looks = 0
    while load(words + _STEPS) > 0:
        looks += 1
        if looks % _LOOKS == 0:
            call(give_way, 0, 0)


@compiled
def exchange(words: int, set_word: int, value: int, asked_word: int) -> int:
    """Set a shared word, then return another; at least one of two threads sees the other's."""
    store(words + set_word, value)
    asked: int = load(words + asked_word)
    return asked


serve, wait = compiled(_serve, nogil=True), compiled(_wait, nogil=True)


class PhysicsThread:
    """Computes physics steps in parallel with the thread that requests them.

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
        """Request physics steps; call `finish` before anything else."""
        if not exchange(self._address, _STEPS, steps, _AWAKE):
            self._called.set()

    def finish(self) -> bool:
        """Wait until the steps are computed; returns whether the thread had no free processor."""
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
        if exchange(address, _AWAKE, 0, _STEPS):  # steps were requested meanwhile
            called.set()


def _end(words: Any, called: threading.Event, thread: threading.Thread) -> None:
    words[2] = 1
    called.set()
    thread.join()
