"""Recorded runs as arrays: the same from a bag and from a run in one process."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cassie_bags.bag.reader import BagIndex, read_messages
from cassie_bags.bag.rows import Rows
from cassie_bags.bag.standard_messages import read_imu, read_odometry
from cassie_bags.bag.strays import BoolArray, of_the_run
from cassie_bags.errors import BagError
from cassie_msgs.layout import SAMPLE_TYPES, Sample, Sensors
from cassie_msgs.sample import LayoutError
from cassie_msgs.standard_messages import IMU, ODOMETRY, Kind, layout

LANE_TOPICS: dict[str, type[Sample]] = {kind.TOPIC: kind for kind in SAMPLE_TYPES}
"""Sample type of each topic of the control lane."""

GROUND_TRUTH_TOPIC = "/cassie/ground_truth"
SEGWAY_TRUTH_TOPIC = "/segway/ground_truth"
SEGWAY_IMU_TOPIC = "/segway/imu"

_BESIDE: dict[str, Kind] = {
    GROUND_TRUTH_TOPIC: ODOMETRY,
    SEGWAY_TRUTH_TOPIC: ODOMETRY,
    SEGWAY_IMU_TOPIC: IMU,
}

TYPES: dict[str, str] = {
    **{topic: kind.TYPE for topic, kind in LANE_TOPICS.items()},
    **{topic: kind.type for topic, kind in _BESIDE.items()},
}
"""Message type of each topic that is recorded in every run; the Segway's only with a Segway."""

RECORDED_TOPICS = tuple(TYPES)


def message_check(topic: str) -> Callable[[bytes], bool] | None:
    """A function that says whether bytes are a message of a topic; None if not one of `TYPES`.

    All messages of such a topic have the size of the first one.
    """
    if topic in LANE_TOPICS:
        size = LANE_TOPICS[topic].SIZE
        return lambda raw: 0 <= len(raw) - size <= 3
    if topic not in _BESIDE:
        return None
    first: list[Any] = []

    def is_message(raw: bytes) -> bool:
        try:
            found = layout(_BESIDE[topic], raw)
        except LayoutError:
            return False
        first[:] = first or [found]
        return bool(found == first[0] and len(raw) - found.itemsize <= 3)

    return is_message


@dataclass(frozen=True)
class Recording:
    """Messages of one run, by topic, in the order they were published.

    Attributes:
        lane: Rows of each topic of the control lane.
        truth: Rows of `/cassie/ground_truth`: sec, nanosec, position (m, world), orientation
            (x, y, z, w, pelvis to world), linear and angular velocity (m/s and rad/s, pelvis
            axes).
        segway: Rows of `/segway/ground_truth`, like `truth`, of the chassis; none without a Segway.
        segway_imu: Rows of `/segway/imu`: sec, nanosec, angular velocity (rad/s) and specific
            force (m/s^2), chassis axes.
        strays: Number of messages from publishers outside of the run by topic, which were left out
            (`without_strays`).
        wall_time: Wall time of the run, from the first sensor sample to the last; NaN if unknown.
            In s.
        metadata: Metadata records by name: seed, values drawn, versions, the experiment's file.
    """

    lane: Mapping[str, Rows]
    truth: Rows
    wall_time: float
    metadata: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    segway: Rows = field(default_factory=lambda: read_odometry([]))
    segway_imu: Rows = field(default_factory=lambda: read_imu([]))
    strays: Mapping[str, int] = field(default_factory=dict)

    @property
    def beside(self) -> dict[str, Rows]:
        """Rows of each topic outside of the control lane."""
        return {
            GROUND_TRUTH_TOPIC: self.truth,
            SEGWAY_TRUTH_TOPIC: self.segway,
            SEGWAY_IMU_TOPIC: self.segway_imu,
        }

    def without_strays(self, kept: Mapping[str, BoolArray] | None = None) -> Recording:
        """The run alone, without messages of publishers outside of the run.

        Args:
            kept: Whether each message is of the run, by topic, as from `strays.of_the_run`.
        """
        kept = of_the_run(self.lane, self.beside) if kept is None else kept
        strays = {topic: int((~flags).sum()) for topic, flags in kept.items() if not flags.all()}
        if not strays:
            return self
        rows = {**self.lane, **self.beside}
        for topic in strays:
            rows[topic] = rows[topic][kept[topic]]
        return dataclasses.replace(
            self,
            lane={topic: rows[topic] for topic in self.lane},
            truth=rows[GROUND_TRUTH_TOPIC],
            segway=rows[SEGWAY_TRUTH_TOPIC],
            segway_imu=rows[SEGWAY_IMU_TOPIC],
            strays=strays,
        )

    def rows(self, kind: type[Sample]) -> Rows:
        """Rows of one message type, such as `recording.rows(RobotState)["q"]`."""
        return self.lane[kind.TOPIC]


def from_messages(
    messages: Mapping[str, list[bytes]],
    wall_time: float,
    metadata: Mapping[str, Mapping[str, str]] | None = None,
) -> Recording:
    """A recording from serialized messages, by topic.

    Raises:
        BagError: if a message does not have the size of its type.
    """
    lane = {topic: lane_rows(kind, messages.get(topic, [])) for topic, kind in LANE_TOPICS.items()}
    truth = read_odometry(messages.get(GROUND_TRUTH_TOPIC, []))
    segway = read_odometry(messages.get(SEGWAY_TRUTH_TOPIC, []))
    felt = read_imu(messages.get(SEGWAY_IMU_TOPIC, []))
    return Recording(lane, truth, wall_time, metadata or {}, segway, felt)


def read_recording(path: Path | str) -> Recording:
    """The run in a bag: an MCAP file, or a folder as `ros2 bag` writes it.

    Raises:
        BagError: if the file is not a bag, or a message is of another type than its topic's.
    """
    messages: dict[str, list[bytes]] = {topic: [] for topic in RECORDED_TOPICS}
    first = last = None
    index = BagIndex()
    for topic, _, wall, data in read_messages(path, RECORDED_TOPICS, index):
        messages[topic].append(data)
        if topic == Sensors.TOPIC:
            first = wall if first is None else first
            last = wall
    span = (last - first) * 1e-9 if first is not None and last is not None else 0.0
    return from_messages(messages, span, index.metadata).without_strays()


def lane_rows(kind: type[Sample], messages: Iterable[bytes]) -> Rows:
    """Messages of one type of the control lane as one structured array.

    Raises:
        BagError: if a message does not have the size of its type.
    """
    size = kind.SIZE
    trimmed = []
    for raw in messages:
        if not 0 <= len(raw) - size <= 3:
            raise BagError(f"{kind.TYPE} has {size} bytes, the bag holds one of {len(raw)}")
        trimmed.append(raw[:size])
    return np.frombuffer(b"".join(trimmed), kind.DTYPE)
