"""Replay of a recording through estimator, supervisor and controller, to the last bit.

Each core gets what its node got: samples, states and commands of the recording. It also gets the
node's events on /cassie/node_events: parameters, late modes, lost nodes. So a difference shows in
the node that causes it. The replay of a core begins where its node began. Before that, and from a
missing message to the node's next start, messages cannot be compared.
"""

from __future__ import annotations

import hashlib
import itertools
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np
import numpy.typing as npt

from cassie_bags.bag.comparison import Difference, first_difference, unequal_rows
from cassie_bags.bag.continuity import SEQ_STEP
from cassie_bags.bag.node_events import RecordedEvent
from cassie_bags.bag.reader import read_attachment
from cassie_bags.bag.rows import stamps
from cassie_bags.errors import BagError, ExperimentError
from cassie_bags.run.provenance import changes_of_environment
from cassie_bags.run.recorded_lane import (
    SECTIONS,
    Key,
    MissingInputError,
    RecordedLane,
    Setting,
    key_of,
    missing,
    needed,
    replaces,
)
from cassie_bags.run.yaml_file import apply_changes, flat
from cassie_control.config import ControllerConfig
from cassie_control.control.gait_controller import GaitController
from cassie_control.estimator.choice import make_monitored
from cassie_control.estimator.config import BRIDGED, EstimatorConfig
from cassie_control.guarded import (
    GuardedController,
    GuardedEstimator,
    GuardedSupervisor,
)
from cassie_control.learning.torque_table import load_torques, path_for_library, zero_torques
from cassie_control.schedule import StopAndStand
from cassie_control.supervisor.config import SupervisorConfig
from cassie_control.supervisor.mode_supervisor import ModeSupervisor
from cassie_gaits.gait_library_file import PACKAGED, load_certified
from cassie_gaits.gait_library_file import library_path as packaged_or_path
from cassie_msgs.layout import (
    Gait,
    Mode,
    MotorCommand,
    OperatorCommand,
    RobotState,
    Sample,
    Sensors,
)
from cassie_msgs.schedule import PERIOD_TICKS, period_of
from cassie_msgs.tunables import from_mapping, names, replace_checked, unknown_name

GuardedT = TypeVar("GuardedT", GuardedEstimator, GuardedSupervisor, GuardedController)

START, TOLERANCE = 5.0, 1e-9
"""Comparison where bits may differ: the first so many s, to this difference in SI units."""

_LAST = 2**62  # ns, later than any receipt: what several processes published is the last one's
_SILENT_TICKS = 100  # in which a node answers no sample: it was lost; less is late or not recorded


@dataclass(frozen=True)
class Replayed:
    """The messages of a topic, as recorded and as computed again. Two arrays of equal length."""

    recorded: npt.NDArray[np.void]
    computed: npt.NDArray[np.void]

    @property
    def _names(self) -> Sequence[str]:
        return self.recorded.dtype.names or ()

    def first_difference(self, topic: str) -> Difference | None:
        """The first message that differs in any bit; the recorded value comes first."""
        return first_difference(topic, self.recorded, self.computed, self._names)

    def different_count(self) -> int:
        """Number of messages that differ in any bit."""
        return int(unequal_rows(self.recorded, self.computed, self._names).sum())

    def max_difference(self, until: float) -> float:
        """Largest difference of a value before `until` (s) of each episode; NaN equals NaN."""
        early = stamps(self.recorded) < until
        largest = 0.0
        for name in self._names:
            one, other = (
                each[name][early].astype(np.float64) for each in (self.recorded, self.computed)
            )
            apart = np.abs(one - other)
            apart[np.isnan(one) & np.isnan(other)] = 0.0
            largest = max(largest, float(np.nan_to_num(apart, nan=np.inf).max(initial=0.0)))
        return largest


@dataclass(frozen=True)
class Verification:
    """Result of a replay.

    Attributes:
        replayed: Messages that could be compared, by topic: state, mode, motor command.
        gaps: Messages that could not be replayed, and why, in words.
        environment_changes: Differences of machine and libraries from those of the recording; empty
            if there are none, or if the bag does not name them.
        damage: What is wrong with the bag; see `BagIndex`.
    """

    replayed: Mapping[str, Replayed]
    gaps: Sequence[str] = field(default_factory=list)
    environment_changes: Sequence[str] = field(default_factory=list)
    damage: str = ""

    @property
    def differences(self) -> list[Difference]:
        """The first difference of each topic that has one."""
        firsts = (each.first_difference(topic) for topic, each in self.replayed.items())
        return [difference for difference in firsts if difference is not None]

    @property
    def holds(self) -> bool:
        """Whether all compared messages are as recorded.

        With other libraries or another kind of processor bits may differ; then the first
        `START` s have to agree within `TOLERANCE`.
        """
        if not self.environment_changes:
            return not self.differences
        return all(each.max_difference(START) <= TOLERANCE for each in self.replayed.values())

    @property
    def compared(self) -> int:
        """Number of messages that were compared."""
        return sum(len(each.recorded) for each in self.replayed.values())


def verify(
    path: Path,
    changes: Iterable[str] = (),
    gaits: Path | None = None,
    watch: Callable[[int, int], None] = lambda done, total: None,
) -> Verification:
    """Replay a bag through the cores of its nodes.

    Args:
        path: The bag.
        changes: Parameters in place of the recorded ones, such as
            `controller.walk.joints.kp_knee=500`, to see their effect.
        gaits: Gait library in place of the recorded one.
        watch: Is called now and then with the numbers of replayed and of all messages.

    Raises:
        BagError: if the bag cannot be read, or does not say with which parameters it was made.
        ExperimentError, CassieError, ParameterError: if a change or a file cannot be used.
    """
    lane = RecordedLane(path)
    overrides = _sections(changes)
    gaps: list[str] = []
    replayed = {}
    total = sum(len(lane.rows[core.KIND.TOPIC]) for core in _CORES)
    done = 0
    for core in _CORES:
        replay = _NodeReplay(lane, core, overrides[SECTIONS[core.NODE]], gaits)

        def watch_node(count: int, before: int = done) -> None:
            watch(before + count, total)

        replayed[core.KIND.TOPIC] = replay.run(watch_node)
        done += len(lane.rows[core.KIND.TOPIC])
        gaps += [*replay.gaps, *replay.silences()]
    recorded = lane.index.metadata.get("cassie_environment")
    changed = changes_of_environment(recorded) if recorded else []
    return Verification(replayed, gaps, changed, lane.index.damage)


class _Core(ABC, Generic[GuardedT]):
    """A core with the inputs of its node.

    Args:
        lane: Messages of the bag.
        setting: Parameters and files with which the node began.
        overrides: Parameters in place of the recorded ones, also of those changed later.
        gaits: Gait library in place of the recorded one.

    Attributes:
        NODE, KIND, CONFIG: Name of the node, type of its messages, and parameters of its core.

    Raises:
        ExperimentError: if the core does not have one of the overrides.
    """

    NODE: ClassVar[str]
    KIND: ClassVar[type[Sample]]
    CONFIG: ClassVar[type[Any]]
    _core: Any

    def __init__(
        self, lane: RecordedLane, setting: Setting, overrides: Mapping[str, Any], gaits: Path | None
    ) -> None:
        self._lane, self._overrides, self._gaits = lane, overrides, gaits
        self._files, self._parameters = setting.files, {**setting.parameters, **overrides}
        self._period = 1.0 / float(self._parameters["control_rate"])
        known = set(names(self.CONFIG))
        for name in overrides.keys() - known:
            raise ExperimentError(unknown_name(name, sorted(known), "parameter"))
        of_core = {name: self._parameters[name] for name in self._parameters.keys() & known}
        self._config = from_mapping(self.CONFIG, of_core)
        self._guarded: GuardedT = self._build()
        self._guarded.reset()

    @abstractmethod
    def _build(self) -> GuardedT:
        """Make `_core`; returns it guarded."""

    def _configure(self) -> None:
        """Use the present parameters."""
        self._core.config = self._config

    def apply(self, event: RecordedEvent) -> None:
        """Apply an event of the node."""
        if event.event == "parameters":
            changes = {k: v for k, v in event.content.items() if k not in self._overrides}
            self._config = replace_checked(self._config, **changes)
            self._configure()

    @abstractmethod
    def answer(self, key: Key, received: int) -> Sample:
        """The core's message for a tick.

        Args:
            key: Episode and tick.
            received: When the recorder received the node's message. Wall clock, in ns.

        Raises:
            MissingInputError: naming the missing message.
        """

    def follow(self, episode: int, ticks: Iterable[int]) -> None:
        """Answer ticks whose answers the recorder missed, as it had not found the node yet.

        Raises:
            MissingInputError: naming the missing message.
        """
        for tick in ticks:
            self.answer((episode, tick), _LAST)


class _Estimator(_Core[GuardedEstimator]):
    NODE, KIND, CONFIG = "state_estimator", RobotState, EstimatorConfig

    def _build(self) -> GuardedEstimator:
        self._sample = Sensors()
        self._core = make_monitored(self._config, self._period)
        return GuardedEstimator(self._core, round(BRIDGED / self._period))

    def answer(self, key: Key, received: int) -> Sample:
        self._sample.load(needed(self._lane.samples, key, "sensor sample"))
        return self._guarded.step(self._sample)


class _Supervisor(_Core[GuardedSupervisor]):
    NODE, KIND, CONFIG = "mode_supervisor", Mode, SupervisorConfig

    def _build(self) -> GuardedSupervisor:
        self._state, self._operator = RobotState(), OperatorCommand()
        self._controller_lost = False
        self._core = ModeSupervisor(self._config, self._period)
        return GuardedSupervisor(self._core)

    def apply(self, event: RecordedEvent) -> None:
        super().apply(event)
        if event.event == "lost":
            self._controller_lost = event.content["node"] is not None

    def answer(self, key: Key, received: int) -> Sample:
        self._state.load(self._lane.state(key, received))
        return self._guarded.step(self._state, self._command(key), self._controller_lost)

    def follow(self, episode: int, ticks: Iterable[int]) -> None:
        for tick in ticks:  # the recorder missed the commands in force, too
            raise MissingInputError(missing("mode", (episode, tick)))

    def _command(self, key: Key) -> OperatorCommand | None:
        operator = self._operator
        if (raw := self._lane.in_force.get(key)) is not None:
            operator.load(raw)
            return operator if int(operator.effective_seq) else None
        operator.load(needed(self._lane.scripted, key, "operator command"))
        return operator


class _Controller(_Core[GuardedController]):
    NODE, KIND, CONFIG = "gait_controller", MotorCommand, ControllerConfig

    def _build(self) -> GuardedController:
        allow = bool(self._parameters.get("allow_uncertified", False))
        bag = self._lane.path
        with TemporaryDirectory(prefix="cassie_") as folder:
            library = self._gaits or _file(self._files["gait_library"], bag, Path(folder))
            gait_library = load_certified(library, allow_uncertified=allow)
            learned = _file(self._files["learned_torques_file"], bag, Path(folder))
            torques = load_torques(learned) if learned.exists() else zero_torques()
        self._state, self._mode, self._off = RobotState(), Mode(), Mode()
        self._gait = Gait()
        self._offered: Key | None = None
        self._late: int | None = None
        self._fallback: StopAndStand | None = None
        self._core = GaitController(self._config, gait_library, self._period, torques)
        return GuardedController(self._core)

    def _configure(self) -> None:
        self._core.configure(self._config)

    def apply(self, event: RecordedEvent) -> None:
        super().apply(event)
        if event.event == "mode":
            self._late = event.content["effective_seq"]
        elif event.event == "gait":
            self._offered = event.episode, event.content["effective_seq"]
        elif event.event == "lost":
            self._fallback = None
            if event.content["node"] is not None:
                self._fallback = StopAndStand(self._period)
                self._fallback.start(self._recorded_mode(event.episode, event.content["since"]))

    def answer(self, key: Key, received: int) -> Sample:
        self._state.load(self._lane.state(key, received))
        mode = self._mode_at(*key)
        if not self._lane.has_events and key in self._lane.gaits:
            self._offered = key  # in one process each gait is offered at its tick, without an event
        if self._offered is not None:
            self._gait.load(needed(self._lane.gaits, self._offered, "gait"))
            self._core.offer(self._gait)
            self._offered = None
        return self._guarded.step(self._state, mode)

    def _mode_at(self, episode: int, tick: int) -> Mode:
        if self._fallback is not None:
            return self._fallback.step()
        first = period_of(tick) if self._late is None else self._late
        return self._recorded_mode(episode, first)

    def _recorded_mode(self, episode: int, effective_seq: int) -> Mode:
        """The mode that takes effect at a tick; off before the first one."""
        raw = self._lane.modes.get((episode, effective_seq))
        if raw is None and effective_seq < PERIOD_TICKS:
            self._off.episode[...] = episode
            return self._off
        self._mode.load(needed(self._lane.modes, (episode, effective_seq), "mode"))
        return self._mode


_CORES: tuple[type[_Core[Any]], ...] = (_Estimator, _Supervisor, _Controller)


def _first_answered(before: tuple[Key, int], now: tuple[Key, int], step: int) -> int:
    """The first tick after a message from which on its node answered every one.

    Args:
        before, now: Keys of two messages of which the bag has none between, each with the number of
            messages up to it that the node published and the bag does not have.
        step: Ticks from one message to the next.

    Raises:
        MissingInputError: if it answered some ticks between, and nothing tells which.
    """
    ((last_episode, last_tick), lost), ((episode, tick), more) = before, now
    ticks = range(last_tick + step if last_episode == episode else tick, tick, step)
    if not ticks or more <= lost:
        return tick
    if more - lost >= len(ticks):
        return ticks[0]
    raise MissingInputError(
        f"{more - lost} messages from tick {ticks[0]} of episode {episode} to tick {ticks[-1]} "
        "are not in the bag, and which is not known"
    )


class _NodeReplay:
    """The replay of one node: each of its messages is computed again.

    Args:
        lane: Messages of the bag.
        core: Core of the node.
        overrides: Parameters in place of the recorded ones.
        gaits: Gait library in place of the recorded one.

    Attributes:
        gaps: A line for each part that could not be replayed.
    """

    def __init__(
        self,
        lane: RecordedLane,
        core: type[_Core[Any]],
        overrides: Mapping[str, Any],
        gaits: Path | None,
    ) -> None:
        self._lane, self._node, self._kind = lane, core.NODE, core.KIND
        self._start = partial(core, lane, overrides=overrides, gaits=gaits)
        self._step = SEQ_STEP[core.KIND.TOPIC]
        self._events = deque(lane.events[core.NODE])  # not yet applied, in order
        self._core: _Core[Any] | None = None  # None while the node's memory is not known
        self.gaps: list[str] = []

    def run(self, watch: Callable[[int], None]) -> Replayed:
        """Compute the messages; `watch` is called now and then with their number so far."""
        lane = self._lane
        recorded, computed = [], []
        processed: set[bytes] = set()
        skipped: list[Key] = []
        rows = sorted(lane.rows[self._kind.TOPIC], key=lambda row: key_of(row.raw))  # not by time
        before: tuple[Key, int] = (-1, 0), 0
        for number, (raw, received, lost) in enumerate(rows):
            if number % 1000 == 0:
                watch(number)
            key = key_of(raw)
            new_episode = key[0] != before[0][0]
            if new_episode:
                self._core = None
            previous, before = before, (key, lost)
            due = self._take_due(key, received if self._core is not None else _LAST)
            if raw in processed and not due:
                continue  # a repeated answer
            processed.add(raw)
            try:
                fresh = self._core is None or any(event.event == "began" for event in due)
                if not lane.has_events and new_episode and key[1] == 0:
                    self._core = self._start(lane.setting(self._node))
                first = key[1] if fresh else _first_answered(previous, before, self._step)
                self._apply(due, key, first)
                answer = self._answer(key, raw, received)
            except MissingInputError as error:
                self.gaps.append(f"{self._node}: {error}; followed again from its next start")
                self._core = None
                continue
            if answer is None:
                skipped.append(key)
            else:
                recorded.append(raw)
                computed.append(answer)
        if skipped:
            (episode, begin), (_, end) = skipped[0], skipped[-1]
            self.gaps.append(
                f"{self._node}: {len(skipped)} messages not followed, from tick {begin} of episode "
                f"{episode} to tick {end}: its start, or a message before, is not in the bag"
            )
        one, other = (
            np.frombuffer(b"".join(each), self._kind.DTYPE) for each in (recorded, computed)
        )
        return Replayed(one, other)

    def silences(self) -> list[str]:
        """A line for each time in which the node, once it had begun, answered no sample."""
        answered = {key_of(raw) for raw, *_ in self._lane.rows[self._kind.TOPIC]}
        if not answered:
            return []
        first, step = min(answered), self._step
        asked = sorted(key for key in self._lane.samples if key > first and key[1] % step == 0)
        lines = []
        for silent, keys in itertools.groupby(asked, key=lambda key: (key not in answered, key[0])):
            unanswered = list(keys)
            if silent[0] and step * len(unanswered) >= _SILENT_TICKS:
                (episode, begin), (_, end) = unanswered[0], unanswered[-1]
                lines.append(
                    f"{self._node}: no message for {len(unanswered)} samples, from tick {begin} of "
                    f"episode {episode} to tick {end}"
                )
        return lines

    def _answer(self, key: Key, raw: bytes, received: int) -> bytes | None:
        """The core's message in place of a recorded one; None without a core.

        Args:
            key: Episode and tick of the message.
            raw: The recorded message.
            received: When the recorder received it. Wall clock, in ns.
        """
        if self._core is None:
            return None
        answer = self._core.answer(key, received).to_bytes()
        if answer != raw and (late := self._take_due(key, _LAST)):  # published late, not a death
            self._apply(late, key, key[1])
            if self._core is not None:
                answer = self._core.answer(key, received).to_bytes()
        return answer

    def _take_due(self, key: Key, received: int) -> list[RecordedEvent]:
        """Take the events that hold for a message, without those of a process that came after it.

        Args:
            key: Episode and tick of the message.
            received: When the recorder received the message. Wall clock, in ns; `_LAST` if there
                was no process before, or what it would have answered is not the message.
        """
        due, events = [], self._events
        while events and (events[0].episode, events[0].seq) <= key:
            if events[0].event == "began" and replaces(events[0].received, received):
                break
            due.append(events.popleft())
        return due

    def _apply(self, events: Iterable[RecordedEvent], key: Key, unrecorded: int) -> None:
        """Apply events of the node before its next message.

        Args:
            events: The events.
            key: Episode and tick of the next message.
            unrecorded: First tick from which on the core so far answered all, whatever is recorded.

        Raises:
            MissingInputError: naming the missing message.
        """
        for event in events:
            if event.event == "began":
                setting = Setting(event.content["parameters"], event.content["files"])
                self._core = self._start(setting) if event.episode == key[0] else None
                unrecorded = event.seq
            elif self._core is not None:
                self._core.follow(key[0], range(unrecorded, event.seq, self._step))
                unrecorded = max(unrecorded, event.seq)
                self._core.apply(event)
        if self._core is not None:
            self._core.follow(key[0], range(unrecorded, key[1], self._step))


def _sections(changes: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Changed parameters by section of the experiment.

    Raises:
        ExperimentError: if a section is not replayed; and as `apply_changes`.
    """
    content: dict[str, Any] = {section: {} for section in SECTIONS.values()}
    apply_changes(content, changes)
    for section in content.keys() - set(SECTIONS.values()):
        known = ", ".join(SECTIONS.values())
        raise ExperimentError(f"{section} is not replayed: parameters are of {known}")
    for section, values in content.items():
        if not isinstance(values, dict):
            raise ExperimentError(f"{section} = {values!r} is not a mapping")
    return {section: flat(values, section) for section, values in content.items()}


def _file(described: Mapping[str, str], bag: Path, folder: Path) -> Path:
    """A file that a node read, found at its path, beside the bag, in the package or in the bag.

    Args:
        described: Path and SHA-256.
        bag: The bag.
        folder: Folder into which a file from the bag is written.

    Raises:
        BagError: if none of these has the recorded hash.
    """
    path = Path(described["path"])
    expected = described.get("sha256")
    if expected is None:
        return path
    packaged = [packaged_or_path(name) for name in PACKAGED]
    packaged += [path_for_library(library) for library in packaged]
    same_name = [file for file in packaged if file.name == path.name]
    for candidate in (path, bag.parent / path.name, *same_name):
        if candidate.is_file() and _hash(candidate) == expected:
            return candidate
    content = read_attachment(bag, f"{expected}/{path.name}")
    if content is not None and hashlib.sha256(content).hexdigest() == expected:
        extracted = folder / path.name
        extracted.write_bytes(content)
        return extracted
    raise BagError(
        f"{path} is not as it was when {bag} was recorded (SHA-256 {expected[:12]}…): put that "
        "file beside the bag"
    )


def _hash(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
