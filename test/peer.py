"""A stand-in for estimator and controller: answers sensor samples in the test's own process."""

from __future__ import annotations

import threading
from collections.abc import Callable

from rclpy.node import Node

from cassie_msgs.layout import MotorCommand, Sensors
from cassie_msgs.ros.fast_lane import LanePublisher, LaneSubscription, LaneWaiter

Answer = Callable[[Sensors, MotorCommand], bool]
"""Fills in the command to a sample and says whether to send it."""


def damping(sensors: Sensors, command: MotorCommand) -> bool:
    """Answer with damped drives."""
    command.kd[:] = 5.0
    return True


class Peer:
    """Answers each sample, in a thread, as `answer` says; it may be replaced at any time.

    Attributes:
        answered: Ticks that were answered, in order, with repeats.
    """

    def __init__(self, node: Node, answer: Answer = damping) -> None:
        self.answer = answer
        self.answered: list[int] = []
        self._samples = LaneSubscription(node, Sensors)
        self._commands = LanePublisher(node, MotorCommand)
        self._waiter = LaneWaiter(node, [self._samples])
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._stopped = threading.Event()

    def __enter__(self) -> Peer:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopped.set()
        self._waiter.wake()
        self._thread.join()

    def _run(self) -> None:
        sample, command = Sensors(), MotorCommand()
        while not self._stopped.is_set():
            self._waiter.wait(0.5)
            if not self._samples.take(sample):
                continue
            command.seq[...] = sample.seq
            command.episode[...] = sample.episode
            if self.answer(sample, command):
                self.answered.append(int(sample.seq))
                self._commands.publish(command)
