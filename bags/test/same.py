"""Whether two runs are the same, for tests."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cassie_bags.bag.continuity import first_occurrences
from cassie_bags.bag.recording import GAIT_TOPICS, LANE_TOPICS, Recording
from cassie_bags.bag.rows import Rows, stamps_ns


def differences(one: Recording, other: Recording, topics: tuple[str, ...]) -> list[str]:
    """Where two runs of one file differ, compared bit for bit; one line per topic.

    Repeats are left out, and the number of the episode, which tells runs apart.

    Args:
        one: A run.
        other: Another run.
        topics: Some of `recording.KNOWN_TYPES`.
    """
    found = []
    for topic in topics:
        a, b = (_without_repeats(recording, topic) for recording in (one, other))
        if len(a) != len(b):
            alone = np.setxor1d(stamps_ns(a), stamps_ns(b)) * 1e-9
            where = f", {len(alone)} of one alone at {alone[0]:.3f} .. {alone[-1]:.3f} s"
            found.append(f"{topic}: {len(a)} samples against {len(b)}{where if len(alone) else ''}")
            continue
        equal = _comparable(a) == _comparable(b)
        if not equal.all():
            first = int(np.argmin(equal))
            found.append(f"{topic}: {int((~equal).sum())} of {len(a)} differ, first sample {first}")
    return found


def _without_repeats(recording: Recording, topic: str) -> Rows:
    if topic in LANE_TOPICS:
        return first_occurrences(recording.lane[topic])
    if topic in GAIT_TOPICS:
        return first_occurrences(recording.gaits[topic])
    rows = recording.stamped[topic]
    return rows[np.unique(stamps_ns(rows), return_index=True)[1]]


def _comparable(rows: Rows) -> npt.NDArray[np.object_]:
    """Each sample's fields as bytes, without padding and episode."""
    packed = np.zeros(len(rows), _packed(rows.dtype))
    for name in packed.dtype.names or ():
        if name != "episode":
            packed[name] = rows[name]
    return np.array([row.tobytes() for row in packed], dtype=object)


def _packed(dtype: np.dtype[np.void]) -> np.dtype[np.void]:
    """The same fields without gaps between them."""
    names = dtype.names or ()
    return np.dtype([(name, dtype[name].base, dtype[name].shape) for name in names])
