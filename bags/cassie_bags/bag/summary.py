"""Summary of a bag: topics, gaps, episodes, modes over time, faults, origin."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import compress
from pathlib import Path
from typing import Any

import numpy as np

from cassie_bags.bag.continuity import first_occurrences, gaps
from cassie_bags.bag.fields import DRIVES, JOINTS
from cassie_bags.bag.location import bag_files
from cassie_bags.bag.node_events import EVENTS_TOPIC, read_event
from cassie_bags.bag.reader import BagIndex, read_messages
from cassie_bags.bag.recording import (
    KNOWN_TYPES,
    Recording,
    from_messages,
    require_layouts,
    run_time,
)
from cassie_bags.bag.rows import FloatArray, IntArray, runs
from cassie_bags.bag.strays import of_the_run
from cassie_bags.bag.tables import decode
from cassie_bags.errors import BagError
from cassie_msgs.layout import (
    Gait,
    GaitResult,
    Mode,
    OperatorCommand,
    RobotMode,
    RobotState,
    Sensors,
)

STATUS_TOPIC = "/cassie/supervisor_status"
DIAGNOSTICS_TOPIC = "/diagnostics"

_KINDS = {
    STATUS_TOPIC: "cassie_msgs/msg/SupervisorStatus",
    DIAGNOSTICS_TOPIC: "diagnostic_msgs/msg/DiagnosticArray",
    EVENTS_TOPIC: "cassie_msgs/msg/NodeEvent",
}
_IMU = ("IMU x", "IMU y", "IMU z")
SENSOR_CHANNELS = (
    "orientation (IMU)",
    *(
        f"{field}.{i} ({part})"
        for field, parts in (
            ("angular_velocity", _IMU),
            ("linear_acceleration", _IMU),
            ("drive_position", DRIVES),
            ("drive_velocity", DRIVES),
            ("joint_position", JOINTS),
            ("joint_velocity", JOINTS),
            ("drive_torque", DRIVES),
        )
        for i, part in enumerate(parts)
    ),
)
"""Channels of the sensors in the order of their bits in `RobotState.sensor_faults`."""

_SOON = 300_000_000  # ns after a change of mode in which the supervisor reports the reason
_LATE = 50_000_000  # ns by which a command may be recorded after the mode that answers it
_OK = 0


@dataclass(frozen=True)
class TopicSummary:
    """Type of a topic, number of messages, and mean rate of the run's (Hz, robot time).

    The type is empty for a topic without a schema; several types are separated by commas.
    """

    topic: str
    type: str
    count: int
    rate: float


@dataclass(frozen=True)
class Interval:
    """A mode, fault or episode with its start and end.

    Attributes:
        name: Name of the mode, fault or episode.
        t0, t1: Start and end, on the bag's axis of robot time. In s.
        reason: Reason in words; empty if none was reported.
    """

    name: str
    t0: float
    t1: float
    reason: str = ""


@dataclass(frozen=True)
class Summary:
    """Summary of a bag.

    Attributes:
        files: MCAP files of the bag.
        size: Size of all files. In bytes.
        complete: Whether each file was closed properly and nothing in it is damaged.
        lost_bytes: Number of bytes that could not be read.
        damage: What is wrong with the bag; see `BagIndex`.
        duration: Robot time from the first message of the run to the last, or of all messages
            where there is no run. In s.
        wall_time: Wall time from the first sensor sample to the last, or of all messages where
            there is none. In s.
        topics: Topics in the order of their names.
        gaps: Missing samples of the control lane, one line each.
        strays: Messages from publishers outside of the run, one line for each topic.
        episodes, modes: Intervals in order. Reasons of modes are the supervisor's; where there is
            none, commands and sensors give it.
        faults: Faults that the supervisor reported; where its status was not recorded, the sensors
            that the estimator rejected.
        has_status: Whether the supervisor's status, which has the reasons of modes, was recorded.
        made_gaits: Number of answers of gait_optimizer by result; empty if there are none.
        nodes: Times at which nodes restarted, were lost or got other parameters.
        problems: Problems that the nodes reported on /diagnostics, in order.
        metadata: Metadata records by name.
        recording: The control lane as arrays, without strays.
    """

    files: Sequence[Path]
    size: int
    complete: bool
    lost_bytes: int
    damage: str
    duration: float
    wall_time: float
    topics: Sequence[TopicSummary]
    gaps: Sequence[str]
    strays: Sequence[str]
    episodes: Sequence[Interval]
    modes: Sequence[Interval]
    faults: Sequence[Interval]
    has_status: bool
    made_gaits: Mapping[str, int]
    nodes: Sequence[Interval]
    problems: Sequence[str]
    metadata: Mapping[str, Mapping[str, str]]
    recording: Recording = field(repr=False)

    @property
    def lockstep_broken(self) -> bool:
        """Whether the simulator reported on /diagnostics that it gave up lock-step."""
        return any("lockstep_broken" in problem for problem in self.problems)


def summarize(bag: Path | str) -> Summary:
    """Read a bag once and summarize it.

    Raises:
        BagError: if the bag cannot be read or is empty, or one of our messages has a wrong type.
    """
    files, index = bag_files(bag), BagIndex()
    messages: dict[str, list[bytes]] = {}
    times: dict[str, list[int]] = {}
    walls: list[int] = []  # wall times of the sensor samples
    first_wall = last_wall = 0
    for topic, log_time, wall_time, data in read_messages(bag, None, index):
        messages.setdefault(topic, []).append(data)
        times.setdefault(topic, []).append(log_time)
        first_wall, last_wall = first_wall or wall_time, wall_time
        if topic == Sensors.TOPIC:
            walls.append(wall_time)
    if not messages and not index.complete:
        raise BagError(f"{bag} holds no whole message")
    wall = (walls[-1] - walls[0]) * 1e-9 if walls else 0.0
    require_layouts(messages, index)
    recording = from_messages(
        {topic: list_ for topic, list_ in messages.items() if topic in KNOWN_TYPES},
        run_time(times.get(Sensors.TOPIC, []), walls),
        index.metadata,
    )
    flags = of_the_run({**recording.lane, **recording.gaits}, recording.stamped)
    recording = recording.without_strays(flags)
    of_run = {
        topic: list(compress(times.get(topic, []), own.tolist())) for topic, own in flags.items()
    }
    run_times = [list_ for list_ in of_run.values() if list_] or list(times.values())
    spans = [(min(list_), max(list_)) for list_ in run_times]
    first, last = (min(s[0] for s in spans), max(s[1] for s in spans)) if spans else (0, 0)
    status = list(_decoded(STATUS_TOPIC, messages, times, index))
    return Summary(
        files=files,
        size=sum(file.stat().st_size for file in files),
        complete=index.complete,
        lost_bytes=index.lost_bytes,
        damage=index.damage,
        duration=(last - first) * 1e-9,
        wall_time=wall if walls else (last_wall - first_wall) * 1e-9,
        topics=[
            _topic(t, ", ".join(kinds), times.get(t, []), of_run.get(t))
            for t, kinds in sorted(index.types.items())
        ],
        gaps=gaps(recording, from_start=False),
        strays=[f"{topic}: {count} messages" for topic, count in recording.strays.items()],
        episodes=_episodes(recording, of_run[Sensors.TOPIC]),
        modes=_modes(recording, of_run, status),
        faults=_faults(
            [(time, message.faults) for time, message in status]
            or _rejected(recording, of_run[RobotState.TOPIC])
        ),
        has_status=bool(status),
        made_gaits=_made_gaits(recording),
        nodes=_node_events(_of_kind(EVENTS_TOPIC, messages, index), times.get(EVENTS_TOPIC, [])),
        problems=_problems(_decoded(DIAGNOSTICS_TOPIC, messages, times, index)),
        metadata=index.metadata,
        recording=recording,
    )


def intervals_of_mode(time: FloatArray, modes: IntArray) -> list[Interval]:
    """Intervals with one mode each, from the times (s) and modes of samples. Shape (n,) each."""
    last = len(time) - 1
    return [
        Interval(_mode_name(modes[start]), float(time[start]), float(time[min(end, last)]))
        for start, end in runs(modes)
    ]


def _decoded(
    topic: str,
    messages: Mapping[str, list[bytes]],
    times: Mapping[str, list[int]],
    index: BagIndex,
) -> Iterator[tuple[int, Any]]:
    """Log time (ns) and decoded message of each message of a topic without fixed layout.

    Messages of another type than that of `_KINDS` are left out, with all of their topic.
    """
    if raw := _of_kind(topic, messages, index):
        yield from zip(times[topic], decode(index.definitions[topic], raw), strict=True)


def _of_kind(topic: str, messages: Mapping[str, list[bytes]], index: BagIndex) -> Sequence[bytes]:
    """Messages of a topic; none if they are of another type than that of `_KINDS`."""
    own = index.types.get(topic) == [_KINDS[topic]] and topic not in index.unreadable
    return messages.get(topic, []) if own else []


def _topic(topic: str, kind: str, times: list[int], of_run: list[int] | None) -> TopicSummary:
    """Summary of a topic from all its times (ns), and from those of the run's messages if known."""
    own = times if of_run is None else of_run
    span = (max(own) - min(own)) * 1e-9 if own else 0.0
    return TopicSummary(topic, kind, len(times), (len(own) - 1) / span if span > 0.0 else 0.0)


def _episodes(recording: Recording, times: list[int]) -> list[Interval]:
    episodes = []
    numbers = recording.lane[Sensors.TOPIC]["episode"]
    for start, end in runs(numbers):
        episodes.append(Interval(str(numbers[start]), times[start] * 1e-9, times[end - 1] * 1e-9))
    return episodes


def _modes(
    recording: Recording, times: Mapping[str, list[int]], status: Sequence[tuple[int, Any]]
) -> list[Interval]:
    rows, own = recording.lane[Mode.TOPIC], times[Mode.TOPIC]
    modes = []
    key = rows["mode"].astype(np.int64) + (rows["episode"].astype(np.int64) << 8)
    for start, end in runs(key):
        mode, t0, t1 = rows["mode"][start], own[start], own[min(end, len(own) - 1)]
        reason = _reason(status, t0) or _shown_reason(recording, times, mode, t0)
        modes.append(Interval(_mode_name(mode), t0 * 1e-9, t1 * 1e-9, reason))
    return modes


def _mode_name(mode: Any) -> str:
    try:
        return RobotMode(int(mode)).name.lower()
    except ValueError:
        return f"unknown mode {int(mode)}"


def _reason(status: Sequence[tuple[int, Any]], since: int) -> str:
    """The supervisor's reason when a mode began: faults, or why the requested mode was refused."""
    for time, message in status:
        if since <= time <= since + _SOON:
            words = list(message.faults)
            if message.requested and message.requested != message.mode and message.readiness:
                words.append(f"{message.requested} was asked for: {message.readiness}")
            if words:
                return "; ".join(words)
    return ""


def _shown_reason(
    recording: Recording, times: Mapping[str, list[int]], mode: int, since: int
) -> str:
    """The reason of a mode that began, as far as the state and the operator's command show it."""

    def newest(topic: str, until: int) -> Any:
        index = bisect_right(times.get(topic, ()), until)
        return recording.lane[topic][index - 1] if index else None

    state = newest(RobotState.TOPIC, since)
    command = newest(OperatorCommand.TOPIC, since + _LATE)
    if mode == RobotMode.OFF:
        return "the drives have no power" if state is not None and state["power"] <= 0.5 else ""
    if command is not None and command["mode"] == mode:
        return "the operator asked for it"
    failed = _channels(state["sensor_faults"]) if state is not None else []
    words = [f"the estimator rejects {', '.join(failed)}"] if failed else []
    if command is not None:
        words.append(f"{_mode_name(command['mode'])} was asked for")
    return "; ".join(words)


def _faults(reported: Iterable[tuple[int, Collection[str]]]) -> list[Interval]:
    """Intervals of faults, from times (ns) and the faults that there are from each time on."""
    began: dict[str, float] = {}
    faults = []
    now = 0.0
    for time, names in reported:
        now = time * 1e-9
        for fault in began.keys() - set(names):
            faults.append(Interval(fault, began.pop(fault), now))
        for fault in names:
            began.setdefault(fault, now)
    faults += [Interval(fault, t0, now) for fault, t0 in began.items()]
    return sorted(faults, key=lambda fault: (fault.t0, fault.name))


def _rejected(recording: Recording, times: list[int]) -> Iterator[tuple[int, Collection[str]]]:
    """Times (ns) and the sensors that the estimator rejects from each time on."""
    masks = recording.lane[RobotState.TOPIC]["sensor_faults"]
    for start, end in runs(masks):
        names = [f"{channel} rejected by the estimator" for channel in _channels(masks[start])]
        yield times[start], names
        if end == len(times):
            yield times[-1], names


def _channels(mask: Any) -> list[str]:
    return [name for bit, name in enumerate(SENSOR_CHANNELS) if int(mask) >> bit & 1]


def _made_gaits(recording: Recording) -> dict[str, int]:
    results = first_occurrences(recording.rows(Gait))["result"]
    counts = {each.name.lower().replace("_", " "): (results == each).sum() for each in GaitResult}
    return {name: int(count) for name, count in counts.items() if count}


def _node_events(raw: Sequence[bytes], times: Sequence[int]) -> list[Interval]:
    known: set[str] = set()
    events = []
    for data, time in zip(raw, times, strict=False):
        try:
            event = read_event(data)
        except BagError:
            continue  # of no node of ours
        text = ""
        if event.event == "began" and event.node in known:
            text = f"{event.node} began anew"
        elif event.event == "parameters" and isinstance(event.content, dict):
            values = ", ".join(f"{name} = {value}" for name, value in event.content.items())
            text = f"{event.node}: {values}"
        elif (
            event.event == "lost" and isinstance(event.content, dict) and event.content.get("node")
        ):
            text = f"{event.content['node']} lost, says {event.node}"
        known.add(event.node)
        if text:
            events.append(Interval(text, time * 1e-9, time * 1e-9))
    return events


def _problems(diagnostics: Iterable[tuple[int, Any]]) -> list[str]:
    problems: dict[str, None] = {}
    for _, message in diagnostics:
        for status in message.status:
            level = status.level if isinstance(status.level, int) else status.level[0]
            if level != _OK:
                problems[f"{status.name}: {status.message}"] = None
    return list(problems)
