"""Node keyboard_teleop: keys of a terminal to operator commands, with a status line."""

from __future__ import annotations

import time
from dataclasses import dataclass

from rclpy.node import Node

from cassie_msgs.msg import SupervisorStatus
from cassie_msgs.ros import parameters, process
from cassie_msgs.ros.about import About
from cassie_msgs.tunables import replace_checked, tunable
from cassie_teleop.keyboard import HELP, Keyboard, Status, status_line
from cassie_teleop.radio import without_link
from cassie_teleop.ros.sender import Sender
from cassie_teleop.terminal import Terminal

_ASKING = 1.0  # s, for which one key press asks for the lease


@dataclass(frozen=True, kw_only=True)
class Config:
    """Parameters."""

    rate: float = tunable(50.0, "Hz", 10, 200, "Rate of operator commands", live=False)


class KeyboardTeleop(Node):
    """Sends what the keys have made, at a steady rate, from the first power key on."""

    def __init__(self, stop: process.Stop) -> None:
        """Take the terminal over.

        Raises:
            OSError: if the input is no terminal.
            ValueError: if a parameter is wrong.
        """
        super().__init__("keyboard_teleop")
        config = parameters.declare(self, Config())
        self._stop = stop
        self._period = 1.0 / config.rate
        self._keyboard = Keyboard()
        self._status: SupervisorStatus | None = None
        self._heard = 0.0
        self._asked = -_ASKING
        self._sender = Sender(self)
        self.create_subscription(SupervisorStatus, "/cassie/supervisor_status", self._on_status, 10)
        self._terminal = Terminal()
        self._terminal.say(HELP)

    def loop(self) -> None:
        """Read keys and send until the user leaves or the terminal is closed."""
        try:
            self._read_and_send()
        except (EOFError, OSError) as error:
            self.get_logger().error(f"{error}: sending a stop and leaving")
            self._stop.request(exit_code=1)

    def _read_and_send(self) -> None:
        due = time.monotonic()
        while not self._stop.requested and not self._keyboard.left:
            for key in self._terminal.keys(max(0.0, due - time.monotonic())):
                if key == "?":
                    self._terminal.say(HELP)
                elif self._keyboard.press(key) and key.lower() == "o":
                    due = 0.0  # an emergency stop does not wait its turn
                if self._keyboard.asks:
                    self._asked = time.monotonic()
            if time.monotonic() >= due:
                due = time.monotonic() + self._period
                self._send()

    def close(self) -> None:
        """Put the terminal back and send exactly one stop."""
        self._terminal.close()
        if self._keyboard.wish is not None:
            self._sender.send_last(without_link(self._keyboard.wish))

    def _send(self) -> None:
        keyboard = self._keyboard
        if keyboard.wish is not None:
            keyboard.asks = time.monotonic() - self._asked < _ASKING
            self._sender.send(replace_checked(keyboard.wish, take_over=keyboard.asks))
        width = self._terminal.width - 1
        self._terminal.show(status_line(self._keyboard.wish, self._shown(), width))

    def _on_status(self, status: SupervisorStatus) -> None:
        self._heard = time.monotonic()
        if self._status is not None and status.episode != self._status.episode:
            self._keyboard.disarm()
        self._status = status

    def _shown(self) -> Status | None:
        status = self._status
        if status is None:
            return None
        age = time.monotonic() - self._heard
        return Status(status.mode, status.readiness, list(status.faults), age)


ABOUT = About(
    package="cassie_teleop",
    text="Drives the robot with the keys of a terminal; the keys are listed on the screen.",
    reads=("/cassie/supervisor_status",),
    writes=("/cassie/operator_command",),
    parameters=(Config(),),
)


def main() -> None:
    """Run the node."""
    process.run("keyboard_teleop", KeyboardTeleop, ABOUT)
