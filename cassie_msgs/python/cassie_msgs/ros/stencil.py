"""Standard messages of fixed size, as serialized bytes in which only the numbers change.

A sensor_msgs/JointState costs 25 to 45 us to fill and serialize in Python, nearly all of it
for names that never change. A `Stencil` serializes such a message once, finds the offsets of the
numbers, and writes new ones there.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import reduce
from typing import Any

from rclpy.serialization import serialize_message

_STAMP = struct.Struct("<iI")
_STAMP_OFFSET = 4  # after the encapsulation header: every message here begins with its header
_MARK = 1.2345678901234567e-289  # no value of a robot, and its bytes are in no text


class Stencil:
    """Serialized form of one message, into which the stamp and some numbers are written.

    Args:
        message: Any message that begins with a std_msgs/Header, with all constant content;
            sequences have their final length.
        fields: Runs of doubles to write, such as ("pose.pose.position", 3): a float, a
            sequence of floats or a message of floats, and how many doubles it holds.

    Raises:
        ValueError: if a field does not hold that many doubles.
    """

    def __init__(self, message: Any, fields: Sequence[tuple[str, int]]) -> None:
        self._runs = [
            (_offset(message, path, count), struct.Struct(f"<{count}d")) for path, count in fields
        ]
        self._bytes = bytearray(serialize_message(message))

    def fill(self, stamp_ns: int, *values: Sequence[float]) -> bytes:
        """The message with this stamp, in ns, and these numbers, a sequence for each field."""
        raw = self._bytes
        _STAMP.pack_into(raw, _STAMP_OFFSET, *divmod(stamp_ns, 1_000_000_000))
        for (offset, run), figures in zip(self._runs, values, strict=True):
            run.pack_into(raw, offset, *figures)
        return bytes(raw)


def _offset(message: Any, path: str, count: int) -> int:
    """Offset of the doubles of a field, found by writing a mark into them."""
    *parents, name = path.split(".")
    owner = reduce(getattr, parents, message)
    value = getattr(owner, name)
    marks = [_MARK * (1.0 + index) for index in range(count)]
    if hasattr(value, "get_fields_and_field_types"):
        names = list(value.get_fields_and_field_types())
        kept = [getattr(value, entry) for entry in names]
        for entry, mark in zip(names, marks, strict=True):
            setattr(value, entry, mark)
        raw = serialize_message(message)
        for entry, old in zip(names, kept, strict=True):
            setattr(value, entry, old)
    else:
        scalar = isinstance(value, float)
        setattr(owner, name, marks[0] if scalar else marks)
        raw = serialize_message(message)
        setattr(owner, name, value)
    offset = raw.find(struct.pack(f"<{count}d", *marks))
    if offset < 0:
        raise ValueError(f"{path} of {type(message).__name__} does not hold {count} doubles")
    return int(offset)
