"""Control-lane topics as serialized bytes, without rclpy's executor.

A message object costs 40 to 50 us to take in Python and the executor adds 100 to 250 us
to each; waiting for raw bytes and taking them as `inbox` does costs 10 us. A node that uses this
module has its loop on the main thread (wait, take, compute, publish), or answers in the thread
that receives. Everything slow, such as parameters, services and timers, runs on an executor in
another thread.

Other nodes and tools see ordinary messages: it is the same topic and type.
"""

from __future__ import annotations

import os
import select
import weakref
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from importlib import import_module
from typing import Any, Generic, TypeVar

from rclpy.callback_groups import CallbackGroup
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message

from cassie_msgs.layout import Sample
from cassie_msgs.ros.inbox import Inbox
from cassie_msgs.ros.one_writer import OneWriter

SampleT = TypeVar("SampleT", bound=Sample)

# Writers are reliable and have a long queue, so that a recorder misses no message.
WRITER = QoSProfile(
    reliability=ReliabilityPolicy.RELIABLE, history=HistoryPolicy.KEEP_LAST, depth=100
)
# For displays: only the newest message is needed.
NEWEST = QoSProfile(
    reliability=ReliabilityPolicy.BEST_EFFORT, history=HistoryPolicy.KEEP_LAST, depth=1
)
# Sensors, state and motor command on the lane: the newest message of the accepted writer, which
# messages of other writers must not displace from the queue.
NEWEST_OF_ONE = QoSProfile(
    reliability=ReliabilityPolicy.BEST_EFFORT, history=HistoryPolicy.KEEP_LAST, depth=100
)
# Mode and operator command: each message becomes valid at its own tick, so none may be dropped.
EVERY = QoSProfile(
    reliability=ReliabilityPolicy.RELIABLE, history=HistoryPolicy.KEEP_LAST, depth=500
)


class _NotForExecutors(CallbackGroup):
    """Keeps lane subscriptions out of the executor that spins the rest of the node."""

    def can_execute(self, entity: Any) -> bool:
        return False

    def beginning_execution(self, entity: Any) -> bool:
        return False

    def ending_execution(self, entity: Any) -> None:
        pass


def message_type(sample_type: type[Sample]) -> Any:
    """The ROS message class of a sample type."""
    return getattr(import_module("cassie_msgs.msg"), sample_type.__name__)


class LanePublisher(Generic[SampleT]):
    """Publishes samples of one type as their serialized bytes."""

    def __init__(
        self,
        node: Node,
        sample_type: type[SampleT],
        topic: str | None = None,
        qos: QoSProfile = WRITER,
    ) -> None:
        """Create the publisher; `topic` defaults to the topic of the type."""
        self.topic = topic or sample_type.TOPIC
        self.publisher = node.create_publisher(message_type(sample_type), self.topic, qos)
        self._send = self.publisher.publish

    def publish(self, sample: SampleT) -> None:
        """Send the present content of the sample."""
        self._send(sample.to_bytes())

    def publish_raw(self, raw: bytes) -> None:
        """Send bytes kept from `to_bytes`, such as a cached reply."""
        self._send(raw)

    def flush(self, timeout_s: float) -> bool:
        """Whether all reliable readers have received everything; waits `timeout_s` at most."""
        return bool(self.publisher.wait_for_all_acked(Duration(seconds=timeout_s)))

    @property
    def matched(self) -> int:
        """Number of subscriptions that receive from this publisher."""
        return int(self.publisher.get_subscription_count())


class RawSubscription:
    """Takes messages of any type as bytes; waits with a `LaneWaiter` or not at all."""

    def __init__(
        self,
        node: Node,
        message_class: Any,
        topic: str,
        qos: QoSProfile,
        guard: OneWriter | None = None,
    ) -> None:
        """Create the subscription, which no executor serves.

        Args:
            node: Node it belongs to.
            message_class: ROS class of the messages.
            topic: Topic of the messages.
            qos: How messages are kept until they are taken.
            guard: Decides which messages are accepted; by default all are.
        """
        self._node, self._qos = node, qos
        self._guard = guard
        self._type = message_class
        self._subscribe(topic)

    def _subscribe(self, topic: str) -> None:
        self.topic = topic
        self.subscription = self._node.create_subscription(
            self._type,
            self.topic,
            _ignore,
            self._qos,
            callback_group=_NotForExecutors(),
            raw=True,
        )
        self.inbox = Inbox(self.subscription.handle)

    def change_topic(self, topic: str) -> None:
        """Subscribe to another topic of the same type instead; messages not yet taken are lost."""
        before = self.subscription
        self._subscribe(topic)
        self._node.destroy_subscription(before)
        if self._guard is not None:
            self._guard.change_topic(topic)

    def take_raw(self) -> bytes | None:
        """The oldest accepted message not yet taken, as bytes; None if there is none."""
        taken = self._take()
        return None if taken is None else bytes(taken)

    def _take(self) -> memoryview | None:
        """The oldest accepted message not yet taken, valid until the next call."""
        inbox, guard = self.inbox, self._guard
        taken = inbox.take()
        while guard is not None and taken is not None and not guard.admits(inbox.writer, taken):
            taken = inbox.take()
        return taken

    def take_message(self) -> Any | None:
        """The oldest accepted message not yet taken that can be read; None if there is none."""
        while (raw := self._take()) is not None:
            if (message := self.read(bytes(raw))) is not None:
                return message
        return None

    def read(self, raw: bytes) -> Any | None:
        """The message in some bytes; None for invalid bytes, which any node may send."""
        try:
            return deserialize_message(raw, self._type)
        except RuntimeError:
            return None

    def served(self, answer: Callable[[], bool]) -> AbstractContextManager[None]:
        """Have messages answered in the receiving thread, within the context: see `Inbox.served`.

        The next `LaneWaiter.wait` raises what `answer` raises.
        """
        return self.inbox.served(answer)

    @property
    def matched(self) -> int:
        """Number of publishers that send to this subscription."""
        return int(self.subscription.get_publisher_count())


class LaneSubscription(RawSubscription, Generic[SampleT]):
    """Takes samples of one type."""

    def __init__(
        self,
        node: Node,
        sample_type: type[SampleT],
        topic: str | None = None,
        qos: QoSProfile = NEWEST,
        guard: OneWriter | None = None,
    ) -> None:
        """Create the subscription.

        Args:
            node: Node it belongs to.
            sample_type: Type of the messages.
            topic: Topic of the messages; by default that of the type.
            qos: How messages are kept until they are taken.
            guard: Decides which messages are accepted; by default all are.
        """
        super().__init__(node, message_type(sample_type), topic or sample_type.TOPIC, qos, guard)
        self._drain = qos.depth > 1
        self._accepted = None if guard is None else guard.accepted
        self._scratch = sample_type()

    def take_last(self, most: int) -> Sequence[bytes]:
        """The last `most` accepted messages not yet taken, oldest first.

        The caller may have been delayed, so messages that are too old to matter are dropped.
        """
        last: deque[bytes] = deque(maxlen=most)
        while (taken := self._load(self._scratch)) is not False:
            last.append(self._scratch.to_bytes() if taken is True else bytes(taken))
        return last

    def take_next(self, sample: SampleT) -> bool:
        """Whether there was a message not yet taken; loads the oldest one into `sample`.

        Raises:
            LayoutError: if the message is not of this type's size.
        """
        taken = self._load(sample)
        if isinstance(taken, bool):
            return taken
        sample.load(taken)
        return True

    def _load(self, sample: SampleT) -> memoryview | bool:
        """Load the next accepted message into a sample, or return its bytes; False without one."""
        inbox, guard = self.inbox, self._guard
        taken = inbox.load(sample, self._accepted)
        while taken is not True and taken is not False:
            if guard is None or guard.admits(inbox.writer, taken):
                break
            taken = inbox.load(sample, self._accepted)
        return taken

    def take(self, sample: SampleT) -> bool:
        """Whether there was a message not yet taken; loads the newest one and drops older ones.

        Raises:
            LayoutError: if the message is not of this type's size.
        """
        if not self.take_next(sample):
            return False
        if self._drain and not self.inbox.receiving:
            while self.take_next(sample):
                pass
        return True


class LocalTopic(Generic[SampleT]):
    """Samples passed between two nodes of one process, with the interface of `LaneSubscription`.

    Attributes:
        inbox: Object that a `LaneWaiter` waits for: this object itself.
        descriptor: File descriptor, readable when a sample has come that was not answered at once.
    """

    def __init__(self) -> None:
        self.inbox = self
        self.descriptor = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        weakref.finalize(self, os.close, self.descriptor)
        self._newest: bytes | None = None
        self._answer: Callable[[], bool] | None = None

    def put(self, sample: SampleT) -> None:
        """Pass a sample on; it is answered in this thread if the other node can do so."""
        self._newest = sample.to_bytes()
        if self._answer is None or not self._answer():
            os.eventfd_write(self.descriptor, 1)

    @contextmanager
    def served(self, answer: Callable[[], bool]) -> Iterator[None]:
        """Have samples answered in the thread that passes them on, within the context."""
        self._answer = answer
        try:
            yield
        finally:
            self._answer = None

    def clear(self) -> None:
        """Make the descriptor unreadable until the next sample comes."""
        with suppress(BlockingIOError):
            os.eventfd_read(self.descriptor)

    def take_raw(self) -> bytes | None:
        """The newest sample as bytes; None if it was taken already."""
        raw, self._newest = self._newest, None
        return raw

    def take(self, sample: SampleT) -> bool:
        """Whether there was a sample not yet taken; loads it into `sample`."""
        raw = self.take_raw()
        if raw is not None:
            sample.load(raw)
        return raw is not None


def take_from_each(
    subscription: RawSubscription, most: int = 10, longest: int = 1000
) -> list[tuple[bytes, bytes]]:
    """Messages not yet taken of a topic with several writers, oldest first.

    A writer that floods the topic costs little more than taking its messages. Of more than `most`
    messages of one writer, the first `most` - 1 and the newest are returned.

    Args:
        subscription: Subscription of the topic.
        most: Largest number of messages of one writer.
        longest: Largest number of messages taken in one call; further ones wait for the next call.

    Returns:
        Identity of the writer and bytes of each message.
    """
    taken: list[tuple[bytes, bytes]] = []
    places: dict[bytes, list[int]] = {}
    for _ in range(longest):
        raw = subscription.inbox.take()
        if raw is None:
            break
        writer = subscription.inbox.writer
        mine = places.setdefault(writer, [])
        if len(mine) < most:
            mine.append(len(taken))
            taken.append((writer, bytes(raw)))
        else:
            taken[mine[-1]] = (writer, bytes(raw))
    return taken


class LaneWaiter:
    """Waits until a message has come for one of several subscriptions, or `wake` is called.

    A message ends one wait only, so the caller must take all messages before the next wait.
    """

    def __init__(
        self, node: Node, subscriptions: Iterable[RawSubscription | LocalTopic[Any]]
    ) -> None:
        """Prepare to wait for `subscriptions`; the end of the node's context ends a wait, too."""
        self._subscriptions = tuple(subscriptions)
        self._bell = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        weakref.finalize(self, os.close, self._bell)
        node.context.on_shutdown(self.wake)

    def wait(self, timeout_s: float) -> bool:
        """Sleep until a message has come or `wake` is called, at most `timeout_s`.

        Returns:
            True if a message has come.

        Raises:
            BaseException: what the answer to a message raised in the receiving thread.
        """
        inboxes = {s.inbox.descriptor: s.inbox for s in self._subscriptions}
        ready, _, _ = select.select([*inboxes, self._bell], (), (), timeout_s)
        come = False
        for descriptor in ready:
            if descriptor == self._bell:
                os.eventfd_read(descriptor)
            else:
                inboxes[descriptor].clear()
                come = True
        return come

    def wake(self) -> None:
        """End a wait at once, from any thread."""
        os.eventfd_write(self._bell, 1)


def _ignore(_: object) -> None:
    """Callback of a subscription that no executor serves."""
