"""Control messages of a bag by episode and tick, as inputs of cores that run again."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from itertools import compress
from pathlib import Path
from typing import Any

import numpy as np

from cassie_bags.bag.node_events import EVENTS_TOPIC, IN_FORCE_TOPIC, Event, read_event
from cassie_bags.bag.reader import BagIndex, read_messages
from cassie_bags.bag.recording import lane_rows, sample_bytes
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


class RecordedLane:
    """The control messages of a bag, by topic: in order, and by episode and tick."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.rows: dict[str, list[bytes]] = {topic: [] for topic in _KINDS}
        self.events: dict[str, list[Event]] = {node: [] for node in SECTIONS}
        self.index = BagIndex()
        has_events = False
        for topic, _, _, raw in read_messages(path, [*self.rows, EVENTS_TOPIC], self.index):
            if topic == EVENTS_TOPIC:
                has_events = True
                with suppress(BagError):  # of no node of ours
                    event = read_event(raw)
                    if event.node in self.events:
                        self.events[event.node].append(event)
            elif (sample := sample_bytes(_KINDS[topic], raw)) is not None:
                self.rows[topic].append(sample)
            else:
                raise BagError(
                    f"{path}: a message of {len(raw)} bytes on {topic} is of another type"
                )
        if not self.rows[MotorCommand.TOPIC] and not self.rows[RobotState.TOPIC]:
            raise BagError(f"{path} has neither states nor motor commands")
        self._leave_out_strays()
        for events in self.events.values():
            events.sort(key=lambda event: (event.episode, event.seq))
        self.has_events = has_events
        self.samples = self._by_key(Sensors.TOPIC)
        self.states = self._by_key(RobotState.TOPIC)
        self.in_force = self._by_key(IN_FORCE_TOPIC)
        self.scripted = {
            key: raw for key, raw in self._by_key(OperatorCommand.TOPIC).items() if _scripted(raw)
        }
        self.modes = self._by_effective_seq(Mode)
        self.gaits = self._by_effective_seq(Gait)

    def _leave_out_strays(self) -> None:
        """Leave out messages of other publishers: the nodes ignored these messages, too."""
        rows = {topic: lane_rows(_KINDS[topic], list_) for topic, list_ in self.rows.items()}
        for topic, flags in of_the_run(rows, {}).items():
            self.rows[topic] = list(compress(self.rows[topic], flags.tolist()))

    def _by_key(self, topic: str) -> dict[Key, bytes]:
        messages: dict[Key, bytes] = {}
        for raw in self.rows[topic]:
            messages.setdefault(key_of(raw), raw)
        return messages

    def _by_effective_seq(self, kind: type[Mode] | type[Gait]) -> dict[Key, bytes]:
        messages: dict[Key, bytes] = {}
        message = kind()
        for raw in self.rows[kind.TOPIC]:
            message.load(raw)
            messages[int(message.episode), int(message.effective_seq)] = raw
        return messages

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
        raise MissingInputError(f"the {what} of tick {key[1]}, episode {key[0]}, is not in the bag")
    return raw


def key_of(raw: bytes) -> Key:
    """Episode and tick of a control message."""
    _, _, episode, seq = header(raw)
    return episode, seq


def _scripted(raw: bytes) -> bool:
    return bool(np.frombuffer(raw, OperatorCommand.DTYPE)["scripted"][0])
