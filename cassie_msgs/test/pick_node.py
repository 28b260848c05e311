"""A node with parameters, for the tests of starting, changing and stopping."""

import ctypes
import sys
from dataclasses import dataclass

import rclpy
from rclpy.node import Node

from cassie_msgs.ros import diagnostics, parameters, process
from cassie_msgs.ros.scheduling import Place, Scheduling
from cassie_msgs.tunables import ParameterError, tunable


@dataclass(frozen=True, kw_only=True)
class Config:
    control_rate: int = tunable(500, "Hz", 50, 2000, "control rate", live=False)
    kp_knee: float = tunable(200.0, "Nm/rad", 0, 2000, "stiffness of the knee")
    trims: tuple[float, float] = tunable((0.0, 0.0), "rad", -0.1, 0.1, "trims")
    grade: str = tunable("faithful", choices=("ideal", "faithful"), description="sensors")


class Picked(Node):
    """Declares, follows and reports; breaks on request."""

    def __init__(self, stop: process.Stop) -> None:
        super().__init__("picked")
        self.config = parameters.declare(self, Config())
        if 2000 % self.config.control_rate:
            raise ParameterError(f"control_rate = {self.config.control_rate} Hz: must divide 2000")
        parameters.on_change(self, lambda: self.config, self.put)
        self.diagnostics = diagnostics.Diagnostics(self)
        self.diagnostics.set("loop", diagnostics.OK, "running", rate=self.config.control_rate)
        if "--break" in sys.argv:
            self.create_timer(0.01, self.fail)
        self.scheduling = Scheduling(self.get_logger().warning, Place.BESIDE)
        for word in sys.argv:
            if word in ("--lockstep", "--realtime"):
                self.scheduling.follow(word == "--realtime")
        print("ready", self.config.kp_knee, flush=True)

    def put(self, config: Config) -> None:
        """Take a changed configuration over."""
        self.config = config
        self.diagnostics.set("loop", diagnostics.WARN, f"kp_knee {config.kp_knee:g}")

    def fail(self) -> None:
        """Fail as a callback with a bug would."""
        raise RuntimeError("broken on request")

    def close(self) -> None:
        """Say that the node could still act."""
        print("closed", flush=True)

    def destroy_node(self) -> None:
        """Take leave of the middleware, which hangs if asked to."""
        if "--stuck" in sys.argv:
            hold_up()
        super().destroy_node()


def hold_up() -> None:
    """Keep the interpreter for a minute, as a middleware that hangs does."""
    ctypes.PyDLL(None).sleep(60)


if __name__ == "__main__":
    if "--stuck" in sys.argv:
        rclpy.try_shutdown = hold_up
    process.run("picked", Picked)
