"""Messages of one type as a structured array, and their time."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]
Rows = npt.NDArray[Any]
"""Structured array of a message type: `rows["q"]` has the shape (n, 20)."""


def stamps(rows: Rows) -> FloatArray:
    """Robot time of each row. Shape (n,), in s."""
    return rows["sec"].astype(np.float64) + rows["nanosec"] * 1e-9


def stamps_ns(rows: Rows) -> IntArray:
    """Robot time of each row. Shape (n,), in ns."""
    return rows["sec"].astype(np.int64) * 1_000_000_000 + rows["nanosec"].astype(np.int64)


def where(rows: Rows, flags: BoolArray) -> Rows:
    """Rows whose flag is set; the array itself, not a copy, if all flags are set."""
    return rows if flags.all() else rows[flags]


def tick_keys(rows: Rows) -> npt.NDArray[np.uint64]:
    """Episode and `seq` of each row as one number, which rises with both. Shape (n,)."""
    key: npt.NDArray[np.uint64] = rows["episode"].astype(np.uint64) << np.uint64(40)
    return key | rows["seq"].astype(np.uint64)


def runs(values: npt.NDArray[Any]) -> Iterator[tuple[int, int]]:
    """Start and end (exclusive) of each run of equal values."""
    if len(values):
        edges = np.flatnonzero(values[1:] != values[:-1]) + 1
        yield from pairwise([0, *edges.tolist(), len(values)])
