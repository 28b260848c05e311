"""Standard messages as bytes, without message objects: odometry, IMU, transforms and text.

To fill and serialize such a message costs 60 us in Python. As long as the names of its frames
do not change, its serialized form is a fixed table of offsets, as for the control lane (see
`cassie_msgs.sample`). A `Writer` has the bytes, in which only stamp and numbers change. `read_rows`
gives many messages as one structured array.

Source:
    OMG DDS-XTypes 1.3, 7.4.3 (plain CDR, XCDR1), as for `cassie_msgs.sample`.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from cassie_msgs.sample import ENCAPSULATION, LayoutError

FloatArray = npt.NDArray[np.float64]

_STAMP = struct.Struct("<iI")
_LENGTH = struct.Struct("<I")
_POSE = struct.Struct("<7d")


@dataclass(frozen=True)
class Kind:
    """A message that consists of a std_msgs/Header, further names, and doubles.

    Attributes:
        type: ROS name of the message type.
        names: Number of names: the header's frame, and those after it.
        doubles: Number of doubles.
        fields: Index of the first double and number of doubles of each field, by name.
    """

    type: str
    names: int
    doubles: int
    fields: Mapping[str, tuple[int, int]]

    def __hash__(self) -> int:
        return hash(self.type)

    @property
    def field_names(self) -> tuple[str, ...]:
        """Names of the fields of `read_rows`."""
        return ("sec", "nanosec", *self.fields)


ODOMETRY = Kind(
    "nav_msgs/msg/Odometry",
    2,
    7 + 36 + 6 + 36,
    {"position": (0, 3), "orientation": (3, 4), "linear": (43, 3), "angular": (46, 3)},
)
"""Pose and twist with their covariances; the orientation as x, y, z, w."""

IMU = Kind("sensor_msgs/msg/Imu", 1, 4 + 9 + 12 + 12, {"angular": (13, 3), "force": (25, 3)})
"""Orientation, angular velocity and specific force with their covariances."""


class Writer:
    """One message, to be written many times.

    Args:
        kind: Kind of the message.
        frames: Names in the message.

    Attributes:
        figures: Doubles of the message, to be written in place. Shape (kind.doubles,).
    """

    def __init__(self, kind: Kind, *frames: str) -> None:
        head = bytes(_STAMP.size)
        for frame in frames:
            raw = frame.encode() + b"\0"
            head += bytes(-len(head) % 4) + _LENGTH.pack(len(raw)) + raw
        head += bytes(-len(head) % 8)  # the doubles begin at a multiple of eight
        body = np.zeros(len(head) // 8 + kind.doubles)
        body.view(np.uint8)[: len(head)] = np.frombuffer(head, np.uint8)
        self._body, self._stamp = body, body.data.cast("B")
        self.figures: FloatArray = body[len(head) // 8 :]

    def to_bytes(self, stamp_ns: int) -> bytes:
        """The serialized message with this stamp, in ns."""
        _STAMP.pack_into(self._stamp, 0, *divmod(stamp_ns, 1_000_000_000))
        return ENCAPSULATION + self._body.tobytes()


def layout(kind: Kind, raw: bytes) -> np.dtype[Any]:
    """Structured type of one serialized message: sec, nanosec and the fields of its kind.

    Raises:
        LayoutError: if `raw` is too short for this kind.
    """
    end = len(ENCAPSULATION) + _STAMP.size
    try:
        for _ in range(kind.names):
            end += -end % 4
            (length,) = _LENGTH.unpack_from(raw, end)
            end += _LENGTH.size + int(length)
    except struct.error:
        raise LayoutError(f"{len(raw)} bytes are no {kind.type}") from None
    start = end + (len(ENCAPSULATION) - end) % 8
    size = start + 8 * kind.doubles
    if len(raw) < size:
        raise LayoutError(f"{len(raw)} bytes are no {kind.type} of {size} bytes")
    return _layout(kind, start)


@cache
def _layout(kind: Kind, start: int) -> np.dtype[Any]:
    formats: list[Any] = ["<i4", "<u4", *(("<f8", count) for _, count in kind.fields.values())]
    offsets = [4, 8, *(start + 8 * first for first, _ in kind.fields.values())]
    return np.dtype(
        {
            "names": kind.field_names,
            "formats": formats,
            "offsets": offsets,
            "itemsize": start + 8 * kind.doubles,
        }
    )


def read_rows(kind: Kind, messages: Sequence[bytes]) -> npt.NDArray[Any]:
    """Many serialized messages as one structured array.

    Raises:
        LayoutError: if a message is not of this kind, or their names differ in length.
    """
    if not messages:
        return np.zeros(0, _layout(kind, 16))
    dtype = layout(kind, messages[0])
    if any(not 0 <= len(raw) - dtype.itemsize <= 3 for raw in messages):
        raise LayoutError(f"messages of {kind.type} differ in length")
    return np.frombuffer(b"".join(raw[: dtype.itemsize] for raw in messages), dtype)


class TransformWriter:
    """A tf2_msgs/TFMessage, to be written many times.

    Args:
        frames: Parent and child frame of each transform.
    """

    TYPE = "tf2_msgs/msg/TFMessage"

    def __init__(self, frames: Sequence[tuple[str, str]]) -> None:
        body, stamps, poses = bytearray(_LENGTH.pack(len(frames))), [], []
        for pair in frames:
            stamps.append((len(body) // 4, len(body) // 4 + 1))
            body += bytes(_STAMP.size)
            for frame in pair:
                name = frame.encode() + b"\0"
                body += bytes(-len(body) % 4) + _LENGTH.pack(len(name)) + name
            body += bytes(-len(body) % 8)
            poses.append(range(len(body) // 8, len(body) // 8 + 7))
            body += bytes(_POSE.size)
        self._body = body
        self._words = np.frombuffer(body, np.int32)
        self._doubles = np.frombuffer(body, np.float64, count=len(body) // 8)
        self._stamps = np.array(stamps, np.intp).reshape(-1, 2)
        self._poses = np.array(poses, np.intp).reshape(-1, 7)

    def to_bytes(self, stamp_ns: int, poses: FloatArray) -> bytes:
        """The serialized message.

        Args:
            stamp_ns: Stamp of each transform. In ns.
            poses: x, y, z in m and quaternion x, y, z, w of each transform. Shape (n, 7).
        """
        self._words[self._stamps] = divmod(stamp_ns, 1_000_000_000)
        self._doubles[self._poses] = poses
        return ENCAPSULATION + bytes(self._body)


def text_message(text: str) -> bytes:
    """A serialized std_msgs/String."""
    raw = text.encode() + b"\0"
    return ENCAPSULATION + _LENGTH.pack(len(raw)) + raw


def read_transforms(raw: bytes) -> dict[str, tuple[float, ...]]:
    """Poses in a serialized tf2_msgs/TFMessage: x, y, z in m, quaternion x, y, z, w, by frame.

    Raises:
        LayoutError: if `raw` is no such message.
    """
    poses: dict[str, tuple[float, ...]] = {}
    start = len(ENCAPSULATION)  # CDR aligns from here
    try:
        (count,) = _LENGTH.unpack_from(raw, start)
        end = _LENGTH.size
        for _ in range(count):
            end += -end % 4 + _STAMP.size
            for _ in ("frame", "child frame"):
                end += -end % 4
                (length,) = _LENGTH.unpack_from(raw, start + end)
                name, end = end + _LENGTH.size, end + _LENGTH.size + int(length)
            child = raw[start + name : start + end - 1].decode()
            end += -end % 8
            poses[child] = _POSE.unpack_from(raw, start + end)
            end += _POSE.size
    except (struct.error, UnicodeDecodeError):
        raise LayoutError(f"{len(raw)} bytes are no tf2_msgs/msg/TFMessage") from None
    return poses
