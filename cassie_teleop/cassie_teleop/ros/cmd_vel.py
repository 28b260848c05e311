"""Node cmd_vel: operator commands from Twist or TwistStamped.

Nav2, teleop_twist_keyboard or Foxglove send these messages.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_srvs.srv import SetBool, Trigger

from cassie_msgs.msg import SupervisorStatus
from cassie_msgs.ros import diagnostics, parameters, process
from cassie_msgs.ros.about import About
from cassie_msgs.ros.scheduling import Place, run_as
from cassie_msgs.tunables import tunable
from cassie_teleop.cmd_vel import VelocityCommands, VelocityError, obstacle
from cassie_teleop.requests import without_link
from cassie_teleop.ros.sender import Sender

TOPIC = "/cmd_vel"

_TYPES = {"geometry_msgs/msg/Twist": Twist, "geometry_msgs/msg/TwistStamped": TwistStamped}
_NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
_APART = 0.005  # s, least time between commands, at any rate of velocity commands
_LOOK = 0.5  # s between two checks of the topic's writers and of the robot
_SILENCE = 3.0  # s without a status of the robot, after which this is reported


@dataclass(frozen=True, kw_only=True)
class Config:
    """Parameters."""

    rate: float = tunable(50.0, "Hz", 10, 200, "Rate of operator commands", live=False)
    timeout: float = tunable(
        0.5, "s", 0.05, 5, "Time without a velocity command after which a stop is commanded"
    )
    stand_after: float = tunable(
        2.0, "s", 0, 1e6, "Time after the stop from which stand is commanded"
    )
    power: bool = tunable(
        False, description="Command power at the start; otherwise by the service", live=False
    )


class CmdVel(Node):
    """Sends the operator command for velocity commands; a new one is sent at once.

    The topic has one type, that of its first writer.
    """

    def __init__(self, stop: process.Stop) -> None:
        """Create the node.

        Raises:
            ValueError: if a parameter is wrong.
        """
        super().__init__("cmd_vel")
        self._stop = stop
        self._config = config = parameters.declare(self, Config())
        self._commands = VelocityCommands(config.timeout, config.stand_after)
        parameters.on_change(self, lambda: self._config, self._configure)
        self._sender = Sender(self)
        self._diagnostics = diagnostics.Diagnostics(self)
        self._type = ""
        self._subscription: Any = None
        self._problem = ""
        self._sent = -math.inf
        self._status: SupervisorStatus | None = None
        self._heard = time.monotonic()
        topic = "/cassie/supervisor_status"
        self.create_subscription(SupervisorStatus, topic, self._on_status, 10)
        self.create_service(SetBool, "/cmd_vel/power", self._on_power)
        self.create_service(Trigger, "/cmd_vel/take_over", self._on_take_over)
        if config.power:
            self._commands.power(True, time.monotonic())
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(_LOOK, self._look, clock=steady)
        self.create_timer(_LOOK, self._check_robot, clock=steady)
        self.create_timer(1.0 / config.rate, self._send, clock=steady)
        self._look()

    def loop(self) -> None:
        """Wait for the stop; the executor does everything."""
        run_as(Place.OPERATOR)
        self._stop.wait()

    def close(self) -> None:
        """Send exactly one stop."""
        request = self._commands.request(time.monotonic())
        if request is not None:
            self._sender.send_last(without_link(request))

    def _configure(self, config: Config) -> None:
        self._config = config
        self._commands.timeout = config.timeout
        self._commands.stand_after = config.stand_after

    def _look(self) -> None:
        """Subscribe with the type that is written, and report several writers."""
        infos = self.get_publishers_info_by_topic(TOPIC)
        types = [info.topic_type for info in infos if info.topic_type in _TYPES]
        if types and self._type not in types:
            if self._subscription is not None:
                self.destroy_subscription(self._subscription)
            self._type = types[0]
            self._subscription = self.create_subscription(
                _TYPES[self._type], TOPIC, self._on_velocity, _NEWEST
            )
        names = sorted({info.node_name for info in infos})
        problem = self._problem
        if len(infos) > 1:
            problem = f"{', '.join(names)} write {TOPIC} at once: put a twist_mux between them"
        level = diagnostics.WARN if problem else diagnostics.OK
        self._diagnostics.set(TOPIC, level, problem or "ok", type=self._type)

    def _on_status(self, status: SupervisorStatus) -> None:
        self._status, self._heard = status, time.monotonic()

    def _check_robot(self) -> None:
        """Report why the robot does not follow."""
        status, problem = self._status, ""
        if self._commands.active and time.monotonic() - self._heard > _SILENCE:
            problem = "no robot answers on /cassie/supervisor_status"
            if self._commands.powered:
                problem += "; its power comes on once it does"
        elif self._commands.active and status is not None:
            problem = obstacle(self._sender.name, status.holder, status.faults, status.armed)
        level = diagnostics.WARN if problem else diagnostics.OK
        self._diagnostics.set("robot", level, problem or "ok")

    def _on_velocity(self, message: Any) -> None:
        twist: Twist = message.twist if isinstance(message, TwistStamped) else message
        now = time.monotonic()
        try:
            self._problem = self._commands.receive(
                twist.linear.x, twist.linear.y, twist.angular.z, now
            )
        except VelocityError as error:
            self._problem = f"refused: {error}"
        if now - self._sent >= _APART:
            self._send()

    def _on_power(self, request: Any, response: Any) -> Any:
        self._commands.power(bool(request.data), time.monotonic())
        self._send()
        response.success = True
        response.message = "power is asked for" if request.data else "power is cut"
        return response

    def _on_take_over(self, _: Any, response: Any) -> Any:
        self._commands.take_over(time.monotonic())
        response.success = True
        response.message = "the lease is asked for; it is granted while the robot rests"
        return response

    def _send(self) -> None:
        now = self._sent = time.monotonic()
        request = self._commands.request(now)
        if request is not None:
            self._sender.send(request)


ABOUT = About(
    package="cassie_teleop",
    text="Walks the robot by velocity commands, as Nav2, teleop_twist_keyboard and others send "
    "them. It sends nothing until power is commanded or cut.",
    reads=(TOPIC, "/cassie/supervisor_status"),
    writes=("/cassie/operator_command", "/diagnostics"),
    services=("/cmd_vel/power", "/cmd_vel/take_over"),
    parameters=(Config(),),
)


def main() -> None:
    """Run the node."""
    process.run("cmd_vel", CmdVel, ABOUT)
