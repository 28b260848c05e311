"""Whether a recording is complete: no sample of the control lane is missing."""

from __future__ import annotations

import numpy as np

from cassie_bags.bag.recording import Recording
from cassie_bags.bag.rows import IntArray, Rows, stamps_ns, tick_keys, where
from cassie_bags.bag.strays import episode_of
from cassie_msgs.layout import (
    Mode,
    MotorCommand,
    OperatorCommand,
    RobotState,
    Sensors,
    header,
)
from cassie_msgs.sample import LayoutError
from cassie_msgs.schedule import PERIOD_TICKS

SEQ_STEP: dict[str, int] = {
    Sensors.TOPIC: 1,
    RobotState.TOPIC: 1,
    MotorCommand.TOPIC: 1,
    Mode.TOPIC: PERIOD_TICKS,
    OperatorCommand.TOPIC: PERIOD_TICKS,
}
"""Increment of `seq` from one message to the next, by topic."""


def gaps(recording: Recording, *, from_start: bool = True) -> list[str]:
    """Missing samples, one line for each gap; empty if none is missing.

    A repeated sample is no gap: the simulator repeats one that was not answered in time. A person's
    command has no seq and is no gap either. Where the wall clock sets the pace, no node waits for
    an answer: a missing answer is a missed tick, which the samples count, and no loss. With
    `from_start` each episode must begin with seq 0.
    """
    lines = []
    answers = not recording.lane[Sensors.TOPIC]["wall_paced"].any()
    for topic, step in SEQ_STEP.items():
        if topic != Sensors.TOPIC and not answers:
            continue
        rows = recording.lane[topic]
        if topic == OperatorCommand.TOPIC:
            rows = rows[rows["scripted"]]
        for episode in np.unique(rows["episode"]):
            seq = rows["seq"][rows["episode"] == episode].astype(np.int64)
            lines += _seq_gaps(topic, int(episode), seq, step, from_start)
    return lines + _truth_gaps(recording)


_WALL_PACED = int(Sensors.DTYPE.fields["wall_paced"][1])  # type: ignore[index]
"""Place of this field in a serialized sample."""


class SeqMonitor:
    """Counts missing messages while messages come in, by the rules of `gaps`."""

    def __init__(self) -> None:
        self._wall_paced = False
        self._last: dict[str, tuple[int, int]] = {}
        self._missing: dict[str, int] = {}

    def note(self, topic: str, raw: bytes) -> None:
        """Process a message of any topic."""
        step = SEQ_STEP.get(topic)
        if step is None:
            return
        try:
            _, _, episode, seq = header(raw)
        except LayoutError:
            return  # not a message of this type
        if topic == OperatorCommand.TOPIC and seq == 0:
            return  # a person's command
        if topic == Sensors.TOPIC:
            self._wall_paced |= any(raw[_WALL_PACED : _WALL_PACED + 8])
        before = self._last.get(topic)
        if before is not None and episode == before[0] and seq > before[1] + step:
            missing = (seq - before[1]) // step - 1
            self._missing[topic] = self._missing.get(topic, 0) + missing
        if before is None or (episode, seq) > before:
            self._last[topic] = (episode, seq)

    def gaps(self) -> list[str]:
        """Missing messages so far, one line for each topic."""
        return [
            f"{topic}: {count} samples"
            for topic, count in self._missing.items()
            if topic == Sensors.TOPIC or not self._wall_paced
        ]


def first_occurrences(rows: Rows) -> Rows:
    """The rows without repeats of an (episode, seq), sorted by episode and seq."""
    key = tick_keys(rows)
    if (key[1:] > key[:-1]).all():
        return rows
    return rows[np.unique(key, return_index=True)[1]]


def episodes(recording: Recording) -> list[int]:
    """Episodes of the sensor samples, in the order of their starts."""
    values = recording.lane[Sensors.TOPIC]["episode"]
    _, first = np.unique(values, return_index=True)
    return [int(values[index]) for index in sorted(first)]


def only_episode(recording: Recording, episode: int) -> Recording:
    """The part of a recording that belongs to one of its episodes."""
    sensors = recording.lane[Sensors.TOPIC]
    lane = {
        topic: where(rows, rows["episode"] == episode)
        for topic, rows in {**recording.lane, **recording.gaits}.items()
    }
    stamped = {
        topic: where(rows, episode_of(rows, sensors) == episode)
        for topic, rows in recording.stamped.items()
    }
    return recording.with_rows(lane | stamped)


def _seq_gaps(topic: str, episode: int, seq: IntArray, step: int, from_start: bool) -> list[str]:
    seq = np.unique(seq)
    lines = []
    if from_start and seq[0] != 0:
        lines.append(f"{topic}: episode {episode} begins with seq {seq[0]}")
    jumps = np.flatnonzero(np.diff(seq) > step)
    if len(jumps):
        missing = int(((np.diff(seq)[jumps]) // step - 1).sum())
        where = f"first after seq {seq[jumps[0]]}"
        lines.append(f"{topic}: {missing} samples missing in episode {episode}, {where}")
    return lines


def _truth_gaps(recording: Recording) -> list[str]:
    times = np.unique(stamps_ns(recording.truth))
    if len(times) < 3:
        return []
    spacing = np.diff(times)
    tick = int(spacing.min())
    missing = int((spacing // tick - 1).sum())
    return [f"/cassie/ground_truth: {missing} samples missing"] if missing else []
