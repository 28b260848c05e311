"""Who takes part in a row of fail-safes beside the robot: nodes by name, and operators."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from cassie_msgs.layout import OperatorCommand, RobotMode, RobotState
from cassie_msgs.operators import write_sender
from cassie_teleop.script import ScriptedOperator

ESTIMATOR, CONTROLLER, SUPERVISOR = "state_estimator", "gait_controller", "mode_supervisor"


class UnsafeError(Exception):
    """The robot did not do what the table promises; the message says what and when."""


@dataclass
class SimulatedOperator:
    """An operator: a script's commands, as a person sends them.

    Attributes:
        name: Who speaks.
        script: What is asked for by time; None asks for stand without a speed.
        changes: Fields that are said in place of the script's.
        silent: Whether nothing is sent.
        garble: Changes a command on its way, or None.
    """

    name: str
    script: ScriptedOperator | None = None
    changes: dict[str, Any] = field(default_factory=dict)
    silent: bool = False
    garble: Callable[[OperatorCommand], None] | None = None

    @property
    def writer(self) -> bytes:
        """Identity, as DDS would give it."""
        return self.name.encode().ljust(16, b"\0")

    def say(self, state: RobotState) -> OperatorCommand:
        """The command that is sent after a state."""
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
