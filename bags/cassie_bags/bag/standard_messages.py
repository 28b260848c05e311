"""Odometry and IMU messages of a bag as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy.typing as npt

from cassie_bags.errors import BagError
from cassie_msgs.sample import LayoutError
from cassie_msgs.standard_messages import IMU, ODOMETRY, Kind, read_rows


def read_odometry(messages: Sequence[bytes]) -> npt.NDArray[Any]:
    """Odometry: sec, nanosec, position, orientation (x, y, z, w), linear, angular.

    Raises:
        BagError: if a message is of another type, or the names of the frames differ in length.
    """
    return _read(ODOMETRY, messages)


def read_imu(messages: Sequence[bytes]) -> npt.NDArray[Any]:
    """IMU messages: sec, nanosec, angular (velocity) and (specific) force.

    Raises:
        BagError: if a message is of another type, or the names of the frames differ in length.
    """
    return _read(IMU, messages)


def _read(kind: Kind, messages: Sequence[bytes]) -> npt.NDArray[Any]:
    try:
        return read_rows(kind, messages)
    except LayoutError as error:
        raise BagError(str(error)) from None
