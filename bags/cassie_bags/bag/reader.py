"""Fast reading of bags: raw messages by topic, also from a file whose writer was killed."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from cassie_bags.bag.framing import RecordReader, parse_message
from cassie_bags.bag.location import bag_files
from cassie_bags.errors import BagError

_NO_SCHEMA = Schema(id=0, name="", encoding="", data=b"")  # of channels that name no schema


@dataclass
class BagIndex:
    """Index of a bag, filled while the bag is read.

    Attributes:
        types: Message types by topic, in the order of their appearance; empty is that of a topic
            without a schema.
        schemas: Definition by message type.
        unreadable: By topic, why its messages are not ROS 2 messages of one type.
        metadata: Metadata records by name.
        complete: Whether the file was closed properly and nothing in it is damaged.
        lost_bytes: Number of bytes that could not be read.
        lost: By topic, how many messages between those so far are not in the bag, as their sequence
            numbers tell: the recorder did not get them, or the file is damaged there.
    """

    types: dict[str, list[str]] = field(default_factory=dict)
    schemas: dict[str, Schema] = field(default_factory=dict)
    unreadable: dict[str, str] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    complete: bool = False
    lost_bytes: int = 0
    lost: dict[str, int] = field(default_factory=dict)

    def add_channel(self, channel: Channel, schema: Schema) -> None:
        """Note the type of a channel's topic, and why the topic cannot be read, if it cannot."""
        kind, kinds = schema.name, self.types.setdefault(channel.topic, [])
        if kind not in kinds:
            kinds.append(kind)
        self.schemas[kind] = schema
        if channel.message_encoding not in ("cdr", ""):
            reason = f"its messages are encoded as {channel.message_encoding}, not as cdr"
        elif not kind:
            reason = "the bag names no message type"
        elif kinds[0] != kind:
            reason = f"the bag names two message types, {kinds[0]} and {kind}"
        else:
            return
        self.unreadable[channel.topic] = reason


def read_messages(
    bag: Path | str, topics: Collection[str] | None = None, index: BagIndex | None = None
) -> Iterator[tuple[str, int, int, bytes]]:
    """Messages of a bag in the order in which they were written.

    Args:
        bag: MCAP file, or a folder as `ros2 bag` writes it.
        topics: Topics that are read; None for all.
        index: Gets types and metadata while reading goes on.

    Yields:
        Topic, log time (robot time) and publish time (wall time) in ns, serialized message.

    Raises:
        BagError: if a file cannot be read or is not a bag.
    """
    index = BagIndex() if index is None else index
    whole = True
    for file in bag_files(bag):
        yield from _messages_of(file, topics, index)
        whole = whole and index.complete
    index.complete = whole


def _messages_of(
    path: Path, topics: Collection[str] | None, index: BagIndex
) -> Iterator[tuple[str, int, int, bytes]]:
    schemas = {0: _NO_SCHEMA}
    known: set[int] = set()
    wanted: dict[int, str] = {}
    numbers: dict[int, int] = {}
    try:
        with path.open("rb") as stream:
            reader = RecordReader(stream, str(path))
            for opcode, body in reader.records():
                if opcode == Opcode.MESSAGE:
                    channel, number, log_time, wall_time, data = parse_message(body)
                    if channel in wanted:
                        topic = wanted[channel]
                        missing = number - numbers.get(channel, number) - 1
                        if missing > 0:
                            index.lost[topic] = index.lost.get(topic, 0) + missing
                        numbers[channel] = number
                        yield topic, log_time, wall_time, data
                    elif channel not in known:
                        reader.lost_bytes += len(body)  # its channel's definition is damaged
                elif opcode == Opcode.SCHEMA:
                    schemas[body.id] = body
                elif opcode == Opcode.CHANNEL and body.schema_id in schemas:
                    known.add(body.id)
                    index.add_channel(body, schemas[body.schema_id])
                    if topics is None or body.topic in topics:
                        wanted[body.id] = body.topic
                elif opcode == Opcode.METADATA:
                    index.metadata[body.name] = body.metadata
            index.complete = reader.complete and not reader.lost_bytes
            index.lost_bytes += reader.lost_bytes
    except OSError as error:
        raise BagError(f"cannot read bag {path}: {error.strerror}") from None


def unknown_topic(name: str, topics: Collection[str]) -> str:
    """Error message for a topic that a bag does not have: a topic of similar last word, or all."""
    topic_of = {topic.rpartition("/")[2]: topic for topic in topics}
    near = get_close_matches(name.rpartition("/")[2], topic_of, n=1)
    if near:
        return f"unknown topic {name}: did you mean {topic_of[near[0]]}?"
    return f"unknown topic {name}: known: {', '.join(sorted(topics))}"


def read_attachment(bag: Path | str, name: str) -> bytes | None:
    """A file attached to a bag; None if there is none of that name.

    Raises:
        BagError: if the bag cannot be read.
    """
    for path in bag_files(bag):
        with path.open("rb") as stream:
            for opcode, content in RecordReader(stream, str(path)).records():
                if opcode == Opcode.ATTACHMENT and content.name == name:
                    return bytes(content.data)
    return None
