"""Fingerprints of runs: whether a change left every trajectory the same, to the last bit.

A fingerprint has a SHA-256 of each topic of a run. The hash takes the messages second by second,
and within a second field by field. Its first two hexadecimal digits after each second are kept as
marks. They tell when a run begins to differ, and they allow a check of the first part alone.

The bits depend on the libraries and on the vector instructions of the processor. The file of
fingerprints names both. On another machine the estimated pose is compared instead of the bits,
within `TOLERANCES`. A difference of one bit soon changes an encoder's count, by up to 0.0003 rad.
In the first steps it can shift a touchdown by ticks and joints by 0.2 rad. These values were found
with arithmetic without FMA and with another order of sums, over all experiments.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from cassie_bags.bag.recording import (
    GROUND_TRUTH_TOPIC,
    LANE_TOPICS,
    SEGWAY_IMU_TOPIC,
    SEGWAY_TRUTH_TOPIC,
    Recording,
    read_recording,
)
from cassie_bags.bag.rows import Rows, stamps_ns
from cassie_bags.errors import ExperimentError
from cassie_bags.run.cores import check_parameters, make_loop, simulator_config, tick_count
from cassie_bags.run.experiment import load_experiment, packaged_folder
from cassie_bags.run.seed import resolve
from cassie_bags.run.simulate import Store, run
from cassie_msgs.layout import RobotState
from cassie_msgs.standard_messages import IMU, ODOMETRY

ROBOTS = (0, 1, 2)
"""Seeds of the robots that each experiment is run with."""

FAST: Mapping[str, tuple[int, float]] = {
    "waxed_floor": (1, 12.0),
    "sand_court": (2, 8.0),
    "segway_push": (1, 12.0),
    "standing_tilting": (2, 13.0),
}
"""The quick check: robot and length (s) by experiment; it covers all modes and a Segway."""

START = 5.0
"""Length of the compared part where bits may differ. In s."""

TOLERANCES: Mapping[float, float] = {0.1: 1e-3, 0.2: 1e-3, 1.0: 0.02, 2.0: 0.02, START: 0.5}
"""Largest difference of the estimated pose where bits may differ (m, rad), by robot time (s)."""

_LEFT_OUT = {"sender", "battery_charge", "longest_delay", "missed_ticks", "late_ticks"}
"""Fields that depend on the computers, the operator or the battery gauge, not on the motion."""

_MARK = 2  # hexadecimal digits
_SECOND = 1_000_000_000  # in ns

Fields = Mapping[str, Sequence[str]]
"""Names of fields by topic."""


@dataclass(frozen=True)
class Run:
    """Run of which a fingerprint is taken.

    Attributes:
        file: File of the experiment.
        robot: Seed of the robot.
        seconds: Length of the part that is run, in s; None for the whole run.
        bag: Bag of this run, which is read instead of running the experiment; or None.
    """

    file: Path
    robot: int
    seconds: float | None = None
    bag: Path | None = None


@dataclass(frozen=True)
class TopicPrint:
    """Number of messages of a topic, the hash of its fields, and the marks of this hash."""

    messages: int
    sha256: str
    marks: str


@dataclass(frozen=True)
class Fingerprint:
    """Topics' prints by topic, and the estimated pose q (20 values in m and rad) by time in s."""

    topics: Mapping[str, TopicPrint]
    pose: Mapping[float, Sequence[float]]


@dataclass(frozen=True)
class Fingerprints:
    """Content of a file of fingerprints.

    Attributes:
        environment: Versions and processor's features with which the fingerprints were taken.
        fields: Names of the hashed fields. A field that a later version adds is ignored.
        runs: Fingerprints by name of the experiment's file and by robot.
    """

    environment: Mapping[str, str]
    fields: Fields
    runs: Mapping[str, Mapping[int, Fingerprint]]


@dataclass(frozen=True)
class FingerprintDifference:
    """How a topic of a run differs from its fingerprint, in words, with the time if known."""

    experiment: str
    robot: int
    topic: str
    reason: str


def default_path() -> Path:
    """File of the package's fingerprints."""
    return packaged_folder() / "fingerprints.yaml"


def load(path: Path) -> Fingerprints:
    """Read a file of fingerprints.

    Raises:
        ExperimentError: if it cannot be read or is no such file.
    """
    try:
        content = yaml.load(path.read_bytes(), getattr(yaml, "CSafeLoader", yaml.SafeLoader))
        runs = {
            name: {robot: _fingerprint(entry) for robot, entry in robots.items()}
            for name, robots in content["runs"].items()
        }
        return Fingerprints(content["environment"], content["fields"], runs)
    except OSError as error:
        raise ExperimentError(f"cannot read {path}: {error.strerror}") from None
    except (yaml.YAMLError, ValueError, KeyError, TypeError, AttributeError):
        raise ExperimentError(f"{path} is no file of fingerprints") from None


def save(prints: Fingerprints, path: Path) -> None:
    """Write a file of fingerprints.

    Raises:
        OSError: if it cannot be written.
    """
    text = yaml.safe_dump(asdict(prints), default_flow_style=None, width=100, sort_keys=False)
    path.write_text(text, encoding="utf-8")


def fields_to_hash() -> dict[str, list[str]]:
    """Fields that a new fingerprint hashes, in the order of their messages."""
    fields: dict[str, Sequence[str]] = {
        topic: kind.DTYPE.names or () for topic, kind in LANE_TOPICS.items()
    }
    fields |= {GROUND_TRUTH_TOPIC: ODOMETRY.field_names, SEGWAY_TRUTH_TOPIC: ODOMETRY.field_names}
    fields[SEGWAY_IMU_TOPIC] = IMU.field_names
    return {
        topic: [name for name in names if name not in _LEFT_OUT] for topic, names in fields.items()
    }


def recording_of(planned: Run) -> Recording:
    """Run the experiment in one process, or read its bag.

    Raises:
        CassieError: if the experiment or the bag cannot be used, or the bag is of another robot.
    """
    if planned.bag is not None:
        recording = read_recording(planned.bag)
        robot = recording.metadata.get("cassie_experiment", {}).get("seed")
        if robot != str(planned.robot):
            raise ExperimentError(f"{planned.bag} is of robot {robot}, expected {planned.robot}")
        return recording
    experiment = resolve(load_experiment(planned.file, seed=planned.robot))
    check_parameters(experiment)
    ticks = tick_count(experiment)
    if planned.seconds is not None:
        # One more tick: the one at the end of the last second, which has the pose of that time.
        ticks = min(ticks, round(planned.seconds * simulator_config(experiment).control_rate) + 1)
    store = Store()
    return store.recording(run(make_loop(experiment, store), range(ticks)))


def fingerprint_of(planned: Run, fields: Fields) -> Fingerprint:
    """The fingerprint of a run; a topic without messages has none.

    Raises:
        CassieError: as `recording_of`.
    """
    recording = recording_of(planned)
    rows = {**recording.lane, **recording.stamped}
    topics = {topic: _topic_print(rows[topic], fields[topic]) for topic in fields if topic in rows}
    return Fingerprint(
        {topic: topic_print for topic, topic_print in topics.items() if topic_print.messages},
        _poses(recording.rows(RobotState)),
    )


def differences(
    planned: Run, expected: Fingerprint, computed: Fingerprint, *, exactly: bool
) -> list[FingerprintDifference]:
    """How a run differs from its fingerprint.

    Args:
        planned: The run.
        expected: Fingerprint of the run.
        computed: Fingerprint that the run has now.
        exactly: Whether to compare to the last bit; else the pose is compared to `TOLERANCES`.
    """
    if exactly:
        reasons = {
            topic: _reason(expected.topics.get(topic), computed.topics.get(topic), planned.seconds)
            for topic in sorted({*expected.topics, *computed.topics})
        }
    else:
        reasons = {RobotState.TOPIC: _pose_reason(expected.pose, computed.pose)}
    return [
        FingerprintDifference(planned.file.stem, planned.robot, topic, reason)
        for topic, reason in reasons.items()
        if reason
    ]


def _fingerprint(entry: Mapping[str, Any]) -> Fingerprint:
    topics = {topic: TopicPrint(**topic_print) for topic, topic_print in entry["topics"].items()}
    pose = {float(time): [float(x) for x in q] for time, q in entry["pose"].items()}
    return Fingerprint(topics, pose)


def _topic_print(rows: Rows, fields: Sequence[str]) -> TopicPrint:
    digest, marks = hashlib.sha256(), []
    times = stamps_ns(rows)
    seconds = int(times[-1]) // _SECOND + 1 if len(times) else 0
    ends = np.searchsorted(times, _SECOND * np.arange(seconds + 1))
    names = [name for name in fields if name in (rows.dtype.names or ())]
    for k in range(seconds):
        for name in names:
            digest.update(np.ascontiguousarray(rows[name][ends[k] : ends[k + 1]]).data)
        marks.append(digest.hexdigest()[:_MARK])
    return TopicPrint(len(rows), digest.hexdigest(), "".join(marks))


def _poses(state: Rows) -> dict[float, list[float]]:
    """The estimated pose at the times of `TOLERANCES`."""
    times = stamps_ns(state)
    poses = {}
    for time, tolerance in TOLERANCES.items():
        decimals = 2 - round(math.log10(tolerance))
        for q in state["q"][times == round(time * _SECOND)]:
            poses[time] = q.round(decimals).tolist()
    return poses


def _reason(expected: TopicPrint | None, computed: TopicPrint | None, seconds: float | None) -> str:
    """How messages of a topic differ, in words; empty if they do not."""
    if expected is None or computed is None:
        return "there was none" if expected is None else "there is none"
    one, other = expected.marks, computed.marks
    if seconds is not None:  # the last mark may be of a part of a second
        one, other = one[: _MARK * int(seconds)], other[: _MARK * int(seconds)]
    for k in range(min(len(one), len(other)) // _MARK):
        if one[_MARK * k : _MARK * (k + 1)] != other[_MARK * k : _MARK * (k + 1)]:
            return f"differs between {k} and {k + 1} s"
    if seconds is None and computed.messages != expected.messages:
        return f"has {computed.messages} messages, not {expected.messages}"
    if len(one) != len(other):
        return f"ends after {len(other) // _MARK} s, not {len(one) // _MARK}"
    return "differs" if seconds is None and computed.sha256 != expected.sha256 else ""


def _pose_reason(
    expected: Mapping[float, Sequence[float]], computed: Mapping[float, Sequence[float]]
) -> str:
    """How the estimated poses differ, in words; empty if they are within the tolerances."""
    for time, q in expected.items():
        if time not in computed:
            return f"has no sample at {time:g} s"
        if not np.allclose(computed[time], q, rtol=0.0, atol=TOLERANCES[time], equal_nan=True):
            apart = np.abs(np.subtract(computed[time], q)).max()
            return f"q differs by {apart:.1e} at {time:g} s"
    return ""
