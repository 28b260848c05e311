"""A message as its CDR bytes, with numpy views of each field.

A ROS message object costs 15 to 40 us to fill, serialize and read in Python. Every
message of the control lane has a fixed size, so its serialized form is a fixed table
of offsets: a `Sample` holds that form and hands out views into it. Publishing is then
`publisher.publish(sample.to_bytes())`, receiving is `sample.load(raw)`.

Source:
    OMG DDS-XTypes 1.3, 7.4.3 (plain CDR, XCDR1): four bytes of encapsulation header,
    then each primitive aligned to its own size, counted from the end of that header.
"""

from __future__ import annotations

import struct
from functools import cache
from typing import Any, ClassVar, TypeVar

import numpy as np
import numpy.typing as npt

Field = tuple[str, type[np.generic], int]

ENCAPSULATION = b"\x00\x01\x00\x00"  # plain CDR, little endian, no options
_PLAIN, _LITTLE_ENDIAN = ENCAPSULATION[:2]
_HEADER = struct.Struct("<4xiII4xQ")
HEADER_SIZE = _HEADER.size
"""Size of the fields that begin every message of the control lane. In bytes."""

_PLACE = struct.Struct("<12xI4xQ")
_STAMP = struct.Struct("<iI")
_STAMP_OFFSET = 4
PADDING = 3
"""Most bytes behind a message: RTPS pads a payload to a multiple of four bytes."""

_COMMON: tuple[Field, ...] = (
    ("sec", np.int32, 1),
    ("nanosec", np.uint32, 1),
    ("episode", np.uint32, 1),
    ("seq", np.uint64, 1),
)

SampleT = TypeVar("SampleT", bound="Sample")


class LayoutError(ValueError):
    """Received bytes do not fit the expected message type."""


def header(raw: bytes | memoryview) -> tuple[int, int, int, int]:
    """Stamp, episode and seq of any control-lane message, without loading it.

    Args:
        raw: Serialized message, at least 28 bytes.

    Returns:
        (sec, nanosec, episode, seq).

    Raises:
        LayoutError: if `raw` is shorter.
    """
    if len(raw) < _HEADER.size:
        raise LayoutError(f"{len(raw)} bytes are too few for a header of {_HEADER.size} bytes")
    sec, nanosec, episode, seq = _HEADER.unpack_from(raw)
    return sec, nanosec, episode, seq


def place(raw: bytes | memoryview) -> tuple[int, int]:
    """Episode and seq of a control-lane message of at least 28 bytes."""
    episode, seq = _PLACE.unpack_from(raw)
    return episode, seq


class Sample:
    """One message as its CDR bytes; each field is a numpy view into them.

    Fields are written in place: `sample.q[:] = q`, `sample.phase[...] = 0.5`. Scalars
    are 0-d views (`float(sample.phase)`, `int(sample.seq)`). A fresh sample is all zero,
    and so are its four bytes of padding before `seq`, which ROS itself leaves undefined.

    Attributes:
        LAYOUT: (name, numpy type, count) of each field after the common header, in
            message order; count 1 is a scalar.
        TYPE: ROS name of the message type.
        TOPIC: Topic of the messages.
        DTYPE: Structured type of the whole serialized message, for reading bags.
        SIZE: Size of the serialized message, in bytes.
        RECORD: Structured type of the message without its encapsulation.
        address: Address of the serialized message in memory, for compiled functions.
        record: The message as an array of type `RECORD`, for compiled functions. Shape (1,).
        floats: One view of all float64 fields, which are contiguous in every message.
    """

    LAYOUT: ClassVar[tuple[Field, ...]] = ()
    TYPE: ClassVar[str]
    TOPIC: ClassVar[str]
    DTYPE: ClassVar[np.dtype[Any]]
    RECORD: ClassVar[np.dtype[Any]]
    SIZE: ClassVar[int]

    address: int
    record: npt.NDArray[np.void]
    floats: npt.NDArray[np.float64]
    episode: npt.NDArray[np.uint32]
    seq: npt.NDArray[np.uint64]

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        cls.TYPE = f"cassie_msgs/msg/{cls.__name__}"
        cls.DTYPE = _cdr_dtype(_COMMON + cls.LAYOUT, len(ENCAPSULATION))
        cls.RECORD = _cdr_dtype(_COMMON + cls.LAYOUT, 0)
        cls.SIZE = cls.DTYPE.itemsize

    def __init__(self) -> None:
        storage = np.zeros(self.SIZE + 8, np.uint8)
        start = (4 - storage.ctypes.data) % 8  # aligns the body, four bytes on, to 8 bytes
        buffer = storage[start : start + self.SIZE]
        buffer[:4] = tuple(ENCAPSULATION)
        attributes = self.__dict__  # `__setattr__` guards the fields from here on
        attributes["_memory"] = buffer.data
        attributes["address"] = buffer.ctypes.data
        attributes["record"] = buffer[len(ENCAPSULATION) :].view(self.RECORD)
        for name in self.DTYPE.names or ():
            attributes[name] = buffer.view(self.DTYPE)[name].reshape(self.DTYPE[name].shape)
        own = [name for name, kind, _ in self.LAYOUT if kind is np.float64]
        start = self.DTYPE.fields[own[0]][1] if self.DTYPE.fields and own else self.SIZE
        stop = start + 8 * sum(count for name, _, count in self.LAYOUT if name in own)
        attributes["floats"] = buffer[start:stop].view(np.float64)

    _memory: memoryview

    def __setattr__(self, name: str, value: object) -> None:
        if name in self.__dict__:
            raise AttributeError(
                f"{type(self).__name__}.{name} is a view into the message: "
                f"write sample.{name}[...] = value"
            )
        object.__setattr__(self, name, value)

    def load(self, raw: bytes | memoryview) -> None:
        """Copy a received message into this sample.

        Raises:
            LayoutError: if size or encoding of `raw` is not that of this message type.
        """
        size = self.SIZE
        if len(raw) == size and raw[0] == _PLAIN and raw[1] == _LITTLE_ENDIAN:
            self._memory[:] = raw
            return
        if not 0 <= len(raw) - size <= PADDING:
            raise LayoutError(f"{self.TYPE} has {self.SIZE} bytes, received {len(raw)}")
        if raw[:2] != ENCAPSULATION[:2]:
            raise LayoutError(
                f"{self.TYPE} in encoding {raw[:2].hex()}, expected 0001 (plain CDR, little endian)"
            )
        self._memory[:] = raw[:size]

    def to_bytes(self) -> bytes:
        """The serialized message, ready to be published."""
        return self._memory.tobytes()

    def copy_from(self: SampleT, other: SampleT) -> None:
        """Copy the content of another sample of the same type.

        Raises:
            LayoutError: if `other` is of another type.
        """
        if type(other) is not type(self):
            raise LayoutError(f"{self.TYPE} cannot take over a {other.TYPE}")
        self._memory[:] = other._memory

    def answer(self, question: Sample) -> None:
        """Copy stamp, episode and seq of the sample that this one answers."""
        self._memory[_STAMP_OFFSET : _HEADER.size] = question._memory[_STAMP_OFFSET : _HEADER.size]

    def copy_tail(self, other: Sample, first: str) -> None:
        """Copy the last fields, from `first` on, of a message that ends with the same fields.

        Raises:
            LayoutError: if the two messages differ from `first` on.
        """
        start, source = self._tail(first), other._tail(first)
        if self.SIZE - start != other.SIZE - source:
            raise LayoutError(f"{self.TYPE} and {other.TYPE} differ from {first} on")
        self._memory[start:] = other._memory[source:]

    @classmethod
    @cache
    def _tail(cls, first: str) -> int:
        """Offset of a field. In bytes."""
        return int(dict(cls.DTYPE.fields or {})[first][1])

    @property
    def place(self) -> tuple[int, int]:
        """Episode and seq."""
        return place(self._memory)

    @property
    def stamp_ns(self) -> int:
        """Stamp, in ns."""
        sec, nanosec = _STAMP.unpack_from(self._memory, _STAMP_OFFSET)
        return int(sec * 1_000_000_000 + nanosec)

    @stamp_ns.setter
    def stamp_ns(self, value: int) -> None:
        _STAMP.pack_into(self._memory, _STAMP_OFFSET, *divmod(value, 1_000_000_000))

    def __repr__(self) -> str:
        return f"{type(self).__name__}(episode={self.episode}, seq={self.seq})"


def _cdr_dtype(layout: tuple[Field, ...], first: int) -> np.dtype[Any]:
    """Structured type for the CDR form of `layout`, which begins at byte `first`."""
    names, formats, offsets = [], [], []
    end = 0  # counted from the end of the encapsulation header
    for name, scalar, count in layout:
        size = np.dtype(scalar).itemsize
        start = -(-end // size) * size
        names.append(name)
        formats.append((scalar, (count,)) if count > 1 else (scalar, ()))
        offsets.append(first + start)
        end = start + size * count
    return np.dtype(
        {"names": names, "formats": formats, "offsets": offsets, "itemsize": first + end}
    )
