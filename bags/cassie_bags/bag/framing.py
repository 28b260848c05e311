"""Framing of MCAP files: the records in order, also of a damaged file.

Source:
    The MCAP specification, "Records" and "Chunk". A record is one byte of opcode, eight bytes of
    length, and its content. A chunk contains records, compressed together.
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Callable, Iterator
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
"""Opcode and content: bytes, or the record that `_PARSED_KINDS` reads from them."""


class CompressionError(BagError):
    """Chunks cannot be read, as the library of their compression is not installed."""


_PARSED_KINDS: dict[int, Any] = {
    Opcode.HEADER: mcap.records.Header,
    Opcode.SCHEMA: mcap.records.Schema,
    Opcode.CHANNEL: mcap.records.Channel,
    Opcode.METADATA: mcap.records.Metadata,
    Opcode.ATTACHMENT: mcap.records.Attachment,
}
_IN_CHUNK = frozenset([Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE])
_BEFORE_INDEX = _IN_CHUNK | {
    Opcode.HEADER,
    Opcode.CHUNK,
    Opcode.MESSAGE_INDEX,
    Opcode.ATTACHMENT,
    Opcode.METADATA,
    Opcode.DATA_END,
}
_HEADER = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_FOOTER = struct.Struct("<BQQQI")
_CRC = struct.Struct("<I")

# Possible starts of records that can be verified: a chunk, metadata, the ends of data and file. No
# length reaches 2^40.
_RECORD_START = re.compile(rb"(?=[\x02\x06\x0c\x0f][\x00-\xff]{5}\x00\x00\x00)")
_DATA_END = _HEADER.pack(Opcode.DATA_END, _CRC.size)
_PRIVATE = 0x80  # first opcode for records of applications, which readers skip
_SEARCH_SIZE = 1 << 22  # bytes searched at a time
_MAX_HEAD = 1 << 26  # bytes searched for a record in a file that neither begins nor ends as MCAP
_MAX_RATIO = 64  # largest plausible compression ratio (ours have 3), apart from
_MAX_UNCHECKED = 1 << 28  # bytes that a chunk may have in any case (ours have 400 kB)


class RecordReader:
    """Reads the records of a bag up to its end, without damaged ones.

    Damage may shift what follows it, such as an inserted byte. Reading then goes on at the next
    record that is intact.

    Attributes:
        complete: Whether the file was closed properly and nothing in it is damaged; known once
            `records` has ended.
        lost_bytes: Number of bytes that could not be read; 1 if a checksum reveals damage at an
            unknown place.
    """

    def __init__(self, stream: BinaryIO, name: str) -> None:
        """Read the start of a file that is open for reading; `name` stands for it in errors.

        Raises:
            BagError: if it is not an MCAP file.
        """
        self._stream, self._name = stream, name
        self.complete = False
        self.lost_bytes = 0
        self._size = stream.seek(0, 2)
        self._begin = len(MAGIC)  # of the first record
        if self._read(0, len(MAGIC)) != MAGIC:
            self._begin = self._begin_behind_damage()
            if self._begin == self._size:
                raise BagError(f"{name} is not an MCAP file")
            self.lost_bytes = self._begin

    def records(self) -> Iterator[Record]:
        """Yield each intact record of messages, definitions, metadata and attachments, in order.

        A chunk comes after the records in it. The summary section at the end is checked, but not
        yielded.

        Raises:
            BagError: if the library of the chunks' compression is not installed.
        """
        position, checksum = self._begin, zlib.crc32(MAGIC)
        has_chunks = definitions_read = False
        if self.lost_bytes and self._record_header(position)[0] != Opcode.HEADER:
            definitions_read = True
            yield from self._definitions()  # they may be in the damaged start
        while position < self._size:
            opcode, length = self._record_header(position)
            end = position + _HEADER.size + length
            content = self._read(position + _HEADER.size, length) if opcode else b""
            has_chunks |= opcode == Opcode.CHUNK
            if has_chunks and opcode == Opcode.MESSAGE and _is_message_index(content):
                # An index that lost a bit: in a file with chunks, all messages are inside chunks.
                opcode = Opcode.MESSAGE_INDEX
                self.lost_bytes += 1
            try:
                # All records of a chunk are checked before any of them is used.
                records = list(parse_record(opcode, content))
            except CompressionError as error:
                raise BagError(f"cannot read bag {self._name}: {error}") from None
            except BagError:
                if not opcode and (skipped := self._after_private_records(position)):
                    checksum = zlib.crc32(self._read(position, skipped - position), checksum)
                    position = skipped
                    continue
                follows = bool(opcode and self._is_record(end))
                intact = end if follows else self._next_intact(position + 1)
                self.lost_bytes += intact - position
                position = intact
                if not definitions_read:
                    definitions_read = True
                    yield from self._definitions()  # they may be in the damaged part
                continue
            if opcode == Opcode.DATA_END:
                self._check_end(end, checksum, _CRC.unpack(content)[0])
                return
            yield from records
            if opcode == Opcode.FOOTER:
                return
            if not self.lost_bytes:
                checksum = zlib.crc32(content, zlib.crc32(_HEADER.pack(opcode, length), checksum))
            position = end

    def _begin_behind_damage(self) -> int:
        """Start of the records in a file that does not begin as an MCAP file; its end if none."""
        if self._has_header(len(MAGIC)):
            return len(MAGIC)
        ends_as_mcap = self._read(max(0, self._size - len(MAGIC)), len(MAGIC)) == MAGIC
        intact = self._next_intact(0, self._size if ends_as_mcap else _MAX_HEAD)
        place = self._read(0, _SEARCH_SIZE).find(MAGIC, 0, intact)  # other bytes came before it
        header = place + len(MAGIC)
        return header if place > 0 and self._has_header(header) else intact

    def _has_header(self, position: int) -> bool:
        """Whether the record here is a header, and another record follows it."""
        opcode, length = self._record_header(position)
        begin = position + _HEADER.size
        return (
            opcode == Opcode.HEADER
            and bool(self._record_header(begin + length)[0])
            and _is_whole(opcode, self._read(begin, length))
        )

    def _record_header(self, position: int) -> tuple[int, int]:
        """Opcode and length of a record; opcode 0 if no record of a known kind fits there."""
        header = self._read(position, _HEADER.size)
        if len(header) < _HEADER.size:
            return 0, 0
        opcode, length = _HEADER.unpack(header)
        fits = length <= self._size - position - _HEADER.size
        return (opcode, length) if fits and opcode <= Opcode.DATA_END else (0, 0)

    def _is_record(self, position: int) -> bool:
        """Whether a record seems to begin here, also a private one."""
        return bool(self._record_header(position)[0] or self._after_private_records(position))

    def _after_private_records(self, position: int) -> int:
        """End of the private records that begin here; 0 if there are none.

        A record whose opcode is damaged may look like a private one. So an intact record must
        follow, and no private record may have the content of a chunk, or of the kind of record
        whose opcode differs in one bit.
        """
        start = position
        while True:
            header = self._read(position, _HEADER.size)
            if len(header) < _HEADER.size:
                return 0
            opcode, length = _HEADER.unpack(header)
            if opcode < _PRIVATE:
                return position if position > start and self._parses(position, opcode) else 0
            end = position + _HEADER.size + length
            if end > self._size or any(
                self._parses(position, kind) for kind in (opcode ^ _PRIVATE, Opcode.CHUNK)
            ):
                return 0
            position = end

    def _parses(self, position: int, kind: int) -> bool:
        """Whether the record that begins here has intact content of a kind before the index."""
        _, length = _HEADER.unpack(self._read(position, _HEADER.size))
        begin = position + _HEADER.size
        if kind not in _BEFORE_INDEX or length > self._size - begin:
            return False
        if kind == Opcode.CHUNK and not _is_chunk_start(self._read(begin, 48), length):
            return False
        return _is_whole(kind, self._read(begin, length))

    def _read(self, position: int, length: int) -> bytes:
        self._stream.seek(position)
        return self._stream.read(length)

    def _next_intact(self, position: int, limit: int | None = None) -> int:
        """Start of the next intact record before `limit`; the file's end if there is none."""
        while position < (self._size if limit is None else min(limit, self._size)):
            window = self._read(position, _SEARCH_SIZE + _HEADER.size)
            for match in _RECORD_START.finditer(window):
                if match.start() < _SEARCH_SIZE and self._is_intact(position + match.start()):
                    return position + match.start()
            position += _SEARCH_SIZE
        return self._size

    def _is_intact(self, position: int) -> bool:
        opcode, length = self._record_header(position)
        begin = position + _HEADER.size
        end = begin + length
        if opcode == Opcode.FOOTER:
            return self._is_at_end(position) and length == _FOOTER.size - _HEADER.size
        if opcode == Opcode.DATA_END:
            summary = self._summary_section()
            return summary is not None and summary[0] == end
        if opcode == Opcode.METADATA and self._read(begin, _CRC.size) == bytes(_CRC.size):
            return False  # without a name
        whole = bool(opcode) and self._parses(position, opcode)
        return whole and (end == self._size or self._is_record(end))

    def _is_at_end(self, position: int) -> bool:
        """Whether a footer at this position ends the file."""
        return position + _FOOTER.size + len(MAGIC) == self._size and (
            self._read(self._size - len(MAGIC), len(MAGIC)) == MAGIC
        )

    def _check_end(self, position: int, checksum: int, expected: int) -> None:
        """Check the index after the data, and the checksum of the data."""
        if not self.lost_bytes and expected and checksum != expected:
            self.lost_bytes = 1
        summary = self._summary_section()
        if summary is None or summary[0] != position:
            self.lost_bytes += self._size - position
        self.complete = not self.lost_bytes

    def _summary_section(self) -> tuple[int, bytes] | None:
        """Start of the index at the end, and its bytes; None if the index is damaged."""
        place = max(0, self._size - len(MAGIC) - _FOOTER.size)
        footer = self._read(place, _FOOTER.size)
        if len(footer) < _FOOTER.size or not self._is_at_end(place):
            return None
        opcode, length, start, _, expected = _FOOTER.unpack(footer)
        if opcode != Opcode.FOOTER or length != _FOOTER.size - _HEADER.size:
            return None
        if not start:
            return place, b""
        for begin in (start, *self._possible_summaries(place)):  # it may have moved
            content = self._read(begin, place - begin) if begin <= place else b""
            if expected and zlib.crc32(footer[: -_CRC.size], zlib.crc32(content)) == expected:
                return begin, content
            if not expected and begin == start:
                return begin, content
        return None

    def _possible_summaries(self, place: int) -> Iterator[int]:
        """Possible starts of the index: ends of data that are found before a footer."""
        begin = max(0, place - _SEARCH_SIZE)
        for match in re.finditer(_DATA_END, self._read(begin, place - begin)):
            yield begin + match.end() + _CRC.size

    def _definitions(self) -> list[Record]:
        """Schemas and channels, which are repeated at the end of the file."""
        summary = self._summary_section()
        definitions: list[Record] = []
        for opcode, body in _split_records(summary[1]) if summary else ():
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                definitions += parse_record(opcode, body)
        return definitions


def parse_record(opcode: int, body: bytes) -> Iterator[Record]:
    """A record; if it is a chunk, first the records in it.

    Raises:
        BagError: if the record is damaged.
    """
    if opcode == Opcode.CHUNK:
        for inner, content in _split_records(_chunk_content(body)):
            if inner not in _IN_CHUNK:
                raise BagError(f"damaged chunk: a record of kind {inner} in it")
            if inner == Opcode.MESSAGE and len(content) >= _MESSAGE.size:
                yield inner, content  # most records are messages: no generator for each
            else:
                yield from parse_record(inner, content)
        yield opcode, body
    elif opcode in _CHECKS and not _CHECKS[opcode](body):
        raise BagError(f"damaged record of kind {opcode} with {len(body)} bytes")
    else:
        yield opcode, _parse(_PARSED_KINDS[opcode], body) if opcode in _PARSED_KINDS else body


def _is_whole(opcode: int, body: bytes) -> bool:
    """Whether bytes are intact content of a kind of record, as far as it can be read here."""
    try:
        list(parse_record(opcode, body))
    except CompressionError:
        return True
    except BagError:
        return False
    return True


def _is_message_index(body: bytes) -> bool:
    return len(body) >= 6 and _CRC.unpack_from(body, 2)[0] == len(body) - 6


def _is_attachment(body: bytes) -> bool:
    return len(body) >= 4 and _CRC.unpack(body[-4:])[0] in (0, zlib.crc32(body[:-4]))


_CHECKS: dict[int, Callable[[bytes], bool]] = {
    0: lambda body: False,
    Opcode.FOOTER: lambda body: len(body) == _FOOTER.size - _HEADER.size,
    Opcode.MESSAGE: lambda body: len(body) >= _MESSAGE.size,
    Opcode.MESSAGE_INDEX: _is_message_index,
    Opcode.ATTACHMENT: _is_attachment,
    Opcode.DATA_END: lambda body: len(body) == _CRC.size,
}
"""Whether the content of a record can be one of its kind, by opcode."""


def _parse(kind: Any, body: bytes) -> Any:
    stream = BytesIO(body)
    try:
        record = kind.read(ReadDataStream(stream))
    except (McapError, struct.error, UnicodeDecodeError, ValueError) as error:
        raise BagError(f"damaged record: {error}") from None
    if stream.tell() != len(body):
        raise BagError(f"damaged record: {len(body) - stream.tell()} bytes too many")
    return record


def _split_records(content: bytes) -> Iterator[Record]:
    """The records within the content of a chunk.

    Raises:
        BagError: if the last one is incomplete.
    """
    position, size = 0, len(content)
    while position < size:
        if position + _HEADER.size > size:
            raise BagError("damaged chunk: it breaks off")
        opcode, length = _HEADER.unpack_from(content, position)
        position += _HEADER.size
        if length > size - position:
            raise BagError("damaged chunk: it breaks off")
        yield opcode, content[position : position + length]
        position += length


def _is_chunk_start(start: bytes, length: int) -> bool:
    """Whether the first bytes of a chunk agree with its length, before it is read."""
    if len(start) < 48:
        return False
    (name_length,) = _CRC.unpack_from(start, 28)
    if name_length > 4:
        return False
    (size,) = struct.unpack_from("<Q", start, 32 + name_length)
    return bool(size == length - 40 - name_length)


def _chunk_content(body: bytes) -> bytes:
    """The content of a chunk record, decompressed.

    Raises:
        BagError: if the chunk is damaged or its compression is unknown.
    """
    chunk = _parse(mcap.records.Chunk, body)
    if chunk.uncompressed_size > _MAX_UNCHECKED + _MAX_RATIO * len(body):
        raise BagError(f"damaged chunk: {len(body)} bytes for {chunk.uncompressed_size}")
    content = _decompress(chunk.compression, chunk.data, chunk.uncompressed_size)
    if len(content) != chunk.uncompressed_size:
        raise BagError("damaged chunk: its size differs")
    if chunk.uncompressed_crc and zlib.crc32(content) != chunk.uncompressed_crc:
        raise BagError("damaged chunk: its checksum differs")
    return content


def _decompress(compression: str, data: bytes, size: int) -> bytes:
    if compression == "":
        return data
    if compression == "zstd":
        try:
            if zstandard.frame_content_size(data) == size:
                return zstandard.decompress(data, size)
            return zstandard.ZstdDecompressor().stream_reader(data).read(size)  # never more
        except zstandard.ZstdError as error:
            raise BagError(f"damaged chunk: {error}") from None
    if compression == "lz4":
        return _decompress_lz4(data, size)
    raise BagError(f"chunk in unknown compression {compression}")


def _decompress_lz4(data: bytes, size: int) -> bytes:
    try:
        import lz4.frame  # no dependency of ours
    except ImportError:
        raise CompressionError(
            "its chunks are compressed by lz4, for which the Python package lz4 is not installed: "
            "pip install lz4==4.4.5"
        ) from None
    frame = lz4.frame.LZ4FrameDecompressor()
    try:
        content = bytes(frame.decompress(data, size + 1))  # no more, however much there is
    except (RuntimeError, EOFError) as error:
        raise BagError(f"damaged chunk: {error}") from None
    if not frame.eof:
        raise BagError("damaged chunk: its size differs")
    return content


def parse_message(body: bytes) -> tuple[int, int, int, int, bytes]:
    """Channel, sequence number, log time, publish time (ns) and data of a message record."""
    return *_MESSAGE.unpack_from(body), body[_MESSAGE.size :]
