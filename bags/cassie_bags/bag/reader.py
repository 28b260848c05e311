"""Fast reading of bags: raw messages by topic, also from a file whose writer was killed."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterator
from dataclasses import dataclass, field
from difflib import get_close_matches
from itertools import chain
from pathlib import Path
from typing import NamedTuple

from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from cassie_bags.bag.definitions import Members, parse_definition
from cassie_bags.bag.framing import RecordReader, parse_message
from cassie_bags.bag.location import bag_files
from cassie_bags.errors import BagError

_NO_SCHEMA = Schema(id=0, name="", encoding="", data=b"")  # of channels that name no schema


class _Topics(NamedTuple):
    """What a bag says about its topics, by topic; see `BagIndex`."""

    types: dict[str, list[str]]
    definitions: dict[str, Schema]
    unreadable: dict[str, str]


@dataclass
class BagIndex:
    """Index of a bag, filled while the bag is read.

    Attributes:
        metadata: Metadata records by name.
        complete: Whether the file was closed properly and nothing in it is damaged.
        lost_bytes: Number of bytes that could not be read.
        lost: By topic, how many messages between those so far are not in the bag, as their sequence
            numbers tell: the recorder did not get them, or the file is damaged there.
    """

    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    complete: bool = False
    lost_bytes: int = 0
    lost: dict[str, int] = field(default_factory=dict)
    _channels: dict[Hashable, list[tuple[Channel, Schema]]] = field(default_factory=dict)
    _topics: _Topics | None = None

    def add_channel(self, key: Hashable, channel: Channel, schema: Schema, *, used: bool) -> None:
        """Note a channel and its definition.

        A bag may repeat both. The last ones count, since the first ones may be damaged: between
        chunks they have no checksum. Those by which messages were read count, too.

        Args:
            key: File and number of the channel.
            channel: The channel.
            schema: Definition of its messages.
            used: Whether messages of the channel came before.
        """
        known = self._channels.setdefault(key, [])
        if (channel, schema) not in known:
            known[:] = [*known, (channel, schema)] if used else [(channel, schema)]
            self._topics = None

    @property
    def damage(self) -> str:
        """What is wrong with the bag and what it lacks, to go on from "it is"; empty if nothing.

        Known once the bag has been read. Missing messages are those of the topics that were read.
        """
        if self.complete:
            return ""
        lost, missing = self.lost_bytes, sum(self.lost.values())
        words = [f"{lost} bytes could not be read"] if lost else []
        words += [f"{missing} messages between the others are missing"] if missing else []
        state = "damaged or not closed" if lost else "not closed"
        return f"{': '.join(filter(None, [state, ', '.join(words)]))}; see recover"

    @property
    def types(self) -> dict[str, list[str]]:
        """Message types by topic, in the order of their appearance.

        Empty is the type of a topic without a schema.
        """
        return self._by_topic().types

    @property
    def definitions(self) -> dict[str, Schema]:
        """Definition of the messages by topic; the first one if there are several."""
        return self._by_topic().definitions

    @property
    def unreadable(self) -> dict[str, str]:
        """By topic, why its messages are not ROS 2 messages of one type."""
        return self._by_topic().unreadable

    def _by_topic(self) -> _Topics:
        if self._topics is None:
            self._topics = topics = _Topics({}, {}, {})
            for channel, schema in chain.from_iterable(self._channels.values()):
                kinds = topics.types.setdefault(channel.topic, [])
                if schema.name not in kinds:
                    kinds.append(schema.name)
                first = topics.definitions.setdefault(channel.topic, schema)
                if reason := _mismatch(channel, schema, first):
                    topics.unreadable[channel.topic] = reason
        return self._topics


def _mismatch(channel: Channel, schema: Schema, first: Schema) -> str:
    """Why a topic cannot be read with a channel; empty if it can.

    Args:
        channel: Channel of the topic.
        schema: Definition of its messages.
        first: Definition of the topic's first channel.
    """
    if channel.message_encoding not in ("cdr", ""):
        return f"its messages are encoded as {channel.message_encoding}, not as cdr"
    if not schema.name:
        return "the bag names no message type"
    if schema.name != first.name:
        return f"the bag names two message types, {first.name} and {schema.name}"
    if schema.data != first.data and _fields(schema) != _fields(first):
        return f"the bag has two definitions of {schema.name} for it"
    return ""


def _fields(schema: Schema) -> Members | bytes:
    """Fields of a definition; its text if it is of another form than ROS's."""
    try:
        return parse_definition(schema.name, schema.data.decode("utf-8", "replace"))
    except BagError:
        return bytes(schema.data)


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
                    schema, used = schemas[body.schema_id], body.id in numbers
                    index.add_channel((path, body.id), body, schema, used=used)
                    if topics is None or body.topic in topics:
                        wanted[body.id] = body.topic
                    else:
                        wanted.pop(body.id, None)
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
