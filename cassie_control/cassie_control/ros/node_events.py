"""Further inputs of a node, such as parameters, on /cassie/node_events: see NodeEvent.msg."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from cassie_msgs.layout import Sample
from cassie_msgs.msg import NodeEvent
from cassie_msgs.tunables import as_mapping

TOPIC = "/cassie/node_events"

_QOS = QoSProfile(
    depth=1000,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)


class NodeEvents:
    """Publishes the events of one node.

    Args:
        node: The node.
        configs: Parameters of the node, as dataclasses of tunables.
        files: Files that the node read, by the parameter that names them.
    """

    def __init__(
        self, node: Node, configs: tuple[Any, ...], files: Mapping[str, str | Path] | None = None
    ) -> None:
        self._node = node.get_name()
        self._publisher = node.create_publisher(NodeEvent, TOPIC, _QOS)
        self._parameters: dict[str, Any] = {}
        for config in configs:
            self._parameters |= as_mapping(config)
        self._files = {name: _described(Path(path)) for name, path in (files or {}).items()}

    def began(self, sample: Sample) -> None:
        """Publish that the node starts anew at the tick of a sample."""
        self.publish(sample, "began", {"parameters": self._parameters, "files": self._files})

    def changed(self, sample: Sample, config: Any) -> None:
        """Publish that another configuration is valid from the tick of a sample on."""
        changes = {
            name: value
            for name, value in as_mapping(config).items()
            if self._parameters.get(name) != value
        }
        self._parameters |= changes
        self.publish(sample, "parameters", changes)

    def publish(self, sample: Sample, event: str, content: Any) -> None:
        """Publish an event that is valid from the tick of a sample on.

        Args:
            sample: The sample.
            event: Kind of event, see NodeEvent.msg.
            content: Content, which is published as JSON.
        """
        sec, nanosec = divmod(sample.stamp_ns, 1_000_000_000)
        message = NodeEvent(
            stamp=Time(sec=sec, nanosec=nanosec),
            episode=int(sample.episode),
            seq=int(sample.seq),
            node=self._node,
            event=event,
            content=json.dumps(content),
        )
        self._publisher.publish(message)


def _described(path: Path) -> dict[str, str]:
    """Path and hash of a file; without the hash if there is no such file."""
    found = {"path": str(path)}
    if path.is_file():
        found["sha256"] = hashlib.sha256(path.read_bytes()).hexdigest()
    return found
