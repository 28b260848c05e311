"""What the simulator's loop needs of the outside."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from cassie_msgs.layout import MotorCommand, OperatorCommand, Sensors
from cassie_sim.plant import Plant

Report = Callable[[str, str | None], None]
"""Takes a condition's name and what is wrong, or None when it is over."""


class Lane(Protocol):
    """How the loop reaches the other nodes.

    Attributes:
        command: The newest motor command.
        command_key: Its (episode, seq); (-1, -1) before the first.
        on_operator: Called with each operator command that arrives, the identity of its writer, and
            what is wrong with it if it cannot be read; it is None then.
    """

    command: MotorCommand
    command_key: tuple[int, int]
    on_operator: Callable[[OperatorCommand | None, bytes, str], None]

    def announce(self, sample: Sensors, plant: Plant) -> None:
        """Publish a new sample and what goes with it."""

    def repeat(self) -> None:
        """Publish the last sample and clock again."""

    def wait(self, timeout: float) -> None:
        """Return when something arrives or the loop is wanted, `timeout` s later at the latest."""

    def missing(self) -> str:
        """What does not take part yet, in words."""
