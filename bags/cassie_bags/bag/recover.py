"""Repairs a bag that is damaged or was not closed: copies all intact records, with an index."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Header, Metadata, Schema
from mcap.writer import Writer

from cassie_bags.bag.framing import RecordReader, parse_message
from cassie_bags.bag.location import bag_files
from cassie_bags.bag.output import new_files
from cassie_bags.bag.rosbag2 import (
    QOS_KEY,
    RECORD,
    Contents,
    Topic,
    read_profiles,
    record_of,
    write_metadata,
)
from cassie_bags.bag.writer import PROFILE
from cassie_bags.errors import BagError


@dataclass(frozen=True)
class Recovered:
    """Result of a repair.

    Attributes:
        messages: Number of copied messages.
        duration: Robot time from the first to the last copied message. In s.
        complete: Whether the bag was closed properly and nothing in it is damaged.
        lost_bytes: Number of bytes that could not be read.
    """

    messages: int
    duration: float
    complete: bool
    lost_bytes: int


def recover(source: Path | str, target: Path | str) -> Recovered:
    """Copy every intact record of a bag into a new bag with an index.

    Args:
        source: Bag whose end may be missing: a file, or a folder as `ros2 bag` writes it. It is
            not changed.
        target: New bag, a folder if `source` is one. It must not exist. If the repair fails, it
            does not exist afterwards.

    Raises:
        BagError: if `source` is not a bag or has no message; if `target` exists or cannot be
            written.
    """
    source, target = Path(source), Path(target)
    files = bag_files(source)
    if os.path.lexists(target):
        raise BagError(f"{target} exists: give another output with -o, or remove it")
    if not target.parent.is_dir():
        raise BagError(f"cannot write {target}: No such file or directory")
    with new_files([target]) as (part,):
        if source.is_dir():
            part.mkdir()
            copies = [_recovered_file(file, part / file.name, file.name) for file in files]
        else:
            copies = [_recovered_file(source, part, target.name)]
        filled = [copy.contents for copy in copies if copy.contents.count]
        if not filled:
            if undefined := sum(copy.undefined for copy in copies):
                raise BagError(
                    f"{source} has {undefined} messages without a definition of their topic: "
                    "nothing to recover"
                )
            raise BagError(f"no whole chunk of messages in {source}: nothing to recover")
        if source.is_dir():
            write_metadata(part, [copy.contents for copy in copies])
    return Recovered(
        sum(contents.count for contents in filled),
        (max(each.end for each in filled) - min(each.start for each in filled)) * 1e-9,
        all(copy.complete for copy in copies),
        sum(copy.lost_bytes for copy in copies),
    )


def _recovered_file(source: Path, target: Path, name: str) -> _Copy:
    """Copy one file.

    Args:
        source: The damaged file.
        target: File to write.
        name: Name of the file in the metadata.
    """
    try:
        stream = source.open("rb")
    except OSError as error:
        raise BagError(f"cannot read bag {source}: {error.strerror}") from None
    with stream:
        reader = RecordReader(stream, str(source))
        with target.open("wb") as output:
            copy = _Copy(output, name)
            for opcode, body in reader.records():
                copy.write(opcode, body)
            copy.finish()
    copy.lost_bytes += reader.lost_bytes
    copy.complete = reader.complete and not copy.lost_bytes
    return copy


class _Copy:
    """Writes records as they come, with one chunk for each chunk of the source.

    Attributes:
        contents: Contents of the new file.
        complete, lost_bytes: As in `Recovered`.
        undefined: Number of messages left out, as the definition of their topic is damaged.
    """

    def __init__(self, output: BinaryIO, name: str) -> None:
        self._writer = Writer(output, chunk_size=1 << 30, enable_data_crcs=True)
        self._started = False
        self.contents = Contents(name)
        self._has_messages = False
        self.complete = False
        self.lost_bytes = 0
        self.undefined = 0
        self._schemas: dict[int, int] = {0: 0}
        self._types: dict[int, str] = {0: ""}
        self._channels: dict[int, int] = {}
        self._topics: dict[int, Topic] = {}
        self._methods: dict[int, Callable[[Any], None]] = {
            Opcode.HEADER: self._write_header,
            Opcode.SCHEMA: self._write_schema,
            Opcode.CHANNEL: self._write_channel,
            Opcode.MESSAGE: self._write_message,
            Opcode.METADATA: self._write_metadata,
            Opcode.ATTACHMENT: self._write_attachment,
            Opcode.CHUNK: lambda _: self._writer.flush(),
        }

    def write(self, opcode: int, content: Any) -> None:
        if not self._started and opcode != Opcode.HEADER:
            self._start(PROFILE)  # the header is damaged
        if opcode in self._methods:
            self._methods[opcode](content)

    def finish(self) -> None:
        self._writer.flush()
        self._writer.add_metadata(RECORD, record_of(self.contents))
        self._writer.finish()

    def _start(self, profile: str) -> None:
        self._started = True
        self._writer.start(profile=profile)

    def _write_header(self, header: Header) -> None:
        if not self._started:
            self._start(header.profile)

    def _write_schema(self, schema: Schema) -> None:
        if schema.id not in self._schemas:
            self._types[schema.id] = schema.name
            self._schemas[schema.id] = self._writer.register_schema(
                schema.name, schema.encoding, schema.data
            )

    def _write_channel(self, channel: Channel) -> None:
        if channel.id in self._channels or channel.schema_id not in self._schemas:
            return
        profiles, text = read_profiles(channel.metadata.get(QOS_KEY, ""))
        self._channels[channel.id] = self._writer.register_channel(
            channel.topic,
            channel.message_encoding,
            self._schemas[channel.schema_id],
            channel.metadata | {QOS_KEY: text},
        )
        self._topics[channel.id] = self.contents.topics.setdefault(
            channel.topic, Topic(self._types[channel.schema_id], profiles)
        )

    def _write_metadata(self, metadata: Metadata) -> None:
        if metadata.name != RECORD:  # written again at the end
            self._writer.add_metadata(metadata.name, metadata.metadata)

    def _write_attachment(self, file: Attachment) -> None:
        self._writer.add_attachment(
            file.create_time, file.log_time, file.name, file.media_type, file.data
        )

    def _write_message(self, body: bytes) -> None:
        channel, number, log_time, publish_time, data = parse_message(body)
        if channel not in self._channels:
            self.undefined += 1
            self.lost_bytes += len(body)
            return
        contents = self.contents
        contents.start = min(contents.start, log_time) if self._has_messages else log_time
        contents.end = max(contents.end, log_time)
        self._has_messages = True
        self._topics[channel].count += 1
        self._writer.add_message(self._channels[channel], log_time, data, publish_time, number)
