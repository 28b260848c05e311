"""Interface between the simulator's loop and the other nodes."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Protocol

from cassie_msgs.layout import MotorCommand, OperatorCommand, Sensors
from cassie_sim.plant import Plant

Report = Callable[[str, str | None], None]
"""Takes a condition's name and its problem, or None when the problem is over."""


class Lane(Protocol):
    """Connection of the loop with the other nodes.

    Attributes:
        command: The newest motor command.
        command_key: (episode, seq) of the newest motor command; (-1, -1) before the first.
        on_operator: Called with each operator command that arrives, the identity of its writer, and
            its problem. If the command cannot be read, None is passed for it.
    """

    command: MotorCommand
    command_key: tuple[int, int]
    on_operator: Callable[[OperatorCommand | None, bytes, str], None]

    def announce(self, sample: Sensors, plant: Plant) -> None:
        """Publish a new sample and the messages that accompany it."""

    def repeat(self) -> None:
        """Publish the last sample and clock again."""

    def wait(self, timeout: float) -> None:
        """Return when a message arrives or the loop is woken, after `timeout` s at the latest."""

    def take(self) -> None:
        """Take in the messages that have come."""

    def served(self, answer: Callable[[], bool]) -> AbstractContextManager[None]:
        """Have `answer` called in the receiving thread when a motor command comes, if possible.

        A wait ends only if it returns False.
        """

    def missing(self) -> str:
        """Text that names the nodes which do not take part yet."""
