"""Repair of a bag that is damaged or was not closed: an indexed file of all that is whole."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from mcap.opcode import Opcode
from mcap.records import Channel, Header, Metadata, Schema
from mcap.writer import Writer

from cassie_bags.bag.framing import RecordReader, message
from cassie_bags.bag.writer import PROFILE
from cassie_bags.errors import BagError


@dataclass(frozen=True)
class Recovered:
    """What was saved.

    Attributes:
        messages: Number of messages.
        duration: From the first to the last of them, robot time. In s.
        complete: Whether the file had been closed properly and nothing in it is damaged.
        lost_bytes: Bytes that could not be read.
    """

    messages: int
    duration: float
    complete: bool
    lost_bytes: int


def recover(source: Path, target: Path) -> Recovered:
    """Copy every whole record of a bag into a new, indexed one.

    Args:
        source: Bag whose end may be missing. It is not changed.
        target: New bag.

    Raises:
        BagError: if `source` is not a bag, has no message, or a file cannot be opened.
    """
    if source.resolve() == target.resolve():
        raise BagError(f"cannot recover {source} onto itself: give another output file")
    try:
        with source.open("rb") as stream:
            reader = RecordReader(stream, str(source))
            with target.open("wb") as output:
                copy = _Copy(output)
                for opcode, body in reader.records():
                    copy.take(opcode, body)
                copy.writer.finish()
    except OSError as error:
        place = error.filename or target
        raise BagError(f"cannot recover {source}: {place}: {error.strerror}") from None
    if copy.messages == 0:
        target.unlink()
        raise BagError(f"no whole chunk of messages in {source}: nothing to recover")
    span = (copy.last - copy.first) * 1e-9
    return Recovered(copy.messages, span, reader.complete, reader.lost_bytes)


class _Copy:
    """Writes records as they come, one chunk for each chunk."""

    def __init__(self, output: BinaryIO) -> None:
        self.writer = Writer(output, chunk_size=1 << 30)
        self._started = False
        self.messages = 0
        self.first = 0
        self.last = 0
        self._schemas: dict[int, int] = {0: 0}
        self._channels: dict[int, int] = {}
        self._takers: dict[int, Callable[[Any], None]] = {
            Opcode.HEADER: self._take_header,
            Opcode.SCHEMA: self._take_schema,
            Opcode.CHANNEL: self._take_channel,
            Opcode.MESSAGE: self._take_message,
            Opcode.METADATA: self._take_metadata,
            Opcode.CHUNK: lambda _: self.writer.flush(),
        }

    def take(self, opcode: int, content: Any) -> None:
        if not self._started and opcode != Opcode.HEADER:
            self._start(PROFILE)  # the header is damaged
        taker = self._takers.get(opcode)
        if taker is not None:
            taker(content)

    def _start(self, profile: str) -> None:
        self._started = True
        self.writer.start(profile=profile)

    def _take_header(self, header: Header) -> None:
        self._start(header.profile)

    def _take_schema(self, schema: Schema) -> None:
        if schema.id not in self._schemas:
            self._schemas[schema.id] = self.writer.register_schema(
                schema.name, schema.encoding, schema.data
            )

    def _take_channel(self, channel: Channel) -> None:
        if channel.id not in self._channels and channel.schema_id in self._schemas:
            self._channels[channel.id] = self.writer.register_channel(
                channel.topic,
                channel.message_encoding,
                self._schemas[channel.schema_id],
                channel.metadata,
            )

    def _take_metadata(self, metadata: Metadata) -> None:
        self.writer.add_metadata(metadata.name, metadata.metadata)

    def _take_message(self, body: bytes) -> None:
        channel, log_time, publish_time, data = message(body)
        if channel not in self._channels:
            return  # what it was is damaged
        self.first = min(self.first, log_time) if self.messages else log_time
        self.last = max(self.last, log_time)
        self.messages += 1
        self.writer.add_message(self._channels[channel], log_time, data, publish_time)
