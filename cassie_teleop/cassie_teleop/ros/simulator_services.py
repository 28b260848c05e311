"""The simulator's services, as called by buttons and keys."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from std_srvs.srv import SetBool

from cassie_msgs.srv import Gantry, Push, Reset

_LOWERED, _HUNG_UP = 0.82, 1.35  # m, heights of the pelvis
_PUT_ON = 0.785  # m, height of the pelvis when crouched on a Segway
_WINCH = 0.5  # m/s
_PUSH, _PUSH_TIME = 120.0, 0.1  # N and s
_SERVICES = {"gantry": Gantry, "reset": Reset, "push": Push, "hold_bar": SetBool}

_SERVICE_OF = {
    "lower": "gantry",
    "hang_up": "gantry",
    "let_go": "gantry",
    "reset": "reset",
    "push_left": "push",
    "push_ahead": "push",
    "hold_bar": "hold_bar",
    "let_go_bar": "hold_bar",
}
"""Service of each order."""


class SimulatorServices:
    """Clients of the services.

    Args:
        node: Node that calls the services.
        tell: Called with the answer of a service, on the executor's thread.
        done: Called with an order that was done, on the executor's thread.
    """

    def __init__(
        self,
        node: Node,
        tell: Callable[[str], None],
        done: Callable[[str], None] = lambda _: None,
    ) -> None:
        self._tell, self._done = tell, done
        self._clients = {
            name: node.create_client(kind, f"/cassie/{name}") for name, kind in _SERVICES.items()
        }

    def available(self) -> list[str]:
        """Orders whose service is available."""
        there = {name for name, client in self._clients.items() if client.service_is_ready()}
        return [order for order, service in _SERVICE_OF.items() if service in there]

    def call(self, order: str, yaw: float) -> None:
        """Call the service of an order.

        Args:
            order: One of `available`; any other order is reported.
            yaw: Heading of the robot, the direction of a push. In rad.
        """
        client = self._clients[_SERVICE_OF[order]]
        if not client.service_is_ready():
            self._tell(f"nobody offers {client.srv_name}")
            return
        lowered = _PUT_ON if self._clients["hold_bar"].service_is_ready() else _LOWERED
        future = client.call_async(_request(order, yaw, lowered))
        future.add_done_callback(functools.partial(self._answered, order))

    def _answered(self, order: str, future: Any) -> None:
        answer = future.result()
        if answer is not None:
            if answer.success:
                self._done(order)
            self._tell(answer.message)


def _request(order: str, yaw: float, lowered: float) -> Any:
    if order == "lower":
        return Gantry.Request(action="lower", height=lowered)
    if order == "hang_up":
        return Gantry.Request(action="hold", height=_HUNG_UP, speed=_WINCH)
    if order == "let_go":
        return Gantry.Request(action="release")
    if order in ("hold_bar", "let_go_bar"):
        return SetBool.Request(data=order == "hold_bar")
    if order == "reset":
        return Reset.Request()
    direction = yaw + (math.pi / 2 if order == "push_left" else 0.0)
    force = [_PUSH * math.cos(direction), _PUSH * math.sin(direction), 0.0]
    return Push.Request(force=force, duration=_PUSH_TIME)
