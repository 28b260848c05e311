"""Topics to be recorded: their types, and how to subscribe so that nothing is missed."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from tf2_msgs.msg import TFMessage

from cassie_bags.bag.recording import message_check
from cassie_bags.bag.rosbag2 import Qos
from cassie_bags.errors import BagError
from cassie_msgs.ros.fast_lane import RawSubscription
from cassie_msgs.sample import LayoutError
from cassie_msgs.standard_messages import read_transforms

DEPTH = 10000
"""Length of the queue of each topic: seconds of the control lane."""


_LARGEST = 20_000  # bytes of a message that is read to see whether that can be done


class RecordedTopic(RawSubscription):
    """One topic that a bag keeps, as bytes.

    Attributes:
        channel: Where the bag keeps it.
        lost: Messages that were sent and did not come.
        unreadable: Messages that are none of the topic's type, which are left out.
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
        """The oldest message of its type not yet taken; None if there is none."""
        while (raw := super().take_raw()) is not None:
            self._note_lost()
            if self._is_message(raw):
                return raw
            self.unreadable += 1
        return None

    def _is_readable(self, raw: bytes) -> bool:
        """Whether some bytes are a message, which anybody may write; large ones count as one."""
        if self._type is TFMessage:  # they come often, and have many parts
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


def recorded_qos(qos: QoSProfile, depth: int) -> Qos:
    """QoS as a bag notes it for a replay.

    Args:
        qos: Under which the topic is subscribed.
        depth: Queue of a writer.
    """
    return Qos(qos.reliability.name.lower(), qos.durability.name.lower(), depth=depth)
