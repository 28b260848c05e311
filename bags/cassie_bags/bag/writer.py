"""Writing of bags: MCAP in the ROS 2 profile, definitions embedded, safe against a kill.

A chunk is closed, written and handed to the operating system at the latest half a second
after its first message, in robot time as well as in wall time. If the writer is killed,
what is in the file is therefore complete but for the last half second, and
`cassie_bags.bag.recover` makes an indexed file of it.

`log_time` is robot time (continued over episodes), so that a bag replays and plots on the
robot's clock whatever the speed of the machine; `publish_time` is the time of receipt.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

from mcap.writer import Writer

from cassie_bags.bag.definitions import definition
from cassie_bags.errors import BagError

PROFILE = "ros2"
"""How a bag says that its messages are of ROS 2."""

CHUNK_NS = 500_000_000
"""Longest span of a chunk. In ns, of robot time and of wall time."""

_CHUNK_BYTES = 1 << 30  # chunks are closed by time, not by size

QOS_LANE = (1, 100, 1, 2)
QOS_DEFAULT = (1, 10, 1, 2)
"""History, depth, reliability and durability as rmw numbers them."""

_QOS = """- history: {history}
  depth: {depth}
  reliability: {reliability}
  durability: {durability}
  deadline: {{sec: 9223372036, nsec: 854775807}}
  lifespan: {{sec: 9223372036, nsec: 854775807}}
  liveliness: 1
  liveliness_lease_duration: {{sec: 9223372036, nsec: 854775807}}
  avoid_ros_namespace_conventions: false
"""


class BagWriter:
    """One bag, open for writing. Use it in a `with` statement, or call `close`.

    Whatever writes raises a BagError if the file cannot take it, as when the disk is full.
    """

    def __init__(self, path: Path) -> None:
        """Create the file; its folder is made too.

        Raises:
            BagError: if the file cannot be created.
        """
        self.path = path
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._stream: BinaryIO = path.open("wb")
        except OSError as error:
            raise BagError(f"cannot write bag {path}: {error.strerror}") from None
        self._writer = Writer(self._stream, chunk_size=_CHUNK_BYTES)
        self._writer.start(profile=PROFILE)
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._counts: dict[int, int] = {}
        self._chunk_log: int | None = None
        self._chunk_wall = 0
        self._closed = False

    def add_topic(
        self, topic: str, type_name: str, qos: tuple[int, int, int, int] = QOS_DEFAULT
    ) -> int:
        """Declare a topic.

        Args:
            topic: Its full name.
            type_name: Type of its messages, package/msg/Name.
            qos: History, depth, reliability and durability of its writer.

        Returns:
            The channel to give to `write`; the same one when the topic is known already.

        Raises:
            BagError: if the definition of the type is not installed.
        """
        if topic not in self._channels:
            if type_name not in self._schemas:
                text = definition(type_name).encode()
                self._schemas[type_name] = self._writer.register_schema(type_name, "ros2msg", text)
            names = ("history", "depth", "reliability", "durability")
            profile = _QOS.format(**dict(zip(names, qos, strict=True)))
            self._channels[topic] = self._writer.register_channel(
                topic, "cdr", self._schemas[type_name], {"offered_qos_profiles": profile}
            )
            self._counts[self._channels[topic]] = 0
        return self._channels[topic]

    def write(self, channel: int, data: bytes, log_time: int, wall_time: int) -> None:
        """Append one message.

        Args:
            channel: From `add_topic`.
            data: Serialized message.
            log_time: Robot time. In ns.
            wall_time: Time of receipt. In ns; in a run without ROS, robot time again.
        """
        if self._chunk_log is None:
            self._chunk_log, self._chunk_wall = log_time, wall_time
        elif abs(log_time - self._chunk_log) >= CHUNK_NS:
            self._close_chunk()
            self._chunk_log, self._chunk_wall = log_time, wall_time
        count = self._counts[channel] = self._counts[channel] + 1
        self._writer.add_message(channel, log_time, data, wall_time, count & 0xFFFFFFFF)
        if wall_time - self._chunk_wall >= CHUNK_NS:
            self._close_chunk()

    def flush_if_due(self, wall_time: int) -> None:
        """Close the chunk if it has been open for half a second. To be called when idle.

        Args:
            wall_time: Now. In ns.
        """
        if self._chunk_log is not None and wall_time - self._chunk_wall >= CHUNK_NS:
            self._close_chunk()

    def add_metadata(self, name: str, content: Mapping[str, str]) -> None:
        """Append a named record of words, for example what a seed drew."""
        with self._told():
            self._writer.add_metadata(name, dict(content))
            self._stream.flush()

    @property
    def counts(self) -> dict[str, int]:
        """Messages written so far, by topic."""
        return {topic: self._counts[channel] for topic, channel in self._channels.items()}

    def close(self) -> None:
        """Write what is open, then the index. Calling it again does nothing."""
        if not self._closed:
            self._closed = True
            with self._told():
                self._writer.finish()
                self._stream.close()

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _close_chunk(self) -> None:
        with self._told():
            self._writer.flush()
        self._chunk_log = None

    @contextlib.contextmanager
    def _told(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            self._closed = True  # what it holds cannot be written, now or at the end
            with contextlib.suppress(OSError):
                self._stream.close()
            raise BagError(f"cannot write bag {self.path}: {error.strerror}") from None
