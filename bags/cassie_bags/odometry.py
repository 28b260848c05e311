"""Reading serialized nav_msgs/Odometry without message objects.

Within a bag its frames' names do not change, so its serialized form is a fixed table of
offsets, as for the control lane (see `cassie_msgs.sample`).
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
import numpy.typing as npt

from cassie_bags.errors import BagError

TYPE = "nav_msgs/msg/Odometry"

_HEADER = 4  # encapsulation
_LARGEST = 1024  # of a message with empty names, generously


def odometry_dtype(raw: bytes) -> np.dtype[Any]:
    """Layout of one serialized odometry message; it depends on the lengths of its names.

    Args:
        raw: Serialized message.

    Returns:
        Structured type with sec, nanosec, position (x, y, z), orientation (x, y, z, w),
        linear and angular (x, y, z).

    Raises:
        BagError: if `raw` is too short to be one.
    """
    try:
        end = _string_end(raw, _HEADER + 8)
        end = _string_end(raw, -(-(end - _HEADER) // 4) * 4 + _HEADER)
    except struct.error:
        raise BagError(f"{len(raw)} bytes are no {TYPE}") from None
    pose = -(-(end - _HEADER) // 8) * 8 + _HEADER
    twist = pose + 8 * (7 + 36)
    size = twist + 8 * (6 + 36)
    if len(raw) < size:
        raise BagError(f"{len(raw)} bytes are no {TYPE} of {size} bytes")
    return np.dtype(
        {
            "names": ["sec", "nanosec", "position", "orientation", "linear", "angular"],
            "formats": ["<i4", "<u4", ("<f8", 3), ("<f8", 4), ("<f8", 3), ("<f8", 3)],
            "offsets": [4, 8, pose, pose + 24, twist, twist + 24],
            "itemsize": size,
        }
    )


def read_odometry(messages: list[bytes]) -> npt.NDArray[Any]:
    """Many serialized odometry messages as one structured array.

    Raises:
        BagError: if they do not all have the same frame names' lengths.
    """
    if not messages:
        return np.zeros(0, odometry_dtype(_HEADER * b"\0" + bytes(_LARGEST)))
    dtype = odometry_dtype(messages[0])
    if any(not 0 <= len(raw) - dtype.itemsize <= 3 for raw in messages):
        raise BagError(f"messages of {TYPE} differ in length")
    return np.frombuffer(b"".join(raw[: dtype.itemsize] for raw in messages), dtype)


def _string_end(raw: bytes, start: int) -> int:
    (length,) = struct.unpack_from("<I", raw, start)
    return start + 4 + int(length)
