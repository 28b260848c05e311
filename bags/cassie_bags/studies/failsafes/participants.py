"""Participants of a fail-safe besides the robot: nodes by name, and operators."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from cassie_msgs.layout import OperatorCommand, RobotMode, RobotState
from cassie_msgs.operators import write_sender
from cassie_teleop.script import ScriptedOperator

ESTIMATOR, CONTROLLER, SUPERVISOR = "state_estimator", "gait_controller", "mode_supervisor"


class UnsafeError(Exception):
    """The robot did not do what the table promises; the message says what it did, and when."""


@dataclass
class SimulatedOperator:
    """An operator who sends a script's commands in the way of a person.

    Attributes:
        name: Name of the operator.
        script: Commands by time; None commands stand without a speed.
        changes: Fields that replace those of the script.
        silent: Whether no commands are sent.
        garble: Function that corrupts a command in transit, or None.
    """

    name: str
    script: ScriptedOperator | None = None
    changes: dict[str, Any] = field(default_factory=dict)
    silent: bool = False
    garble: Callable[[OperatorCommand], None] | None = None

    @property
    def writer(self) -> bytes:
        """Identity of the writer, in the form that DDS gives."""
        return self.name.encode().ljust(16, b"\0")

    def command(self, state: RobotState) -> OperatorCommand:
        """The command that the operator sends after a state."""
        command = OperatorCommand()
        if self.script is not None:
            command.copy_from(self.script.answer(state))
        else:
            command.power[...] = command.link[...] = True
            command.mode[...], command.height[...] = RobotMode.STAND, 0.9
        command.scripted[...] = False
        for name, value in self.changes.items():
            getattr(command, name)[...] = value
        write_sender(command, self.name)
        if self.garble is not None:
            self.garble(command)
        return command
