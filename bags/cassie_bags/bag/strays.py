"""Finds stray messages of a bag, which no node of the recorded run published, by their order.

A recorder keeps all messages on a topic, but the nodes of the run ignore other publishers. The run
is the longest series of messages in which time never goes back.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from cassie_bags.bag.rows import BoolArray, IntArray, Rows, stamps_ns, where
from cassie_msgs.layout import OperatorCommand, Sensors

_ChoiceT = TypeVar("_ChoiceT", int, tuple[int, int])

NO_EPISODE = -1
"""In place of the number of an episode, for a message of no episode."""

_SEQ_BITS = 31  # 12 days at 2 kHz; with the 32 bits of an episode they fit in a number
_IN_FLIGHT = 1_000_000_000  # ns by which a stamp may lie outside of its episode's samples
_IN_FLIGHT_TICKS = 2000  # _IN_FLIGHT in ticks at 2 kHz
_LATE_TICKS = 20  # largest delay of a replaced node's answer after those of its successor


def of_the_run(lane: Mapping[str, Rows], stamped: Mapping[str, Rows]) -> dict[str, BoolArray]:
    """Whether each message is of the recorded run. By topic, each of shape (n,).

    Without a sensor sample they cannot be distinguished: all count as of the run.

    Args:
        lane: Messages of the control lane by topic; they carry episode and seq.
        stamped: Messages of topics that carry only stamps, by topic.
    """
    sensors = lane[Sensors.TOPIC]
    if not len(sensors):
        return {topic: np.ones(len(rows), np.bool_) for topic, rows in {**lane, **stamped}.items()}
    flags = {Sensors.TOPIC: _rising(_key(sensors))}
    sensors = where(sensors, flags[Sensors.TOPIC])
    latest = dict(zip(sensors["episode"].tolist(), sensors["seq"].tolist(), strict=True))
    for topic, rows in lane.items():
        if topic != Sensors.TOPIC:
            flags[topic] = _answers(topic, rows, latest)
    for topic, rows in stamped.items():
        flags[topic] = episode_of(rows, sensors) != NO_EPISODE
    return flags


def episode_of(rows: Rows, sensors: Rows) -> IntArray:
    """Episode of messages that do not carry its number. Shape (n,); `NO_EPISODE` for a stray.

    Stamps begin at 0 in each episode, so that a stamp alone may fit several episodes. The result is
    the longest series that is in order of the episodes, and of time within each episode.

    Args:
        rows: Stamped messages in the order of publication. Shape (n,).
        sensors: Samples of the run in the order of publication.
    """
    times = stamps_ns(rows)
    numbers, starts = np.unique(sensors["episode"], return_index=True)
    ends = np.append(starts[1:], len(sensors)) - 1
    sampled = stamps_ns(sensors)
    inside = times[:, None] >= sampled[starts] - _IN_FLIGHT
    inside &= times[:, None] <= sampled[ends] + _IN_FLIGHT
    if len(numbers) == 1:
        rising = _rising(np.where(inside[:, 0], times, -1))
        return np.where(rising, numbers[0].astype(np.int64), NO_EPISODE)
    choices = [
        [(int(number), time) for number in numbers[row][::-1]]
        for row, time in zip(inside, times.tolist(), strict=True)
    ]
    episodes = np.full(len(rows), NO_EPISODE, np.int64)
    for row, (number, _) in _longest(choices).items():
        episodes[row] = number
    return episodes


def _key(rows: Rows) -> IntArray:
    """Episode and seq as one number that rises over a run; -1 for a seq too large for any run."""
    seq = rows["seq"].astype(np.uint64)
    key = (rows["episode"].astype(np.int64) << _SEQ_BITS) + seq.astype(np.int64)
    return np.where(seq < 1 << _SEQ_BITS, key, -1)


def _answers(topic: str, rows: Rows, latest: Mapping[int, int]) -> BoolArray:
    """Whether messages of a topic of the lane belong to samples of the run, in their order."""
    by_person = np.zeros(len(rows), np.bool_)
    if topic == OperatorCommand.TOPIC:
        by_person = ~rows["scripted"]  # a person's command has no seq
    known = np.zeros(len(rows), np.bool_)
    for episode, last in latest.items():
        known |= (rows["episode"] == episode) & (rows["seq"] <= last + _IN_FLIGHT_TICKS)
    keys = np.where(known & ~by_person, _key(rows), -1)
    rising = _rising(keys)
    reached = np.maximum.accumulate(np.where(rising, keys, -1))
    late = (keys >= 0) & (np.abs(keys - reached) <= _LATE_TICKS)
    flags: BoolArray = by_person | rising | late
    return flags


def _rising(keys: IntArray) -> BoolArray:
    """Whether each key belongs to the longest series of keys that never falls. Shape (n,)."""
    flags = keys >= 0
    if (np.diff(keys[flags]) >= 0).all():
        return flags
    taken = _longest([[key] if key >= 0 else [] for key in keys.tolist()])
    flags[:] = False
    flags[list(taken)] = True
    return flags


def _longest(choices: Sequence[Sequence[_ChoiceT]]) -> dict[int, _ChoiceT]:
    """The longest series that never falls, with at most one choice of each row.

    Source: Hunt and Szymanski, "A fast algorithm for computing longest common subsequences",
    1977: the least end of a series of each length, found by bisection.

    Args:
        choices: Choices of each row, the largest first.

    Returns:
        The choices of the series, by row.
    """
    ends: list[_ChoiceT] = []
    links: list[_Link[_ChoiceT]] = []
    for row, values in enumerate(choices):
        for value in values:
            length = bisect_right(ends, value)
            link = _Link(row, value, links[length - 1] if length else None)
            if length == len(ends):
                ends.append(value)
                links.append(link)
            else:
                ends[length], links[length] = value, link
    taken = {}
    last = links[-1] if links else None
    while last is not None:
        taken[last.row] = last.value
        last = last.before
    return taken


@dataclass(frozen=True)
class _Link(Generic[_ChoiceT]):
    """The last member of a series, and the link before it."""

    row: int
    value: _ChoiceT
    before: _Link[_ChoiceT] | None
