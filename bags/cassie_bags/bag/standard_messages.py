"""Reading serialized nav_msgs/Odometry and sensor_msgs/Imu without message objects.

Within a bag their frames' names do not change, so their serialized form is a fixed table of
offsets, as for the control lane (see `cassie_msgs.sample`).
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from cassie_bags.errors import BagError

TYPE = "nav_msgs/msg/Odometry"
IMU_TYPE = "sensor_msgs/msg/Imu"

ODOMETRY_FIELDS = ("sec", "nanosec", "position", "orientation", "linear", "angular")
IMU_FIELDS = ("sec", "nanosec", "angular", "force")

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
            "names": ODOMETRY_FIELDS,
            "formats": ["<i4", "<u4", ("<f8", 3), ("<f8", 4), ("<f8", 3), ("<f8", 3)],
            "offsets": [4, 8, pose, pose + 24, twist, twist + 24],
            "itemsize": size,
        }
    )


def imu_dtype(raw: bytes) -> np.dtype[Any]:
    """Layout of one serialized IMU message; it depends on the length of its name.

    Returns:
        Structured type with sec, nanosec, angular (x, y, z) and force (x, y, z).

    Raises:
        BagError: if `raw` is too short to be one.
    """
    try:
        end = _string_end(raw, _HEADER + 8)
    except struct.error:
        raise BagError(f"{len(raw)} bytes are no {IMU_TYPE}") from None
    angular = -(-(end - _HEADER) // 8) * 8 + _HEADER + 8 * (4 + 9)
    force = angular + 8 * (3 + 9)
    size = force + 8 * (3 + 9)
    if len(raw) < size:
        raise BagError(f"{len(raw)} bytes are no {IMU_TYPE} of {size} bytes")
    return np.dtype(
        {
            "names": IMU_FIELDS,
            "formats": ["<i4", "<u4", ("<f8", 3), ("<f8", 3)],
            "offsets": [4, 8, angular, force],
            "itemsize": size,
        }
    )


def read_odometry(messages: list[bytes]) -> npt.NDArray[Any]:
    """Many serialized odometry messages as one structured array.

    Raises:
        BagError: if they do not all have the same frame names' lengths.
    """
    return _rows(messages, odometry_dtype, TYPE)


def read_imu(messages: list[bytes]) -> npt.NDArray[Any]:
    """Many serialized IMU messages as one structured array.

    Raises:
        BagError: if they do not all have the same frame name's length.
    """
    return _rows(messages, imu_dtype, IMU_TYPE)


def _rows(
    messages: list[bytes], layout: Callable[[bytes], np.dtype[Any]], name: str
) -> npt.NDArray[Any]:
    if not messages:
        return np.zeros(0, layout(_HEADER * b"\0" + bytes(_LARGEST)))
    dtype = layout(messages[0])
    if any(not 0 <= len(raw) - dtype.itemsize <= 3 for raw in messages):
        raise BagError(f"messages of {name} differ in length")
    return np.frombuffer(b"".join(raw[: dtype.itemsize] for raw in messages), dtype)


def _string_end(raw: bytes, start: int) -> int:
    (length,) = struct.unpack_from("<I", raw, start)
    return start + 4 + int(length)
