"""Parameters of all nodes, requested when a recording begins and when a node appears.

Later changes come on /parameter_events.
"""

from __future__ import annotations

import json
from collections import deque
from typing import Any

from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.client import Client
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.task import Future

PARAMETERS_RECORD = "cassie_parameters:"
"""Beginning of the names of metadata records with parameters; the node's name follows."""


class NodeParameters:
    """Requests parameters through a node that an executor spins, without waiting for answers."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._clients: dict[str, tuple[Client, Client]] = {}
        self._requested: set[str] = set()
        self._answers: deque[tuple[str, dict[str, Any]]] = deque()

    def request(self) -> None:
        """Send requests to nodes that were absent at the last call."""
        own = self._node.get_fully_qualified_name()
        names = {
            f"{space.rstrip('/')}/{name}"
            for name, space in self._node.get_node_names_and_namespaces()
            if not name.startswith("_")
        } - {own}
        for name in self._clients.keys() - names:
            self._end(name)
        self._requested &= names  # a node that has left is asked again when it returns
        for name in sorted(names - self._requested):
            self._request(name)

    def pop_answer(self) -> tuple[str, dict[str, Any]] | None:
        """Name and parameters of a node that has answered; None if there is none."""
        if not self._answers:
            return None
        name, parameters = self._answers.popleft()
        self._end(name)
        return name, parameters

    def close(self) -> None:
        """Stop waiting for answers."""
        for name in list(self._clients):
            self._end(name)

    def _request(self, name: str) -> None:
        if name not in self._clients:
            self._clients[name] = (
                self._node.create_client(ListParameters, f"{name}/list_parameters"),
                self._node.create_client(GetParameters, f"{name}/get_parameters"),
            )
        lists, values = self._clients[name]
        if not (lists.service_is_ready() and values.service_is_ready()):
            return
        self._requested.add(name)

        def with_names(future: Future[Any]) -> None:
            if future.exception() is None and (response := future.result()) is not None:
                names = list(response.result.names)
                values_future = values.call_async(GetParameters.Request(names=names))
                values_future.add_done_callback(lambda done: with_values(names, done))

        def with_values(names: list[str], future: Future[Any]) -> None:
            if future.exception() is None and (response := future.result()) is not None:
                answers = map(parameter_value_to_python, response.values)
                self._answers.append((name, dict(zip(names, answers, strict=False))))

        lists.call_async(ListParameters.Request()).add_done_callback(with_names)

    def _end(self, name: str) -> None:
        for client in self._clients.pop(name, ()):
            self._node.destroy_client(client)


def parameters_record(parameters: dict[str, Any]) -> dict[str, str]:
    """Content of a metadata record: each value as JSON."""
    return {name: json.dumps(value, default=list) for name, value in parameters.items()}
