"""Repairs a bag that is damaged or was not closed: copies all intact records, with an index."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from mcap.opcode import Opcode
from mcap.records import Channel
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
    """Copy one file; `name` is that of the new one in the metadata."""
    try:
        stream = source.open("rb")
    except OSError as error:
        raise BagError(f"cannot read bag {source}: {error.strerror}") from None
    with stream:
        reader = RecordReader(stream, str(source))
        with target.open("wb") as output:
            copy = _Copy(output, name)
            for opcode, record in reader.records():
                copy.write(opcode, record)
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
        self.complete = False
        self.lost_bytes = 0
        self.undefined = 0
        # New number with type by number of the schema, and with topic by number of the channel.
        self._schemas: dict[int, tuple[int, str]] = {0: (0, "")}
        self._channels: dict[int, tuple[int, Topic]] = {}

    def write(self, opcode: int, record: Any) -> None:
        writer = self._writer
        if not self._started:
            self._started = True
            whole = opcode == Opcode.HEADER  # otherwise it is damaged
            writer.start(profile=record.profile if whole else PROFILE)
        if opcode == Opcode.MESSAGE:
            self._write_message(record)
        elif opcode == Opcode.SCHEMA and record.id not in self._schemas:
            number = writer.register_schema(record.name, record.encoding, record.data)
            self._schemas[record.id] = number, record.name
        elif opcode == Opcode.CHANNEL:
            self._write_channel(record)
        elif opcode == Opcode.METADATA and record.name != RECORD:  # written again at the end
            writer.add_metadata(record.name, record.metadata)
        elif opcode == Opcode.ATTACHMENT:
            writer.add_attachment(
                record.create_time, record.log_time, record.name, record.media_type, record.data
            )
        elif opcode == Opcode.CHUNK:
            writer.flush()

    def finish(self) -> None:
        self._writer.flush()
        self._writer.add_metadata(RECORD, record_of(self.contents))
        self._writer.finish()

    def _write_channel(self, channel: Channel) -> None:
        if channel.id in self._channels or channel.schema_id not in self._schemas:
            return
        schema, kind = self._schemas[channel.schema_id]
        profiles, text = read_profiles(channel.metadata.get(QOS_KEY, ""))
        metadata = channel.metadata | {QOS_KEY: text}
        name = channel.topic
        number = self._writer.register_channel(name, channel.message_encoding, schema, metadata)
        topic = self.contents.topics.setdefault(name, Topic(kind, profiles))
        self._channels[channel.id] = number, topic

    def _write_message(self, body: bytes) -> None:
        channel, sequence, log_time, publish_time, data = parse_message(body)
        if channel not in self._channels:
            self.undefined += 1
            self.lost_bytes += len(body)
            return
        number, topic = self._channels[channel]
        topic.count += 1
        self.contents.extend(log_time, log_time)
        self._writer.add_message(number, log_time, data, publish_time, sequence)
