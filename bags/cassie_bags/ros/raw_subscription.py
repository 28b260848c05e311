"""Subscriptions to any topic as bytes, outside rclpy's executor."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from cassie_bags.errors import BagError
from cassie_msgs.ros.fast_lane import _NotForExecutors as NotForExecutors

DEPTH = 10000
"""Length of the queue of each topic: seconds of the control lane."""

_NUMBERS = {
    ReliabilityPolicy.RELIABLE: 1,
    ReliabilityPolicy.BEST_EFFORT: 2,
    DurabilityPolicy.TRANSIENT_LOCAL: 1,
    DurabilityPolicy.VOLATILE: 2,
}


class RawSubscription:
    """One topic, taken message by message as bytes.

    Attributes:
        topic: Its name.
        channel: Where the bag keeps it.
        handle: For a wait set.
    """

    def __init__(
        self, node: Node, type_name: str, topic: str, qos: QoSProfile, channel: int
    ) -> None:
        """Subscribe.

        Raises:
            BagError: if the message type is not installed.
        """
        self.topic = topic
        self.channel = channel
        self._type = message_class(type_name)
        self._subscription = node.create_subscription(
            self._type, topic, _ignore, qos, callback_group=NotForExecutors(), raw=True
        )
        self.handle = self._subscription.handle
        self._take = self.handle.take_message

    def take(self) -> bytes | None:
        """The oldest message not yet taken; None if there is none."""
        taken = self._take(self._type, True)
        return None if taken is None else taken[0]


def message_class(type_name: str) -> Any:
    """The Python class of a message type, package/msg/Name.

    Raises:
        BagError: if it is not installed.
    """
    package, _, name = type_name.split("/")
    try:
        return getattr(import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError):
        raise BagError(f"message type {type_name} is not installed") from None


def offered_qos(node: Node, topic: str, *, lossless: bool) -> QoSProfile | None:
    """How to subscribe so that every writer of a topic is heard.

    Args:
        node: Node to look from.
        topic: Topic.
        lossless: Whether its writers are known to be reliable, also before they appear.

    Returns:
        Reliable and latched as far as all its writers are; None if there is none yet.
    """
    profile = QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=DEPTH,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.VOLATILE,
    )
    if lossless:
        return profile
    offers = [info.qos_profile for info in node.get_publishers_info_by_topic(topic)]
    if not offers:
        return None
    if any(offer.reliability != ReliabilityPolicy.RELIABLE for offer in offers):
        profile.reliability = ReliabilityPolicy.BEST_EFFORT
    if all(offer.durability == DurabilityPolicy.TRANSIENT_LOCAL for offer in offers):
        profile.durability = DurabilityPolicy.TRANSIENT_LOCAL
    return profile


def qos_numbers(qos: QoSProfile, depth: int) -> tuple[int, int, int, int]:
    """History, depth, reliability and durability as a bag notes them for a replay."""
    return (1, depth, _NUMBERS[qos.reliability], _NUMBERS[qos.durability])


def _ignore(_: object) -> None:
    """Callback of a subscription that no executor serves."""
