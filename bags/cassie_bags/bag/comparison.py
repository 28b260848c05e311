"""Comparison of two recordings, sample by sample and bit by bit: where they first differ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from cassie_bags.bag.continuity import first_occurrences
from cassie_bags.bag.fields import entry_name
from cassie_bags.bag.recording import LANE_TOPICS, TYPES, Recording
from cassie_bags.bag.rows import Rows, stamps, stamps_ns
from cassie_msgs.layout import OperatorCommand

BoolArray = npt.NDArray[np.bool_]
Keys = npt.NDArray[np.int64]

_EPISODE_SHIFT = 40  # bits of a key for the number of a sample within its episode


@dataclass(frozen=True)
class Difference:
    """The first sample of a topic in which two recordings differ.

    Attributes:
        field: Name of the field, with the name of the component.
        tick: `seq` of the sample; the sample's key for a topic without `seq`.
        time: Robot time within the episode. In s.
        values: Values in the two recordings.
    """

    field: str
    tick: int
    time: float
    values: tuple[Any, Any]


@dataclass(frozen=True)
class TopicComparison:
    """Comparison of one topic of two recordings.

    Attributes:
        topic: Name of the topic.
        counts: Number of samples in each recording, without repeats.
        common: Number of samples that both recordings have.
        different: Number of common samples that differ.
        first: The first common sample that differs; None if there is none.
    """

    topic: str
    counts: tuple[int, int]
    common: int
    different: int
    first: Difference | None

    @property
    def same(self) -> bool:
        """Whether both recordings hold the same samples."""
        return self.counts == (self.common, self.common) and not self.different


def compare_recordings(one: Recording, other: Recording) -> list[TopicComparison]:
    """Compare every topic that is recorded in every run.

    Samples are matched by the order of their episodes and by their tick. The number of an episode
    is not compared, because it differs between runs.
    """
    return [_compare(topic, one, other) for topic in TYPES]


def _compare(topic: str, one: Recording, other: Recording) -> TopicComparison:
    (rows_a, keys_a), (rows_b, keys_b) = (_keyed(recording, topic) for recording in (one, other))
    keys, in_a, in_b = np.intersect1d(keys_a, keys_b, return_indices=True)
    a, b = rows_a[in_a], rows_b[in_b]
    names = [name for name in a.dtype.names or () if name != "episode"]
    different = int(unequal_rows(a, b, names).sum())
    first = _first(topic, a, b, names, keys)
    return TopicComparison(topic, (len(rows_a), len(rows_b)), len(keys), different, first)


def unequal_rows(a: Rows, b: Rows, names: Sequence[str]) -> BoolArray:
    """Whether two rows differ in any bit of some fields. Shape (n,)."""
    unequal = np.zeros(len(a), np.bool_)
    for name in names:
        bits = _unequal(a[name], b[name])
        unequal |= bits if bits.ndim == 1 else bits.any(axis=1)
    return unequal


def first_unequal(a: Rows, b: Rows, names: Sequence[str]) -> tuple[int, str, int] | None:
    """Row, field and entry of the first difference of some fields; None if there is none."""
    unequal = unequal_rows(a, b, names)
    if not unequal.any():
        return None
    row = int(np.argmax(unequal))
    one, other = a[row : row + 1], b[row : row + 1]  # a single truth value would lose its byte
    entries = {name: _unequal(one[name], other[name]) for name in names}
    field = next(name for name in names if entries[name].any())
    return row, field, int(np.argmax(entries[field]))


def value_at(rows: Rows, place: tuple[int, str, int]) -> float:
    """The value at a row, field and entry; a truth value that is neither 0 nor 1 as its byte."""
    row, name, entry = place
    value = np.ascontiguousarray(rows[name][row : row + 1]).ravel()[entry : entry + 1]
    byte = int(value.view(np.uint8)[0])
    found: float = byte if value.dtype == np.bool_ and byte > 1 else value[0].item()
    return found


def _unequal(a: Rows, b: Rows) -> BoolArray:
    """Whether entries differ in any bit: NaN equals the same NaN, and 0 is not -0."""
    one, other = map(np.ascontiguousarray, (a, b))
    shape = (*one.shape, one.dtype.itemsize)
    bits = one.view(np.uint8).reshape(shape) != other.view(np.uint8).reshape(shape)
    return np.asarray(bits.any(axis=-1))


def _keyed(recording: Recording, topic: str) -> tuple[Rows, Keys]:
    """Samples of a topic without repeats, and the keys that match them with the other recording."""
    if topic in LANE_TOPICS:
        rows = recording.lane[topic]
        if topic == OperatorCommand.TOPIC and not rows["scripted"].all():
            return rows, np.arange(len(rows))  # a person's commands have no tick
        rows = first_occurrences(rows)
        _, ordinal = np.unique(rows["episode"], return_inverse=True)
        return rows, (ordinal.astype(np.int64) << _EPISODE_SHIFT) + rows["seq"].astype(np.int64)
    rows = recording.stamped[topic]
    times = stamps_ns(rows)
    ordinal = np.concatenate([[0], np.cumsum(np.diff(times) < 0)])[: len(rows)]
    keys = (ordinal << _EPISODE_SHIFT) + times // 1000  # in us, to fit into the lower bits
    keys, index = np.unique(keys, return_index=True)
    return rows[index], keys


def _first(topic: str, a: Rows, b: Rows, names: Sequence[str], keys: Keys) -> Difference | None:
    place = first_unequal(a, b, names)
    if place is None:
        return None
    row, name, entry = place
    return Difference(
        entry_name(topic, name, entry),
        int(a["seq"][row]) if "seq" in names else int(keys[row]),
        float(stamps(a)[row]),
        (value_at(a, place), value_at(b, place)),
    )
