"""Recorded runs as arrays: the same from a bag and from a run in one process."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np

from cassie_bags.bag.definitions import parse_definition, primitives
from cassie_bags.bag.reader import BagIndex, read_messages
from cassie_bags.bag.rows import BoolArray, Rows
from cassie_bags.bag.strays import of_the_run
from cassie_bags.errors import BagError
from cassie_msgs.layout import GAIT_TYPES, SAMPLE_TYPES, Sample, Sensors
from cassie_msgs.sample import ENCAPSULATION, LayoutError
from cassie_msgs.standard_messages import IMU, ODOMETRY, Kind, layout, read_rows

LANE_TOPICS: dict[str, type[Sample]] = {kind.TOPIC: kind for kind in SAMPLE_TYPES}
"""Sample type of each topic of the control lane."""

GAIT_TOPICS: dict[str, type[Sample]] = {kind.TOPIC: kind for kind in GAIT_TYPES}
"""Sample type of each topic between the controller and gait_optimizer."""

GROUND_TRUTH_TOPIC = "/cassie/ground_truth"
SEGWAY_TRUTH_TOPIC = "/segway/ground_truth"
SEGWAY_IMU_TOPIC = "/segway/imu"

_STAMPED: dict[str, Kind] = {
    GROUND_TRUTH_TOPIC: ODOMETRY,
    SEGWAY_TRUTH_TOPIC: ODOMETRY,
    SEGWAY_IMU_TOPIC: IMU,
}

TYPES: dict[str, str] = {
    **{topic: kind.TYPE for topic, kind in LANE_TOPICS.items()},
    **{topic: kind.type for topic, kind in _STAMPED.items()},
}
"""Message type of each topic that is recorded in every run; the Segway's only with a Segway."""

KNOWN_TYPES = TYPES | {topic: kind.TYPE for topic, kind in GAIT_TOPICS.items()}
"""Message type of each topic of a `Recording`."""


def _lane_fields(kind: type[Sample]) -> tuple[str, ...]:
    fields = []
    for name in kind.DTYPE.names or ():
        scalar, shape = kind.DTYPE[name].base, kind.DTYPE[name].shape
        path = f"stamp.{name}" if name in ("sec", "nanosec") else name
        fields.append(f"{scalar.name}{list(shape) if shape else ''} {path}")
    return tuple(fields)


def _doubles(name: str, axes: str) -> tuple[str, ...]:
    return tuple(f"float64 {name}.{axis}" for axis in axes)


_HEADER = ("int32 header.stamp.sec", "uint32 header.stamp.nanosec", "string header.frame_id")
_FIELDS: dict[str, tuple[str, ...]] = {
    **{kind.TYPE: _lane_fields(kind) for kind in (*SAMPLE_TYPES, *GAIT_TYPES)},
    ODOMETRY.type: (
        *_HEADER,
        "string child_frame_id",
        *_doubles("pose.pose.position", "xyz"),
        *_doubles("pose.pose.orientation", "xyzw"),
        "float64[36] pose.covariance",
        *_doubles("twist.twist.linear", "xyz"),
        *_doubles("twist.twist.angular", "xyz"),
        "float64[36] twist.covariance",
    ),
    IMU.type: (
        *_HEADER,
        *_doubles("orientation", "xyzw"),
        "float64[9] orientation_covariance",
        *_doubles("angular_velocity", "xyz"),
        "float64[9] angular_velocity_covariance",
        *_doubles("linear_acceleration", "xyz"),
        "float64[9] linear_acceleration_covariance",
    ),
}
"""Fields by type, in the form of `primitives`: by them `rows_of` finds the values in the bytes."""


def layout_problem(topic: str, index: BagIndex) -> str:
    """Why `rows_of` cannot read the messages of a topic of `KNOWN_TYPES`; empty if it can."""
    if topic in index.unreadable:
        return index.unreadable[topic]
    schema, kind = index.definitions[topic], KNOWN_TYPES[topic]
    if schema.name != kind:
        return f"the bag names the message type {schema.name}, not {kind}"
    if schema.encoding not in ("ros2msg", ""):
        return f"the definition of {kind} is written in {schema.encoding}, not in ros2msg"
    try:
        found = primitives(parse_definition(kind, schema.data.decode("utf-8", "replace")), kind)
    except BagError as error:
        return str(error)
    for field_, expected in zip_longest(found, _FIELDS[kind], fillvalue="nothing"):
        if field_ != expected:
            return f"the bag's {kind} has {field_} where this version has {expected}"
    return ""


def require_layouts(topics: Iterable[str], index: BagIndex) -> None:
    """Check that the messages of those topics which are of `KNOWN_TYPES` can be read by `rows_of`.

    Raises:
        BagError: if those of a topic cannot; the message names the topic and says why.
    """
    for topic in topics:
        if topic in KNOWN_TYPES and (reason := layout_problem(topic, index)):
            raise BagError(f"{topic} cannot be read: {reason}")


def message_check(topic: str) -> Callable[[bytes], bool] | None:
    """A function that says whether bytes are a message of a topic; None if not one of `TYPES`.

    All messages of such a topic have the size of the first one.
    """
    if topic in LANE_TOPICS:
        kind = LANE_TOPICS[topic]
        return lambda raw: sample_bytes(kind, raw) is not None
    if topic not in _STAMPED:
        return None
    first: list[Any] = []

    def is_message(raw: bytes) -> bool:
        try:
            dtype = layout(_STAMPED[topic], raw)
        except LayoutError:
            return False
        first[:] = first or [dtype]
        return bool(dtype == first[0] and len(raw) - dtype.itemsize <= 3)

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
        wall_time: Wall time of the run, from the first sensor sample to the last; NaN if unknown.
            In s.
        metadata: Metadata records by name: seed, values drawn, versions, the experiment's file.
        gaits: Rows of /cassie/gait_request and /cassie/gait; none unless the controller took gaits
            from gait_optimizer.
        strays: Number of messages from publishers outside of the run by topic, which were left out
            (`without_strays`).
    """

    lane: Mapping[str, Rows]
    truth: Rows
    segway: Rows
    segway_imu: Rows
    wall_time: float
    metadata: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    gaits: Mapping[str, Rows] = field(default_factory=dict)
    strays: Mapping[str, int] = field(default_factory=dict)

    @property
    def stamped(self) -> dict[str, Rows]:
        """Rows of each topic outside of the control lane."""
        return dict(zip(_STAMPED, (self.truth, self.segway, self.segway_imu), strict=True))

    def without_strays(self, flags: Mapping[str, BoolArray] | None = None) -> Recording:
        """The run alone, without messages of publishers outside of the run.

        Args:
            flags: Whether each message is of the run, by topic, as from `strays.of_the_run`.
        """
        flags = of_the_run({**self.lane, **self.gaits}, self.stamped) if flags is None else flags
        strays = {topic: int((~own).sum()) for topic, own in flags.items() if not own.all()}
        if not strays:
            return self
        rows = {**self.lane, **self.stamped, **self.gaits}
        for topic in strays:
            rows[topic] = rows[topic][flags[topic]]
        return dataclasses.replace(self.with_rows(rows), strays=strays)

    def with_rows(self, rows: Mapping[str, Rows]) -> Recording:
        """The recording with other rows of each topic; those of the gaits may stay."""
        lane = {topic: rows[topic] for topic in self.lane}
        gaits = {topic: rows.get(topic, own) for topic, own in self.gaits.items()}
        truth, segway, imu = (rows[topic] for topic in _STAMPED)
        return dataclasses.replace(
            self, lane=lane, truth=truth, segway=segway, segway_imu=imu, gaits=gaits
        )

    def rows(self, kind: type[Sample]) -> Rows:
        """Rows of one message type, such as `recording.rows(RobotState)["q"]`."""
        if kind.TOPIC in GAIT_TOPICS:
            return self.gaits.get(kind.TOPIC, np.empty(0, kind.DTYPE))
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
    rows = {topic: rows_of(topic, messages.get(topic, [])) for topic in KNOWN_TYPES}
    lane = {topic: rows[topic] for topic in LANE_TOPICS}
    gaits = {topic: rows[topic] for topic in GAIT_TOPICS}
    truth, segway, imu = (rows[topic] for topic in _STAMPED)
    return Recording(lane, truth, segway, imu, wall_time, metadata or {}, gaits)


def read_recording(path: Path | str) -> Recording:
    """The run in a bag: an MCAP file, or a folder as `ros2 bag` writes it.

    Raises:
        BagError: if the file is not a bag, or a message is of another type than its topic's.
    """
    messages: dict[str, list[bytes]] = {topic: [] for topic in KNOWN_TYPES}
    logs: list[int] = []
    walls: list[int] = []
    index = BagIndex()
    for topic, log_time, wall, data in read_messages(path, KNOWN_TYPES, index):
        messages[topic].append(data)
        if topic == Sensors.TOPIC:
            logs.append(log_time)
            walls.append(wall)
    require_layouts((topic for topic, list_ in messages.items() if list_), index)
    return from_messages(messages, run_time(logs, walls), index.metadata).without_strays()


def run_time(logs: Sequence[int], walls: Sequence[int]) -> float:
    """Wall time of a run from its first sensor sample to its last; NaN if unknown. In s.

    Args:
        logs, walls: Robot time and wall time of each sample. In ns. A run without ROS has robot
            time in both.
    """
    return (walls[-1] - walls[0]) * 1e-9 if walls and logs != walls else math.nan


def rows_of(topic: str, messages: Sequence[bytes]) -> Rows:
    """Messages of one of `KNOWN_TYPES` as one structured array.

    Raises:
        BagError: if a message is of another type, or names of frames differ in length.
    """
    if kind := LANE_TOPICS.get(topic) or GAIT_TOPICS.get(topic):
        return lane_rows(kind, messages)
    try:
        rows = read_rows(_STAMPED[topic], messages)
    except LayoutError as error:
        raise BagError(str(error)) from None
    _check_encoding(TYPES[topic], rows)
    return rows


def lane_rows(kind: type[Sample], messages: Sequence[bytes]) -> Rows:
    """Messages of one type of the control lane as one structured array.

    Raises:
        BagError: if a message does not have the size of its type, or another encoding.
    """
    samples = [sample_bytes(kind, raw) for raw in messages]
    if None in samples:
        size = len(messages[samples.index(None)])
        raise BagError(f"{kind.TYPE} has {kind.SIZE} bytes, the bag holds one of {size}")
    rows = np.frombuffer(b"".join(filter(None, samples)), kind.DTYPE)
    _check_encoding(kind.TYPE, rows)
    return rows


def _check_encoding(kind: str, rows: Rows) -> None:
    """Check that messages are plain CDR, little endian, which their first two bytes tell."""
    starts = rows.view(np.uint8).reshape(-1, rows.itemsize)[:, :2]
    other = (starts != np.frombuffer(ENCAPSULATION[:2], np.uint8)).any(axis=1)
    if other.any():
        start = starts[np.argmax(other)].tobytes().hex()
        raise BagError(f"{kind} in encoding {start}, not 0001 (plain CDR, little endian)")


def sample_bytes(kind: type[Sample], raw: bytes) -> bytes | None:
    """A serialized sample without padding at its end; None if its size is not that of its type."""
    return raw[: kind.SIZE] if 0 <= len(raw) - kind.SIZE <= 3 else None
