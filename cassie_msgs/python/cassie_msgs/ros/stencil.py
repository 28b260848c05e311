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

import numpy as np
import numpy.typing as npt
from rclpy.serialization import serialize_message

_STAMP = struct.Struct("<iI")
_STAMP_OFFSET = 4  # after the encapsulation header: every message here begins with its header
_MARK = 1.2345678901234567e-289  # no value of a robot, and its bytes are in no text
_SECONDS_MARK = -2_012_345_678  # no stamp of a robot, and its bytes are in no text


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


class TransformStencil:
    """Serialized tf2_msgs/TFMessage, into which one stamp and all transforms are written.

    Args:
        message: The message with its frames, which are constant.
    """

    def __init__(self, message: Any) -> None:
        count = len(message.transforms)
        marks = _MARK * (1.0 + np.arange(7.0 * count)).reshape(count, 7)
        for index, entry in enumerate(message.transforms):
            entry.header.stamp.sec = _SECONDS_MARK + index
            t, r = entry.transform.translation, entry.transform.rotation
            t.x, t.y, t.z, r.x, r.y, r.z, r.w = marks[index].tolist()
        self._bytes = bytearray(serialize_message(message))
        # After the encapsulation header, CDR aligns each number with its size.
        words = np.frombuffer(self._bytes, np.int32, offset=4, count=(len(self._bytes) - 4) // 4)
        doubles = words[: len(words) // 2 * 2].view(np.float64)
        self._words, self._doubles = words, doubles
        stamps = np.array([_place(words, _SECONDS_MARK + index) for index in range(count)])
        self._stamps = np.column_stack([stamps, stamps + 1])
        self._transforms = np.array([[_place(doubles, mark) for mark in row] for row in marks])

    def fill(self, stamp_ns: int, poses: npt.NDArray[np.float64]) -> bytes:
        """The message with this stamp, in ns, in every header.

        Args:
            stamp_ns: Stamp. In ns.
            poses: x, y, z in m and quaternion x, y, z, w of each transform. Shape (n, 7).
        """
        self._words[self._stamps] = divmod(stamp_ns, 1_000_000_000)
        self._doubles[self._transforms] = poses
        return bytes(self._bytes)


def _place(numbers: npt.NDArray[Any], mark: float) -> int:
    (place,) = np.flatnonzero(numbers == mark)
    return int(place)


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
