"""Recorded topics: their types, and subscriptions that miss nothing."""

from __future__ import annotations

import re
from importlib import import_module
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from tf2_msgs.msg import TFMessage

from cassie_bags.bag.recording import message_check
from cassie_bags.errors import BagError
from cassie_msgs.ros.fast_lane import RawSubscription
from cassie_msgs.sample import LayoutError
from cassie_msgs.standard_messages import read_transforms

DEPTH = 10000
"""Length of each topic's queue: seconds of the control lane."""


_TYPE = re.compile(r"(?P<package>[a-z]\w*)/msg/(?P<name>[A-Z]\w*)")
_LARGEST = 20_000  # bytes of a message that is decoded for a check


class RecordedTopic(RawSubscription):
    """One topic that is recorded into a bag, as bytes.

    Attributes:
        channel: Channel of the topic in the bag.
        lost: Number of messages that were sent but did not arrive.
        unreadable: Number of messages of another type than the topic's, which are left out.
    """

    def __init__(
        self, node: Node, type_name: str, topic: str, qos: QoSProfile, channel: int
    ) -> None:
        """Subscribe.

        Raises:
            BagError: if the message type is not installed.
        """
        super().__init__(node, message_class(type_name), topic, qos)
        self.channel = channel
        self.lost = self.unreadable = 0
        self._numbers: dict[bytes, int] = {}
        self._is_message = message_check(topic) or self._is_readable

    def take_raw(self) -> bytes | None:
        """The oldest message of the topic's type in the queue; None if there is none."""
        while (raw := super().take_raw()) is not None:
            self._note_lost()
            if self._is_message(raw):
                return raw
            self.unreadable += 1
        return None

    def _is_readable(self, raw: bytes) -> bool:
        """Whether bytes are a message of the type, as any node may publish; large ones pass."""
        if self._type is TFMessage:  # a faster check, for frequent messages with many parts
            try:
                read_transforms(raw)
            except LayoutError:
                return False
            return True
        return len(raw) > _LARGEST or self.read(raw) is not None

    def _note_lost(self) -> None:
        number = self.inbox.number
        if number is not None:
            writer = self.inbox.writer
            before = self._numbers.get(writer, number)
            if number > before + 1:
                self.lost += number - before - 1
            self._numbers[writer] = max(number, before)


def message_class(type_name: str) -> Any:
    """The Python class of a message type, package/msg/Name.

    Raises:
        BagError: if it is not of this form, or not installed.
    """
    parts = _TYPE.fullmatch(type_name)
    if parts is None:
        raise BagError(f"message type {type_name!r} is not of the form package/msg/Name")
    try:
        return getattr(import_module(f"{parts['package']}.msg"), parts["name"])
    except (ImportError, AttributeError):
        raise BagError(f"message type {type_name} is not installed") from None


def offered_qos(node: Node, topic: str, *, lossless: bool) -> QoSProfile | None:
    """QoS of a subscription that receives the messages of all writers of a topic.

    Args:
        node: Node that queries the graph.
        topic: Name of the topic.
        lossless: Whether its writers are known to be reliable, even before they appear.

    Returns:
        Reliable if all writers are, and latched if all writers are; None if there is no writer yet.
    """
    profile = QoSProfile(depth=DEPTH)  # reliable, not latched
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
