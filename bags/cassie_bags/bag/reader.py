"""Fast reading of bags: raw messages by topic, also of a file whose writer was killed."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from mcap.opcode import Opcode

from cassie_bags.bag.framing import RecordReader, message
from cassie_bags.errors import BagError


@dataclass
class BagIndex:
    """What a bag says about itself, filled while it is read.

    Attributes:
        types: Message type by topic.
        metadata: Named records of words.
        complete: Whether the file was closed properly and nothing in it is damaged.
        lost_bytes: Bytes that could not be read.
    """

    types: dict[str, str] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    complete: bool = False
    lost_bytes: int = 0


def read_messages(
    path: Path, topics: Collection[str] | None = None, index: BagIndex | None = None
) -> Iterator[tuple[str, int, int, bytes]]:
    """Messages of a bag in the order they were written.

    Args:
        path: The bag.
        topics: Those wanted; None for all.
        index: Filled with types and metadata as they come by.

    Yields:
        Topic, log time (robot time) and publish time (wall time) in ns, serialized message.

    Raises:
        BagError: if the file cannot be read or is not a bag.
    """
    index = BagIndex() if index is None else index
    schemas: dict[int, str] = {}
    wanted: dict[int, str] = {}
    try:
        with path.open("rb") as stream:
            reader = RecordReader(stream, str(path))
            for opcode, body in reader.records():
                if opcode == Opcode.MESSAGE:
                    channel, log_time, wall_time, data = message(body)
                    if channel in wanted:
                        yield wanted[channel], log_time, wall_time, data
                elif opcode == Opcode.SCHEMA:
                    schemas[body.id] = body.name
                elif opcode == Opcode.CHANNEL and body.schema_id in schemas:
                    index.types[body.topic] = schemas[body.schema_id]
                    if topics is None or body.topic in topics:
                        wanted[body.id] = body.topic
                elif opcode == Opcode.METADATA:
                    index.metadata[body.name] = body.metadata
            index.complete, index.lost_bytes = reader.complete, reader.lost_bytes
    except OSError as error:
        raise BagError(f"cannot read bag {path}: {error.strerror}") from None
