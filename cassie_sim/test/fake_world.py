"""A plant, a lane and a clock that are none, for the loop's rules."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager, nullcontext
from types import SimpleNamespace
from typing import Any

from cassie_msgs.layout import MotorCommand, OperatorCommand, Sensors


class FakePlant:
    """Notes what it is told."""

    def __init__(self, episode: int = 7) -> None:
        self.episode, self.seq, self.tick_ns = episode, 0, 2_000_000
        self.applied: list[int | None] = []
        self.powered: list[bool] = []
        self.damped: list[int] = []
        self.refuse = False
        self.ahead = -1
        self.started_ahead: list[bool] = []
        self._power = False
        self.drives = SimpleNamespace(damp=lambda: self.damped.append(self.seq))
        self._sample = Sensors()

    def sense(self) -> Sensors:
        self._sample.seq[...] = self.seq
        self._sample.episode[...] = self.episode
        return self._sample

    def power(self, on: bool) -> None:
        self._power = on

    def run_ahead(self) -> None:
        self.ahead = self.seq

    def take_back(self) -> None:
        self.ahead = -1

    def step(self, command: MotorCommand | None) -> None:
        self.powered.append(self._power)
        self.started_ahead.append(self.ahead == self.seq)
        self.applied.append(None if command is None else int(command.seq))
        self.seq += 1
        if self.refuse and command is not None:
            raise ValueError("refused")


class FakeWorld:
    """Lane and clock: the other nodes answer after `delay`, as `answers` says."""

    def __init__(self, answers: Callable[[int, int], bool] = lambda episode, seq: True) -> None:
        self.now = 100.0
        self.delay = 0.0004
        self.answers = answers
        self.command = MotorCommand()
        self.command_key = (-1, -1)
        self.on_operator: Callable[[OperatorCommand, bytes, str], None] = lambda *_: None
        self.on_wait: Callable[[], None] = lambda: None
        self.announced: list[int] = []
        self.times: list[float] = []
        self.repeats: list[float] = []
        self.reports: list[tuple[str, str | None]] = []
        self._due: list[tuple[float, tuple[int, int]]] = []

    def announce(self, sample: Sensors, plant: Any) -> None:
        self.announced.append(int(sample.seq))
        self.times.append(self.now)
        self._ask(int(sample.episode), int(sample.seq))

    def repeat(self) -> None:
        self.repeats.append(self.now)
        self._ask(self._last[0], self._last[1])

    def _ask(self, episode: int, seq: int) -> None:
        self._last = (episode, seq)
        if self.answers(episode, seq):
            self._due.append((self.now + self.delay, (episode, seq)))

    def wait(self, timeout: float) -> None:
        self.on_wait()
        arrival = self._due[0][0] if self._due else float("inf")
        self.now = max(self.now, min(self.now + timeout + 1e-9, arrival))
        if self._due and arrival <= self.now:
            self.command_key = self._due.pop(0)[1]
            self.command.seq[...] = self.command_key[1]

    def take(self) -> None:
        """`wait` has taken all."""

    def served(self, answer: Callable[[], bool]) -> AbstractContextManager[None]:
        return nullcontext()

    def missing(self) -> str:
        return ""

    def report(self, condition: str, problem: str | None) -> None:
        self.reports.append((condition, problem))


class ReceivingWorld(FakeWorld):
    """A `FakeWorld` with a receiving thread, which answers commands while the loop's one waits."""

    def __init__(self, answers: Callable[[int, int], bool] = lambda episode, seq: True) -> None:
        super().__init__(answers)
        self.waits = 0
        self.on_receive: Callable[[], None] = lambda: None
        self._answer: Callable[[], bool] = lambda: False

    @contextmanager
    def served(self, answer: Callable[[], bool]) -> Iterator[None]:
        self._answer = answer
        yield
        self._answer = lambda: False

    def wait(self, timeout: float) -> None:
        self.waits += 1
        until = self.now + timeout
        while self.now < until:
            asked = self.command_key
            super().wait(until - self.now)
            if self.command_key == asked:
                continue
            self.on_receive()
            with ThreadPoolExecutor(1) as receiving:
                if not receiving.submit(self._answer).result():
                    return
