"""Node joystick: a gamepad or radio on this computer to /joy."""

from __future__ import annotations

from dataclasses import dataclass

from rclpy.node import Node
from sensor_msgs.msg import Joy

from cassie_msgs.ros import diagnostics, parameters, process
from cassie_msgs.ros.about import About
from cassie_msgs.tunables import tunable
from cassie_teleop.joystick import Joystick, JoystickError


@dataclass(frozen=True, kw_only=True)
class Config:
    """Parameters."""

    device: str = tunable(
        "", description="Number or part of the name of the device; empty is the first", live=False
    )
    rate: float = tunable(50.0, "Hz", 10, 500, "Rate of /joy", live=False)


class JoystickNode(Node):
    """Publishes the device's state; if it is unplugged, stops that and searches for it again."""

    def __init__(self, stop: process.Stop) -> None:
        """Open the device.

        Raises:
            JoystickError: if there is no such device; the message lists all devices.
        """
        super().__init__("joystick")
        self._config = parameters.declare(self, Config())
        self._stop = stop
        self._joystick: Joystick | None = Joystick(self._config.device)
        self._publisher = self.create_publisher(Joy, "/joy", 10)
        self._diagnostics = diagnostics.Diagnostics(self)
        self.get_logger().info(f"reading {self._joystick.name}")

    def loop(self) -> None:
        """Read and publish until stopped; SDL requires one thread for this."""
        while not self._stop.wait(1.0 / self._config.rate):
            try:
                self._step()
            except JoystickError as error:
                self._diagnostics.set("device", diagnostics.ERROR, str(error))
                if self._joystick is not None:
                    self._joystick.close()
                    self._joystick = None
                self._stop.wait(0.5)

    def _step(self) -> None:
        if self._joystick is None:
            self._joystick = Joystick(self._config.device)
        reading = self._joystick.read()
        joy = Joy(axes=reading.axes, buttons=reading.buttons)
        joy.header.stamp = self.get_clock().now().to_msg()
        joy.header.frame_id = "joy"
        self._publisher.publish(joy)
        self._diagnostics.set("device", diagnostics.OK, f"reading {self._joystick.name}")


ABOUT = About(
    package="cassie_teleop",
    text="Publishes a radio or gamepad of this computer on /joy.",
    writes=("/joy", "/diagnostics"),
    parameters=(Config(),),
)


def main() -> None:
    """Run the node."""
    process.run("joystick", JoystickNode, ABOUT)
