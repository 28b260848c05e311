"""Node keyboard_teleop: keys of a terminal to operator commands, with status lines."""

from __future__ import annotations

import time
from collections import deque
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from nav_msgs.msg import Odometry
from rclpy.node import Node

from cassie_msgs.layout import Mode, RobotState
from cassie_msgs.msg import SupervisorStatus
from cassie_msgs.ros import parameters, process
from cassie_msgs.ros.about import About
from cassie_msgs.ros.fast_lane import NEWEST, LaneSubscription, RawSubscription
from cassie_msgs.ros.scheduling import Place, run_as
from cassie_msgs.tunables import replace_checked, tunable
from cassie_teleop.keyboard import Keyboard, Motion, Status, help_lines, status_lines, wrapped
from cassie_teleop.page_frame import achieved
from cassie_teleop.requests import TAKE_OVER_TIME, without_link
from cassie_teleop.ros.sender import Sender
from cassie_teleop.ros.simulator_services import SimulatorServices
from cassie_teleop.terminal import Terminal

_SHOWING = 0.1  # s between two updates of the status lines
_SILENCE = 1.0  # s, age from which received values are no longer shown
_SMOOTH = 0.2  # weight of a new value in the low-pass of the achieved speeds


@dataclass(frozen=True, kw_only=True)
class Config:
    """Parameters."""

    rate: float = tunable(50.0, "Hz", 10, 200, "Rate of operator commands", live=False)


class KeyboardTeleop(Node):
    """Sends the request of the keys, at a constant rate, from the first power key on."""

    def __init__(self, stop: process.Stop) -> None:
        """Open the terminal for keys.

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
        self._asked = -TAKE_OVER_TIME
        self._sender = Sender(self)
        self._simulator = SimulatorServices(self, self._told, self._keyboard.obeyed)
        self._answers: deque[str] = deque()
        self._states, self._modes = LaneSubscription(self, RobotState), LaneSubscription(self, Mode)
        self._state, self._mode = RobotState(), Mode()
        self._moved = self._limited = self._rolled = self._shown = -_SILENCE
        self._achieved = np.zeros(3)
        self._segway = 0.0
        self._vehicle = RawSubscription(self, Odometry, "/segway/ground_truth", NEWEST)
        self.create_subscription(SupervisorStatus, "/cassie/supervisor_status", self._on_status, 10)
        self._terminal = Terminal()
        self._help()

    def loop(self) -> None:
        """Read keys and send until the user leaves or the terminal is closed."""
        try:
            self._read_and_send()
        except (EOFError, OSError) as error:
            self.get_logger().error(f"{error}: sending a stop and leaving")
            self._stop.request(exit_code=1)

    def _read_and_send(self) -> None:
        run_as(Place.OPERATOR)
        due = time.monotonic()
        while not self._stop.requested and not self._keyboard.left:
            for key in self._terminal.keys(max(0.0, due - time.monotonic())):
                if key == "?":
                    self._help()
                elif answer := self._keyboard.press(key):
                    self._terminal.say(answer)
                elif key.lower() == "o":
                    due = 0.0  # an emergency stop is sent at once
                if self._keyboard.asks:
                    self._asked = time.monotonic()
            if time.monotonic() >= due:
                due = time.monotonic() + self._period
                self._send()
            self._order()
            if time.monotonic() >= self._shown + _SHOWING:
                self._show()

    def close(self) -> None:
        """Restore the terminal and send exactly one stop."""
        self._terminal.close()
        if self._keyboard.request is not None:
            self._sender.send_last(without_link(self._keyboard.request))

    def _help(self) -> None:
        self._terminal.say("\n".join(help_lines(self._width)))

    def _send(self) -> None:
        keyboard = self._keyboard
        if keyboard.request is not None:
            keyboard.asks = time.monotonic() - self._asked < TAKE_OVER_TIME
            self._sender.send(replace_checked(keyboard.request, take_over=keyboard.asks))

    def _order(self) -> None:
        """Call services, and show their answers."""
        while self._keyboard.orders:
            self._simulator.call(self._keyboard.orders.pop(0), float(self._state.q[3]))
        while self._answers:
            self._terminal.say("\n".join(wrapped(self._answers.popleft(), self._width)))

    def _show(self) -> None:
        self._shown = time.monotonic()
        status, motion = self._status_now(), self._motion()
        self._terminal.show(status_lines(self._keyboard.request, status, motion, self._width))

    @property
    def _width(self) -> int:
        """Number of characters in a line."""
        return min(80, self._terminal.size.columns - 1)

    def _motion(self) -> Motion:
        now = time.monotonic()
        with suppress(ValueError):
            if self._states.take(self._state):
                self._moved = now
                self._achieved += _SMOOTH * (achieved(self._state) - self._achieved)
            if self._modes.take(self._mode):
                self._limited = now
        if (odometry := self._vehicle.take_message()) is not None:
            self._segway = odometry.twist.twist.linear.x
            self._rolled = now
        mode, height = self._mode, float(self._state.q[2])
        limits = [float(value) for value in (mode.vx, mode.vy, mode.yaw_rate, mode.height)]
        return Motion(
            limited=limits if now - self._limited < _SILENCE else (),
            achieved=[*self._achieved.tolist(), height] if now - self._moved < _SILENCE else (),
            segway=self._segway if now - self._rolled < _SILENCE else None,
        )

    def _told(self, text: str) -> None:
        """Keep the answer of a service; called by the executor's thread."""
        self._answers.append(text)

    def _on_status(self, status: SupervisorStatus) -> None:
        self._heard = time.monotonic()
        if self._status is not None and status.episode != self._status.episode:
            self._keyboard.disarm()
        self._status, self._keyboard.mode = status, status.mode

    def _status_now(self) -> Status | None:
        status = self._status
        if status is None:
            return None
        age = time.monotonic() - self._heard
        other = status.holder if status.holder != self._sender.name else ""
        faults = list(status.faults)
        return Status(status.mode, status.readiness, faults, age, other, status.armed)


ABOUT = About(
    package="cassie_teleop",
    text="Drives the robot with the keys of a terminal; the keys are listed on the screen.",
    reads=(
        "/cassie/supervisor_status",
        "/cassie/state",
        "/cassie/mode",
        "/segway/ground_truth",
    ),
    writes=("/cassie/operator_command",),
    parameters=(Config(),),
)


def main() -> None:
    """Run the node."""
    process.run("keyboard_teleop", KeyboardTeleop, ABOUT)
