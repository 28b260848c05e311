"""The framing of MCAP files: records one after another, also of a file that breaks off.

Source:
    The MCAP specification, "Records" and "Chunk": a record is one byte of opcode, eight of
    length and its content; a chunk holds records of its own, compressed together.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from typing import BinaryIO

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Chunk

from cassie_bags.errors import BagError

MAGIC = b"\x89MCAP0\r\n"

Record = tuple[int, bytes]
"""Opcode and content."""

_FRAME = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")


class RecordReader:
    """Records of a bag up to its end, or to the first that is not whole.

    Attributes:
        complete: Whether the file had been closed properly; known once `records` ended.
        lost_bytes: Bytes after the last whole record.
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
        self._name = name
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
            frame = self._stream.read(_FRAME.size)
            if len(frame) < _FRAME.size:
                break
            opcode, length = _FRAME.unpack(frame)
            if length > self._size - self._stream.tell():
                break
            body = self._stream.read(length)
            try:
                inner = chunk_content(body) if opcode == Opcode.CHUNK else b""
            except BagError:
                break
            yield opcode, body
            yield from frames(inner)
            if opcode == Opcode.FOOTER:
                self.complete = self._stream.read(len(MAGIC)) == MAGIC
                return
        self.lost_bytes = self._size - start


def frames(content: bytes) -> Iterator[Record]:
    """The records within the content of a chunk."""
    view = memoryview(content)
    position = 0
    while position + _FRAME.size <= len(content):
        opcode, length = _FRAME.unpack_from(content, position)
        position += _FRAME.size
        yield opcode, bytes(view[position : position + length])
        position += length


def chunk_content(body: bytes) -> bytes:
    """What a chunk holds, decompressed.

    Args:
        body: Content of a chunk record.

    Raises:
        BagError: if it is damaged or compressed in a way that is not known.
    """
    try:
        chunk = Chunk.read(ReadDataStream(BytesIO(body)))
    except (McapError, struct.error, UnicodeDecodeError) as error:
        raise BagError(f"damaged chunk: {error}") from None
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
