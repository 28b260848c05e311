"""Comparison of two recordings, sample by sample and bit by bit: where they first differ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cassie_bags.bag.continuity import first_occurrences
from cassie_bags.bag.fields import entry_name
from cassie_bags.bag.recording import GAIT_TOPICS, LANE_TOPICS, TYPES, Recording
from cassie_bags.bag.rows import BoolArray, IntArray, Rows, stamps, stamps_ns
from cassie_msgs.layout import OperatorCommand

_EPISODE_SHIFT = 40  # bits of a key for the number of a sample within its episode


@dataclass(frozen=True)
class Difference:
    """The first message of a topic that differs in any bit.

    Attributes:
        topic: Topic of the message.
        field: Name of the field, with the name of the component.
        episode: Episode of the simulator in the first recording; -1 for a topic without.
        tick: `seq` of the message; its key for a topic without `seq`.
        time: Robot time within the episode. In s.
        values: Both values.
    """

    topic: str
    field: str
    episode: int
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
    """Compare every topic that is recorded in every run, and gaits where both runs have them.

    Samples are matched by the order of their episodes and by their tick. The number of an episode
    is not compared, because it differs between runs.
    """
    gaits = [
        topic
        for topic, kind in GAIT_TOPICS.items()
        if len(one.rows(kind)) and len(other.rows(kind))
    ]
    return [_compare(topic, one, other) for topic in (*TYPES, *gaits)]


def _compare(topic: str, one: Recording, other: Recording) -> TopicComparison:
    (rows_a, keys_a), (rows_b, keys_b) = (_keyed(recording, topic) for recording in (one, other))
    keys, in_a, in_b = np.intersect1d(keys_a, keys_b, return_indices=True)
    a, b = rows_a[in_a], rows_b[in_b]
    names = [name for name in a.dtype.names or () if name != "episode"]
    different = int(unequal_rows(a, b, names).sum())
    first = first_difference(topic, a, b, names, keys)
    return TopicComparison(topic, (len(rows_a), len(rows_b)), len(keys), different, first)


def unequal_rows(a: Rows, b: Rows, names: Sequence[str]) -> BoolArray:
    """Whether two rows differ in any bit of some fields. Shape (n,)."""
    unequal = np.zeros(len(a), np.bool_)
    for name in names:
        bits = _unequal(a[name], b[name])
        unequal |= bits if bits.ndim == 1 else bits.any(axis=1)
    return unequal


def first_difference(
    topic: str, a: Rows, b: Rows, names: Sequence[str], keys: IntArray | None = None
) -> Difference | None:
    """The first row that differs in some fields, and its first field that does; None if none does.

    Args:
        topic: Topic of the rows.
        a, b: Rows of equal length.
        names: Names of the compared fields.
        keys: Key of each row, for a topic without `seq`.
    """
    unequal = unequal_rows(a, b, names)
    if not unequal.any():
        return None
    row = int(np.argmax(unequal))
    one, other = a[row : row + 1], b[row : row + 1]  # a single truth value would lose its byte
    entries = {name: _unequal(one[name], other[name]) for name in names}
    field = next(name for name in names if entries[name].any())
    entry = int(np.argmax(entries[field]))
    numbered = "seq" in (a.dtype.names or ())
    return Difference(
        topic,
        entry_name(topic, field, entry),
        int(a["episode"][row]) if numbered else -1,
        int(a["seq"][row] if numbered or keys is None else keys[row]),
        float(stamps(one)[0]),
        (_value(one[field], entry), _value(other[field], entry)),
    )


def _value(values: Rows, entry: int) -> Any:
    """The value of an entry; a truth value that is neither 0 nor 1 as its byte."""
    value = np.ascontiguousarray(values).ravel()[entry : entry + 1]
    byte = int(value.view(np.uint8)[0])
    return byte if value.dtype == np.bool_ and byte > 1 else value[0].item()


def _unequal(a: Rows, b: Rows) -> BoolArray:
    """Whether entries differ in any bit: NaN equals the same NaN, and 0 is not -0."""
    one, other = map(np.ascontiguousarray, (a, b))
    shape = (*one.shape, one.dtype.itemsize)
    bits = one.view(np.uint8).reshape(shape) != other.view(np.uint8).reshape(shape)
    return np.asarray(bits.any(axis=-1))


def _keyed(recording: Recording, topic: str) -> tuple[Rows, IntArray]:
    """Samples of a topic without repeats, and the keys that match them with the other recording."""
    if topic in LANE_TOPICS or topic in GAIT_TOPICS:
        rows = {**recording.lane, **recording.gaits}[topic]
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
