"""The framing of MCAP files: records one after another, also of a damaged file.

Source:
    The MCAP specification, "Records" and "Chunk": a record is one byte of opcode, eight of
    length and its content; a chunk holds records of its own, compressed together.
"""

from __future__ import annotations

import contextlib
import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from typing import Any, BinaryIO

import mcap.records
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode

from cassie_bags.errors import BagError

MAGIC = b"\x89MCAP0\r\n"

Record = tuple[int, Any]
"""Opcode and content: bytes, or what `_KINDS` makes of them."""

_KINDS: dict[int, Any] = {
    Opcode.HEADER: mcap.records.Header,
    Opcode.SCHEMA: mcap.records.Schema,
    Opcode.CHANNEL: mcap.records.Channel,
    Opcode.METADATA: mcap.records.Metadata,
}
_FRAME = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_FOOTER = struct.Struct("<BQQQI")


class RecordReader:
    """Records of a bag up to its end, or to the first that breaks off; damaged ones are left out.

    Attributes:
        complete: Whether the file had been closed properly and nothing in it is damaged; known
            once `records` ended.
        lost_bytes: Bytes that could not be read.
    """

    def __init__(self, stream: BinaryIO, name: str) -> None:
        """Look at the start of the file.

        Args:
            stream: The file, open for reading.
            name: What to call it in an error.

        Raises:
            BagError: if it is not an MCAP file.
        """
        self._stream = stream
        self.complete = False
        self.lost_bytes = 0
        self._size = stream.seek(0, 2)
        stream.seek(0)
        if stream.read(len(MAGIC)) != MAGIC:
            raise BagError(f"{name} is not an MCAP file")

    def records(self) -> Iterator[Record]:
        """Each whole record; chunks are opened and followed by the records in them."""
        while True:
            start = self._stream.tell()
            opcode, body = self._next()
            if body is None:
                self.lost_bytes += self._size - start
                return
            try:
                # All that is in a chunk is looked at before any of it is used.
                found = list(whole(opcode, body))
            except BagError:
                found = list(self._summary()) if not self.lost_bytes else []
                self.lost_bytes += self._stream.tell() - start
            yield from found
            if opcode == Opcode.FOOTER:
                closed = self._stream.read(len(MAGIC)) == MAGIC
                self.complete = closed and not self.lost_bytes
                return

    def _next(self) -> tuple[int, bytes | None]:
        """Opcode and bytes of the next record; no bytes if it is not all there."""
        frame = self._stream.read(_FRAME.size)
        if len(frame) < _FRAME.size:
            return 0, None
        opcode, length = _FRAME.unpack(frame)
        if length > self._size - self._stream.tell():
            return opcode, None
        return opcode, self._stream.read(length)

    def _summary(self) -> Iterator[Record]:
        """Schemas and channels as the end of the file repeats them: the damage may have had them.

        What is not there, or damaged too, is left out.
        """
        here = self._stream.tell()
        self._stream.seek(max(0, self._size - len(MAGIC) - _FOOTER.size))
        footer = self._stream.read(_FOOTER.size)
        opcode, _, start, _, _ = _FOOTER.unpack(footer) if len(footer) == _FOOTER.size else [0] * 5
        if opcode == Opcode.FOOTER and 0 < start < self._size:
            self._stream.seek(start)
            while (entry := self._next())[1] is not None and entry[0] in _KINDS:
                with contextlib.suppress(BagError):
                    yield from whole(entry[0], entry[1])
        self._stream.seek(here)


def whole(opcode: int, body: bytes) -> Iterator[Record]:
    """A record, and those in it if it is a chunk.

    Raises:
        BagError: if it is damaged.
    """
    kind = _KINDS.get(opcode)
    if opcode == Opcode.CHUNK:
        for inner, content in frames(chunk_content(body)):
            if inner == Opcode.MESSAGE and len(content) >= _MESSAGE.size:
                yield inner, content  # most records are messages: no generator for each
            else:
                yield from whole(inner, content)
        yield opcode, body
    elif kind is not None:
        yield opcode, _parsed(kind, body)
    elif opcode == Opcode.MESSAGE and len(body) < _MESSAGE.size:
        raise BagError(f"damaged message of {len(body)} bytes")
    else:
        yield opcode, body


def _parsed(kind: Any, body: bytes) -> Any:
    try:
        return kind.read(ReadDataStream(BytesIO(body)))
    except (McapError, struct.error, UnicodeDecodeError) as error:
        raise BagError(f"damaged record: {error}") from None


def frames(content: bytes) -> Iterator[Record]:
    """The records within the content of a chunk."""
    position, size = 0, len(content)
    while position + _FRAME.size <= size:
        opcode, length = _FRAME.unpack_from(content, position)
        position += _FRAME.size
        yield opcode, content[position : position + length]
        position += length


def chunk_content(body: bytes) -> bytes:
    """What a chunk holds, decompressed.

    Args:
        body: Content of a chunk record.

    Raises:
        BagError: if it is damaged or compressed in a way that is not known.
    """
    chunk = _parsed(mcap.records.Chunk, body)
    if chunk.compression == "zstd":
        try:
            content: bytes = zstandard.decompress(chunk.data, chunk.uncompressed_size)
        except zstandard.ZstdError as error:
            raise BagError(f"damaged chunk: {error}") from None
    elif chunk.compression == "":
        content = chunk.data
    else:
        raise BagError(f"chunk in unknown compression {chunk.compression}")
    if chunk.uncompressed_crc and zlib.crc32(content) != chunk.uncompressed_crc:
        raise BagError("damaged chunk: its checksum differs")
    return content


def message(body: bytes) -> tuple[int, int, int, bytes]:
    """Channel, log time, publish time (ns) and data of a message record."""
    channel, _, log_time, publish_time = _MESSAGE.unpack_from(body)
    return channel, log_time, publish_time, body[_MESSAGE.size :]
