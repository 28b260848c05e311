"""Node rc_teleop: /joy of a radio or gamepad to operator commands, 50 Hz."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from rclpy.node import Node
from sensor_msgs.msg import Joy

from cassie_msgs.ros import diagnostics, parameters, process
from cassie_msgs.ros.about import About
from cassie_msgs.ros.fast_lane import NEWEST, LaneWaiter, RawSubscription
from cassie_msgs.ros.scheduling import Place, run_as
from cassie_msgs.tunables import ParameterError, tunable
from cassie_teleop.device import read_device, with_buttons
from cassie_teleop.radio import Radio
from cassie_teleop.receiver import Receiver
from cassie_teleop.requests import without_link
from cassie_teleop.ros.recorder import RecorderService
from cassie_teleop.ros.sender import Sender

_APART = 0.005  # s, least time between commands without a stop
_PAUSE = 0.002  # s between two messages, so that a flood of them costs the robot nothing


@dataclass(frozen=True, kw_only=True)
class Config:
    """Parameters."""

    device: str = tunable(
        "taranis_qx7", description="Device file: a path, or a name in config/", live=False
    )
    enable_button: int = tunable(
        -1, "", -1, 63, "Button held to move; -1: from the device file", live=False
    )
    enable_turbo_button: int = tunable(
        -1, "", -1, 63, "Button held to move fast; -1: from the device file", live=False
    )
    rate: float = tunable(50.0, "Hz", 10, 200, "Rate of operator commands", live=False)
    joy_timeout: float = tunable(0.5, "s", 0.05, 5, "Age of /joy from which the link is lost")


class RcTeleop(Node):
    """Sends the device's requests as they come, and at once if one cuts power or stops."""

    def __init__(self, stop: process.Stop) -> None:
        """Read the device file and begin to send.

        Raises:
            ValueError: if a parameter or the device file is wrong.
        """
        super().__init__("rc_teleop")
        config = parameters.declare(self, Config())
        device = with_buttons(
            read_device(device_path(config.device)),
            config.enable_button,
            config.enable_turbo_button,
        )
        self._receiver = Receiver(Radio(device), config.joy_timeout)
        self._config = config
        parameters.on_change(self, lambda: self._config, self._configure)
        self._sender = Sender(self)
        self._recorder = RecorderService(self, self.get_logger().info)
        self._records: bool | None = None
        self._record_by_axis = device.record is not None and device.record.axis >= 0
        self._diagnostics = diagnostics.Diagnostics(self)
        self._joy = RawSubscription(self, Joy, "/joy", NEWEST)
        self._waiter = LaneWaiter(self, [self._joy])
        self._stop = stop
        stop.on_request(self._waiter.wake)
        self._sent = -math.inf
        self._due = time.monotonic()  # time of the next command

    def loop(self) -> None:
        """Send commands at the rate, and between them new requests of the device."""
        run_as(Place.OPERATOR)
        while not self._stop.requested:
            self._waiter.wait(max(0.0, self._due - time.monotonic()))
            if (joy := self._joy.take_message()) is not None:
                self._on_joy(joy)
            if time.monotonic() >= self._due:
                self._send()
            self._stop.wait(_PAUSE)

    def close(self) -> None:
        """Send exactly one stop."""
        request = self._receiver.request(time.monotonic())
        if request is not None:
            self._sender.send_last(without_link(request))

    def _configure(self, config: Config) -> None:
        self._config = config
        self._receiver.timeout = config.joy_timeout

    def _on_joy(self, joy: Joy) -> None:
        now = time.monotonic()
        urgent = self._receiver.receive(joy.axes, joy.buttons, now)
        self._due = now if urgent else min(self._due, max(now, self._sent + _APART))
        self._record(self._receiver.records)

    def _record(self, wanted: bool | None) -> None:
        """Begin or end a recording when the switch is moved; as found, it asks for nothing."""
        before, self._records = self._records, wanted
        found = before is None and self._record_by_axis
        if wanted is not None and wanted != before and not found:
            self._recorder.record(wanted)

    def _send(self) -> None:
        now = self._sent = time.monotonic()
        self._due = now + 1.0 / self._config.rate
        problem = self._receiver.problem(now)
        level = diagnostics.WARN if problem else diagnostics.OK
        self._diagnostics.set("radio", level, problem or "link good", device=self._config.device)
        request = self._receiver.request(now)
        if request is not None:
            self._sender.send(request)


def device_path(name: str) -> Path:
    """Path of a device file given by path or by name.

    Raises:
        ParameterError: if there is no such file; the message lists all names.
    """
    if name.endswith((".yaml", ".yml")):
        path = Path(name).expanduser()
    else:
        path = Path(get_package_share_directory("cassie_teleop"), "config", f"{name}.yaml")
    if not path.is_file():
        folder = Path(get_package_share_directory("cassie_teleop"), "config")
        known = ", ".join(sorted(p.stem for p in folder.glob("*.yaml")))
        raise ParameterError(
            f"device = {name}: neither a .yaml file that is there, nor known by name: {known}"
        )
    return path


ABOUT = About(
    package="cassie_teleop",
    text="Drives the robot with the channels of a radio or gamepad, which come on /joy.",
    reads=("/joy",),
    writes=("/cassie/operator_command", "/diagnostics"),
    parameters=(Config(),),
)


def main() -> None:
    """Run the node."""
    process.run("rc_teleop", RcTeleop, ABOUT)
