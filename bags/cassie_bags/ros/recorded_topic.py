"""Recorded topics: their types, and subscriptions that miss nothing."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any, NamedTuple

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from tf2_msgs.msg import TFMessage

from cassie_bags.bag.recording import TYPES, message_check
from cassie_bags.bag.rosbag2 import QOS_DEFAULT, QOS_LANE, Qos
from cassie_bags.errors import BagError
from cassie_msgs.ros.fast_lane import RawSubscription
from cassie_msgs.sample import LayoutError
from cassie_msgs.standard_messages import read_transforms

DEPTH = 10000
"""Length of each topic's queue: seconds of the control lane."""

_TYPE = re.compile(r"(?P<package>[a-z]\w*)/msg/(?P<name>[A-Z]\w*)")
_LARGEST = 20_000  # bytes of a message that is decoded for a check
_GID_SIZE = 16


class Offer(NamedTuple):
    """QoS that a writer offers, as far as it decides who receives its messages."""

    reliable: bool = True
    latched: bool = False

    @property
    def profile(self) -> QoSProfile:
        """QoS of a subscription that receives all messages of a writer with this offer."""
        profile = QoSProfile(depth=DEPTH)  # reliable, not latched
        if not self.reliable:
            profile.reliability = ReliabilityPolicy.BEST_EFFORT
        if self.latched:
            profile.durability = DurabilityPolicy.TRANSIENT_LOCAL
        return profile


@dataclass(slots=True)
class Received:
    """A message, and what DDS tells about it.

    Attributes:
        raw: The message.
        received, sent: Wall time of receipt, never before that of the writer's message before, and
            of publication. In ns.
        writer: Identity of its writer.
        number: Sequence number by its writer; None if there is none.
        lost: Number of messages of the topic that were lost until this one.
    """

    raw: bytes
    received: int
    sent: int
    writer: bytes
    number: int | None
    lost: int = 0


class RecordedTopic:
    """One topic that is recorded into a bag, as bytes.

    It has a subscription for each QoS that writers offer. So a writer with a weaker offer than the
    first is heard, too. A message that comes to several subscriptions is taken once.

    Attributes:
        topic: Its name.
        stored: QoS that the bag tells of the topic.
        channel: Channel of the topic in the bag.
        lost: Number of messages that were sent but did not arrive.
        unreadable: Number of messages of another type than the topic's, which are left out.
    """

    def __init__(self, node: Node, type_name: str, topic: str) -> None:
        """Subscribe.

        Raises:
            BagError: if the message type is not installed.
        """
        self._node = node
        self._type = message_class(type_name)
        self.topic = topic
        self.channel = self.lost = self.unreadable = 0
        self._offers: dict[bytes, Offer] = {}
        self._subscriptions: dict[Offer, RawSubscription] = {}
        self._numbers: dict[bytes, _Numbers] = {}
        self._newest: dict[bytes, int] = {}  # time of receipt by writer, in ns
        self._is_message = message_check(topic) or self._is_readable
        self.stored = QOS_LANE
        if topic in TYPES:  # the lane's writers are reliable: subscribe before they appear
            self._subscribe(Offer())
        self.look()
        if topic not in TYPES:
            self.stored = _stored(list(self._offers.values()))

    @property
    def subscriptions(self) -> list[RawSubscription]:
        """Subscriptions of the topic, one for each offer."""
        return list(self._subscriptions.values())

    @property
    def has_new_writers(self) -> bool:
        """Whether the number of writers has changed since the last `look`."""
        return bool(self._node.count_publishers(self.topic) != len(self._offers))

    def look(self) -> bool:
        """Look for writers in the graph; whether this led to a subscription."""
        self._offers = {
            bytes(info.endpoint_gid[:_GID_SIZE]): Offer(
                info.qos_profile.reliability == ReliabilityPolicy.RELIABLE,
                info.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL,
            )
            for info in self._node.get_publishers_info_by_topic(self.topic)
        }
        new = set(self._offers.values()) - self._subscriptions.keys()
        for offer in sorted(new):
            self._subscribe(offer)
        return bool(new)

    def take(self) -> list[Received]:
        """All messages of the topic's type that have come, oldest first."""
        found: list[Received] = []
        for subscription in self._subscriptions.values():
            inbox = subscription.inbox
            while (raw := subscription.take_raw()) is not None:
                sent, received = inbox.times
                writer = inbox.writer
                # What had to be sent twice comes after the next ones, and DDS hands it out before.
                received = self._newest[writer] = max(received, self._newest.get(writer, 0))
                taken = Received(raw, received, sent or received, writer, inbox.number)
                if not self._is_new(taken):
                    continue
                if self._is_message(raw):
                    found.append(taken)
                else:
                    self.unreadable += 1
        return found

    def close(self) -> None:
        """Destroy the subscriptions."""
        for each in self.subscriptions:
            self._node.destroy_subscription(each.subscription)

    def _subscribe(self, offer: Offer) -> None:
        self._subscriptions[offer] = RawSubscription(
            self._node, self._type, self.topic, offer.profile
        )

    def _is_readable(self, raw: bytes) -> bool:
        """Whether bytes are a message of the type, as any node may publish; large ones pass."""
        if self._type is TFMessage:  # a faster check, for frequent messages with many parts
            try:
                read_transforms(raw)
            except LayoutError:
                return False
            return True
        any_of_them = next(iter(self._subscriptions.values()))
        return len(raw) > _LARGEST or any_of_them.read(raw) is not None

    def _is_new(self, taken: Received) -> bool:
        """Whether a message was not taken before; counts those of its writer that are missing."""
        if taken.number is not None:
            numbers = self._numbers.get(taken.writer)
            if numbers is None:
                numbers = self._numbers[taken.writer] = _Numbers(taken.number)
            elif taken.number == numbers.last + 1:
                numbers.last += 1
            else:
                before = numbers.lost
                if not numbers.add(taken.number):
                    return False
                self.lost += numbers.lost - before
        taken.lost = self.lost
        return True


class _Numbers:
    """Sequence numbers of a writer's messages that have come.

    Attributes:
        first, last: First and last number.
        missing: Numbers between them that have not come and may still come: of each gap the last
            ones, as many as a queue holds.
        lost: Number of messages between them that have not come.
    """

    def __init__(self, number: int) -> None:
        self.first = self.last = number
        self.missing: set[int] = set()
        self.lost = 0

    def add(self, number: int) -> bool:
        """Note that a message has come; False if it had come before."""
        if number > self.last:
            self._miss(range(self.last + 1, number))
            self.last = number
        elif number < self.first:
            self._miss(range(number + 1, self.first))
            self.first = number
        elif number in self.missing:
            self.missing.remove(number)
            self.lost -= 1
        else:
            return False
        return True

    def _miss(self, gap: range) -> None:
        self.lost += gap.stop - gap.start
        self.missing.update(gap[-DEPTH:])


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


def _stored(offers: Sequence[Offer]) -> Qos:
    """QoS that a bag tells of a topic: what all its writers offer."""
    reliable = all(offer.reliable for offer in offers)
    latched = bool(offers) and all(offer.latched for offer in offers)
    return Qos(
        "reliable" if reliable else "best_effort",
        "transient_local" if latched else "volatile",
        depth=QOS_DEFAULT.depth,
    )
