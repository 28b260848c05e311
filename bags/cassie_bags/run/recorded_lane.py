"""Control messages of a bag by episode and tick, as inputs of cores that run again."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from itertools import compress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cassie_bags.bag.node_events import EVENTS_TOPIC, IN_FORCE_TOPIC, RecordedEvent, read_event
from cassie_bags.bag.reader import BagIndex, read_messages
from cassie_bags.bag.recording import lane_rows, require_layouts, sample_bytes
from cassie_bags.bag.rows import Rows
from cassie_bags.bag.strays import of_the_run
from cassie_bags.errors import BagError
from cassie_bags.run.cores import library_path, simulator_config
from cassie_bags.run.experiment import parse_experiment
from cassie_control.learning.torque_table import path_for_library
from cassie_msgs.layout import (
    Gait,
    Mode,
    MotorCommand,
    OperatorCommand,
    RobotState,
    Sample,
    Sensors,
    header,
)

Key = tuple[int, int]
"""Episode and control tick."""

SECTIONS = {
    "state_estimator": "estimator",
    "mode_supervisor": "supervisor",
    "gait_controller": "controller",
}
"""Section of an experiment file that holds a node's parameters."""

_KINDS: Mapping[str, type[Sample]] = {
    kind.TOPIC: kind for kind in (Sensors, RobotState, Mode, MotorCommand, OperatorCommand, Gait)
} | {IN_FORCE_TOPIC: OperatorCommand}


_REPLACEMENT = 200_000_000  # ns of wall time; a process needs longer to replace another


class MissingInputError(Exception):
    """A message that a core needs is not in the bag."""


@dataclass(frozen=True)
class Setting:
    """Parameters and files with which a node began.

    Attributes:
        parameters: Values by name.
        files: Path and SHA-256 of each file that the node read, by the parameter that names it.
    """

    parameters: Mapping[str, Any]
    files: Mapping[str, Mapping[str, str]]


class Recorded(NamedTuple):
    """A control message.

    Attributes:
        raw: The message.
        received: When the recorder received it. Wall clock, in ns.
        lost: Number of messages of its topic up to it that are not in the bag.
    """

    raw: bytes
    received: int
    lost: int


class RecordedLane:
    """The control messages of a bag, by topic: in order, and by episode and tick."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.rows: dict[str, list[Recorded]] = {topic: [] for topic in _KINDS}
        self.events: dict[str, list[RecordedEvent]] = {node: [] for node in SECTIONS}
        self.index = BagIndex()
        has_events = False
        for topic, _, received, raw in read_messages(path, [*self.rows, EVENTS_TOPIC], self.index):
            if topic == EVENTS_TOPIC:
                has_events = True
                with suppress(BagError):  # of no node of ours
                    event = read_event(raw, received)
                    if event.node in self.events:
                        self.events[event.node].append(event)
            elif (sample := sample_bytes(_KINDS[topic], raw)) is not None:
                lost = self.index.lost.get(topic, 0)
                self.rows[topic].append(Recorded(sample, received, lost))
            else:
                raise BagError(
                    f"{path}: a message of {len(raw)} bytes on {topic} is of another type"
                )
        require_layouts((topic for topic, rows in self.rows.items() if rows), self.index)
        if not self.rows[MotorCommand.TOPIC] and not self.rows[RobotState.TOPIC]:
            raise BagError(f"{path} has neither states nor motor commands")
        self._leave_out_strays()
        for events in self.events.values():
            events.sort(key=lambda event: (event.episode, event.seq))
        self.has_events = has_events
        self.samples = self._by_key(Sensors.TOPIC)
        self._states: dict[Key, list[Recorded]] = {}
        for each in self.rows[RobotState.TOPIC]:
            self._states.setdefault(key_of(each.raw), []).append(each)
        self.in_force = self._by_key(IN_FORCE_TOPIC)
        commands = self._by_key(OperatorCommand.TOPIC).items()
        self.scripted = {key: raw for key, raw in commands if _scripted(raw)}
        self.modes = self._by_effective_seq(Mode)
        self.gaits = self._by_effective_seq(Gait)

    def _leave_out_strays(self) -> None:
        """Leave out messages of other publishers: the nodes ignored these messages, too."""
        rows = {topic: self._array(topic) for topic in self.rows}
        for topic, flags in of_the_run(rows, {}).items():
            self.rows[topic] = list(compress(self.rows[topic], flags.tolist()))

    def _array(self, topic: str) -> Rows:
        return lane_rows(_KINDS[topic], [each.raw for each in self.rows[topic]])

    def _by_key(self, topic: str) -> dict[Key, bytes]:
        """The first message of each tick."""
        return {key_of(raw): raw for raw, *_ in reversed(self.rows[topic])}

    def _by_effective_seq(self, kind: type[Mode] | type[Gait]) -> dict[Key, bytes]:
        """The last message for each tick from which on one holds."""
        rows = self._array(kind.TOPIC)
        keys = zip(rows["episode"].tolist(), rows["effective_seq"].tolist(), strict=True)
        return {key: each.raw for key, each in zip(keys, self.rows[kind.TOPIC], strict=True)}

    def state(self, key: Key, answered: int) -> bytes:
        """The state of a tick that a node answered.

        An estimator may end while it publishes a state, so that some nodes get it and others do
        not. The estimator that replaces it then answers the same sample, from a fresh start.

        Args:
            key: Episode and tick.
            answered: When the recorder received the answer. Wall clock, in ns.

        Raises:
            MissingInputError: if the state is missing.
        """
        versions = self._states.get(key)
        if versions is None:
            raise MissingInputError(missing("state", key))
        chosen = versions[0]
        for each in versions[1:]:
            after = replaces(each.received, chosen.received)
            if after and not replaces(each.received, answered):
                chosen = each
        return chosen.raw

    def setting(self, node: str) -> Setting:
        """Setting of a node from the experiment in the bag, for a bag without the node's events.

        Raises:
            BagError: if the bag has no experiment.
        """
        text = self.index.metadata.get("cassie_experiment", {}).get("file")
        if text is None:
            raise BagError(
                f"{self.path} does not say with which parameters {node} ran: it has neither "
                f"{EVENTS_TOPIC} nor an experiment"
            )
        experiment = parse_experiment(text, str(self.path))
        parameters = dict(experiment.parameters[SECTIONS[node]])
        parameters["control_rate"] = simulator_config(experiment).control_rate
        files = {}
        if node == "gait_controller":
            library = library_path(experiment)
            files["gait_library"] = {"path": str(library)}
            learned = parameters.get("learned_torques_file") or path_for_library(library)
            files["learned_torques_file"] = {"path": str(learned)}
        return Setting(parameters, files)


def needed(messages: Mapping[Key, bytes], key: Key, what: str) -> bytes:
    """The message of a tick.

    Raises:
        MissingInputError: if the message is missing; the text calls it `what`.
    """
    raw = messages.get(key)
    if raw is None:
        raise MissingInputError(missing(what, key))
    return raw


def missing(what: str, key: Key) -> str:
    """What to say of a message of a tick that is not in the bag."""
    return f"the {what} of tick {key[1]}, episode {key[0]}, is not in the bag"


def replaces(later: int, earlier: int) -> bool:
    """Whether a message is of a process that replaced another's, by their times of receipt."""
    return later > earlier + _REPLACEMENT


def key_of(raw: bytes) -> Key:
    """Episode and tick of a control message."""
    _, _, episode, seq = header(raw)
    return episode, seq


def _scripted(raw: bytes) -> bool:
    return bool(np.frombuffer(raw, OperatorCommand.DTYPE)["scripted"][0])
