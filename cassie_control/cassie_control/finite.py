"""Whether the numbers of a message are finite and of a reasonable size."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from cassie_gaits.errors import CassieError
from cassie_msgs.layout import Sample

LARGEST = 1e6
"""Magnitude, in any unit, beyond which no field of a message makes sense.

Such a value would pass a test for being finite, and overflow later.
"""


def fault(sample: Sample, unused: Collection[str] = ()) -> str:
    """What is wrong with a message's numbers; empty if nothing is.

    Args:
        sample: The message.
        unused: Fields that are not checked, as no law uses them.

    Returns:
        Words that name the first bad field, its value and what is expected.
    """
    if _is_small(sample):
        return ""
    for name, kind, count in sample.LAYOUT:
        if kind is not np.float64 or name in unused:
            continue
        values = np.atleast_1d(getattr(sample, name))
        bad = np.flatnonzero(~(np.abs(values) <= LARGEST))
        if bad.size:
            value = values[bad[0]]
            where = name if count == 1 else f"{name}[{bad[0]}]"
            wanted = f"within ±{LARGEST:g}" if np.isfinite(value) else "finite"
            return f"{where} is {value:g}, must be {wanted}"
    return ""


def check(
    sample: Sample, what: str, error: type[CassieError], unused: Collection[str] = ()
) -> None:
    """Refuse a message with a bad number, as found by `fault`.

    Raises:
        error: if a number is bad; names `what`, the field, its value and what is expected.
    """
    if _is_small(sample):
        return
    problem = fault(sample, unused)
    if problem:
        raise error(f"{what} {problem}")


def _is_small(sample: Sample) -> bool:
    """Whether all numbers are good for certain; if not, each field has to be checked.

    No field exceeds the norm of all, and NaN compares false. `vdot` overflows without a warning.
    """
    floats = sample.floats
    return bool(np.vdot(floats, floats) <= LARGEST * LARGEST)
