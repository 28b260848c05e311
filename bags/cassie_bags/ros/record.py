"""Node `recorder`: records topics into a bag, without loss on the control lane.

Messages are taken as bytes from a wait set, in batches, without rclpy's executor. The queues are
long: a wake-up for each message would take time from the other nodes.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import queue
import shutil
import sys
import time
from bisect import bisect_right
from collections.abc import Callable, Mapping
from concurrent import futures
from itertools import count
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from cassie_bags.bag.clock import RobotClock
from cassie_bags.bag.continuity import SeqMonitor
from cassie_bags.bag.node_events import EVENTS_TOPIC, read_event
from cassie_bags.bag.recording import SEGWAY_IMU_TOPIC, SEGWAY_TRUTH_TOPIC, TYPES
from cassie_bags.bag.writer import BagWriter, FolderWriter
from cassie_bags.cli.record import MIB, is_file
from cassie_bags.errors import BagError
from cassie_bags.ros.node_parameters import PARAMETERS_RECORD, NodeParameters, parameters_record
from cassie_bags.ros.recorded_topic import Received, RecordedTopic
from cassie_bags.run.provenance import surroundings
from cassie_bags.run.yaml_file import read_mapping
from cassie_msgs.layout import (
    ControllerStatus,
    Mode,
    MotorCommand,
    OperatorCommand,
    RobotState,
    Sensors,
)
from cassie_msgs.ros.fast_lane import LaneWaiter
from cassie_msgs.ros.process import Stop, run
from cassie_msgs.ros.scheduling import Place, Scheduling

DEFAULT_TOPICS = (
    *TYPES,
    *("/cassie/gait", "/cassie/gait_request", "/cassie/node_events", "/cassie/operator_in_force"),
    *("/cassie/supervisor_status", "/clock", "/diagnostics", "/imu/data", "/joint_states", "/joy"),
    *("/odom", "/parameter_events", "/robot_description", "/tf", "/tf_static"),
)
"""Topics that are recorded by default."""

COMPLETE = "the control lane is complete"
"""Text that the recorder prints once it has received every topic of the control lane."""

LOST_RECORD = "cassie_recording"
"""Name of the metadata record about the recording: lost messages by topic."""

_BATCH = 0.01  # s between two checks of the queues
_GRAPH = 0.2  # s between two checks for new topics
_QUIET = 0.1  # s without a message after which no more messages are expected
_AFTERWARDS = 1.0  # s after Ctrl-C in which messages on their way are recorded, if others go on
_SETTLE = 0.02  # s between two topics of the control lane, at the end of the recording
_WITHOUT_ROBOT = (
    5_000_000_000  # ns of wall time after which messages are written without robot time
)
_ANSWER = 10.0  # s, time-out of a service that waits for the loop
_LARGEST_FILE = 16 * MIB  # bytes of a file that is attached to the bag


class _Message(NamedTuple):
    """A message that is to be written.

    Attributes:
        time: Robot time that it carries; None if it has none that is believed. In ns.
        topic: Its topic.
        taken: The message.
    """

    time: int | None
    topic: RecordedTopic
    taken: Received


_ANSWERS_FIRST = (MotorCommand, ControllerStatus, Mode, RobotState)
_STREAM = {kind.TOPIC: place for place, kind in enumerate(_ANSWERS_FIRST)}
_NEEDED = frozenset(TYPES) - {"/cassie/controller_status", SEGWAY_TRUTH_TOPIC, SEGWAY_IMU_TOPIC}


class Recorder(Node):
    """Node that begins and ends recordings: the first at once, others on request of a service."""

    def __init__(self, arguments: argparse.Namespace, stop: Stop) -> None:
        super().__init__("recorder")
        self._stop = stop
        self._arguments = arguments
        self._metadata = _metadata(arguments.metadata)
        self._requests: queue.Queue[tuple[Callable[[], str], futures.Future[str]]] = queue.Queue()
        self._session: Session | None = None
        self._next_output: Path | None = None
        # It has no low priority: messages that it cannot take in time are lost.
        self._scheduling = Scheduling(self.get_logger().info, Place.OPERATOR)
        if not arguments.start_paused:
            self._begin()
        stop.on_request(self._wake)
        self.create_service(SetBool, "~/record", self._on_record)
        self.create_service(Trigger, "~/split", lambda _, reply: self._request(self._split, reply))

    def loop(self) -> None:
        """Record until Ctrl-C; `close` then records the messages that are still on their way."""
        while not self._stop.requested:
            try:
                self._serve_requests()
                if self._session is None:
                    self._stop.wait(_BATCH)
                else:
                    self._session.step(self._stop)
            except BagError as error:
                print(f"record: error: {error}", file=sys.stderr)
                self._stop.request(exit_code=1)

    def close(self) -> None:
        """Close the bag and print a summary of it."""
        try:
            if self._session is not None:
                self._end()
        except BagError as error:
            if not self._stop.exit_code:  # otherwise it has been printed
                print(f"record: error: {error}", file=sys.stderr)
            self._stop.request(exit_code=1)

    def _begin(self) -> str:
        if self._session is not None:
            raise BagError(f"{self._session.path} is being recorded")
        self._arguments.output = self._next_output or self._arguments.output
        self._session = Session(self, self._arguments, self._metadata, self._scheduling)
        text = f"recording to {self._session.path}"
        print(text, file=sys.stderr, flush=True)
        return text

    def _end(self) -> str:
        session, self._session = self._running, None
        self._next_output = _next_name(session.path)
        return session.close()

    def _split(self) -> str:
        self._running.split()
        return f"{self._running.path} goes on in a new file"

    @property
    def _running(self) -> Session:
        if self._session is None:
            raise BagError("nothing is being recorded")
        return self._session

    def _serve_requests(self) -> None:
        """Carry out requests of the services, which come in another thread."""
        while not self._requests.empty():
            order, answer = self._requests.get()
            try:
                answer.set_result(order())
            except BagError as error:
                answer.set_exception(error)

    def _on_record(self, request: Any, response: Any) -> Any:
        return self._request(self._begin if request.data else self._end, response)

    def _request(self, order: Callable[[], str], response: Any) -> Any:
        answer: futures.Future[str] = futures.Future()
        self._requests.put((order, answer))
        self._wake()
        try:
            response.success, response.message = True, answer.result(_ANSWER)
        except futures.TimeoutError:
            response.success, response.message = False, "the recorder is ending"
        except BagError as error:
            response.success, response.message = False, str(error)
        return response

    def _wake(self) -> None:
        if (session := self._session) is not None:
            session.wake()


class Session:
    """One recording: subscriptions, and the bag that gets their messages.

    Raises:
        BagError: if the bag cannot be made, or the disk is nearly full.
    """

    def __init__(
        self,
        node: Node,
        arguments: argparse.Namespace,
        metadata: Mapping[str, Mapping[str, str]],
        scheduling: Scheduling,
    ) -> None:
        self._node = node
        self._scheduling = scheduling
        self._state = RobotState()
        self.path: Path = arguments.output
        self._arguments = arguments
        self._wanted = set(arguments.topics or DEFAULT_TOPICS)
        self._topics: dict[str, RecordedTopic] = {}
        self._turn = ""  # the topic whose writers were looked at last
        self._unknown: set[str] = set()
        self._robot_clock = RobotClock()
        self._waiting: list[_Message] = []  # messages before robot time is known
        self._monitor = SeqMonitor()
        self._missing_topics = set(_NEEDED)
        self._span: tuple[int, int] | None = None
        self._parameters = NodeParameters(node)
        self._files: set[str] = set()
        self._next_check = 0.0
        self._check_disk()
        self._bag = _writer(arguments)
        # The times of an experiment count from the robot's first tick, even if this tick is late.
        self._patience = float("inf") if "cassie_experiment" in metadata else _WITHOUT_ROBOT
        for name, content in metadata.items():
            self._bag.add_metadata(name, content)
        for topic in TYPES if arguments.all else self._wanted & TYPES.keys():
            self._subscribe(topic, TYPES[topic])
        self._waiter = self._make_waiter()

    def step(self, stop: Stop) -> None:
        """Wait for messages, for a short time only, and write them.

        Raises:
            BagError: if the bag cannot be written, or the disk is nearly full.
        """
        if time.monotonic() >= self._next_check:
            self._check_graph()
            self._next_check = time.monotonic() + _GRAPH
        if self._waiter.wait(_GRAPH / 2):
            self._drain()
            stop.wait(_BATCH)
        self._bag.flush_if_due(time.time_ns())

    def close(self) -> str:
        """Record messages on their way and close the bag; prints and returns a summary.

        Raises:
            BagError: if the bag cannot be written.
        """
        deadline = time.monotonic() + _AFTERWARDS
        try:
            while (self._drain() or self._waiter.wait(_QUIET)) and time.monotonic() < deadline:
                pass
            self._drain(settle=_SETTLE)
            self._write_waiting()
            self._bag.add_metadata(LOST_RECORD, {"lost": json.dumps(self._lost())})
        finally:
            self._bag.close()
            self._parameters.close()
            for topic in self._topics.values():
                topic.close()
        counts = [each for each in self._bag.counts.values() if each]
        first, last = self._span or (0, 0)
        summary = (
            f"recorded {sum(counts)} messages of {len(counts)} topics, "
            f"{(last - first) * 1e-9:.2f} s, to {self.path}"
        )
        print(summary, file=sys.stderr)
        for name, lost in self._lost().items():
            print(f"lost: {name}: {lost} messages", file=sys.stderr)
        for name, topic in self._topics.items():
            if topic.unreadable:
                print(f"left out: {name}: {topic.unreadable} of another type", file=sys.stderr)
        for name in self._arguments.topics:
            if name not in self._topics and name not in self._unknown:
                print(f"never published: {name}", file=sys.stderr)
        for gap in self._monitor.gaps():
            print(f"missing: {gap}", file=sys.stderr)
        sys.stderr.flush()
        return summary

    def split(self) -> None:
        """Continue in a new file; the present one gets all messages that have come.

        Raises:
            BagError: if this recording is a single file.
        """
        if not isinstance(self._bag, FolderWriter):
            raise BagError(f"{self.path} is a single file: give a folder with -o")
        self._drain()
        self._write_waiting()
        self._bag.split()

    def wake(self) -> None:
        """End a wait."""
        self._waiter.wake()

    def _lost(self) -> dict[str, int]:
        return {name: each.lost for name, each in self._topics.items() if each.lost}

    def _drain(self, settle: float = 0.0) -> int:
        """Write all messages that have come, in order of time; returns their number.

        Topics are read against the direction of the control lane: answers first, sensors last. The
        input of an answer has come before it, so no recording ends with an answer without input.
        `settle` (s) is a wait between two topics, for messages that overtook others.
        """
        was_known = self._robot_clock.known
        batch = self._waiting
        waiting = len(batch)
        for name in sorted(self._topics, key=_drain_order):
            topic = self._topics[name]
            if settle and (name in _STREAM or name == Sensors.TOPIC):
                time.sleep(settle)
            batch += [self._received(topic, taken) for taken in topic.take()]
        received = len(batch) - waiting
        if self._arguments.wall_clock or self._robot_clock.known:
            self._waiting = []
            self._write(batch if was_known else [self._timed_again(each) for each in batch])
        elif batch and time.time_ns() - batch[0].taken.received > self._patience:
            self._write_waiting()
        return received

    def _received(self, topic: RecordedTopic, taken: Received) -> _Message:
        name = topic.topic
        robot = self._robot_time(topic, taken)
        if robot is not None or name == OperatorCommand.TOPIC:  # a person's command has no time
            self._monitor.note(name, taken.raw)
        if name == RobotState.TOPIC:
            self._state.load(taken.raw)
            self._scheduling.follow(bool(self._state.wall_paced))
        if name == EVENTS_TOPIC:
            self._attach_files_of(taken.raw)
        if name in self._missing_topics:
            self._missing_topics.discard(name)
            if not self._missing_topics:
                print(COMPLETE, file=sys.stderr, flush=True)
        return _Message(robot, topic, taken)

    def _robot_time(self, topic: RecordedTopic, taken: Received) -> int | None:
        return self._robot_clock.time_of(topic.topic, taken.raw, taken.received, taken.writer)

    def _timed_again(self, message: _Message) -> _Message:
        """A message that came before its writer's time was believed, with its robot time."""
        if message.time is not None:
            return message
        return message._replace(time=self._robot_time(message.topic, message.taken))

    def _write_waiting(self) -> None:
        """Write the messages that wait for robot time, which has not come."""
        if self._waiting and not self._robot_clock.known:
            self._robot_clock.run_on_wall(min(each.taken.received for each in self._waiting))
        messages, self._waiting = self._waiting, []
        self._write(messages)

    def _write(self, batch: list[_Message]) -> None:
        """Write messages; those without robot time of their own get that of their receipt."""
        received = [each.taken.received for each in batch if each.time is None]
        times = iter(self._robot_clock.times_at(received))
        timed = [(next(times) if each.time is None else each.time, each) for each in batch]
        if self._arguments.wall_clock:
            timed = [(each.taken.received, each) for each in batch]
        timed.sort(key=itemgetter(0))
        for log_time, (_, topic, taken) in timed:
            self._bag.write(
                topic.channel, taken.raw, log_time, taken.received, taken.lost, taken.sent
            )
        if timed:
            first, last = self._span or (timed[0][0], 0)
            self._span = min(first, timed[0][0]), max(last, timed[-1][0])

    def _check_graph(self) -> None:
        """Check for new topics and nodes, and for free space on the disk."""
        self._check_disk()
        known = self._topics.keys() | self._unknown
        added = False
        for topic, types in self._node.get_topic_names_and_types():
            if topic not in known and (self._arguments.all or topic in self._wanted):
                added = self._subscribe(topic, types[0]) or added
        for name in [each for each, topic in self._topics.items() if topic.has_new_writers]:
            added = self._topics[name].look() or added
        if self._topics:  # one writer may have taken the place of another: look at one each time
            name = self._turn = _after(self._turn, sorted(self._topics))
            added = self._topics[name].look() or added
        if added:
            self._waiter = self._make_waiter()
        self._parameters.request()
        while (answer := self._parameters.pop_answer()) is not None:
            name, parameters = answer
            self._bag.add_metadata(f"{PARAMETERS_RECORD}{name}", parameters_record(parameters))
            for value in parameters.values():
                if isinstance(value, str) and value:
                    self._attach_file(Path(value))

    def _check_disk(self) -> None:
        place = next(each for each in self.path.absolute().parents if each.exists())
        free, least = shutil.disk_usage(place).free, self._arguments.min_free_space
        if free < least:
            raise BagError(
                f"only {free / MIB:.0f} MiB are free in {place}, less than {least / MIB:.0f} MiB "
                "(--min-free-space): recording ends"
            )

    def _attach_files_of(self, raw: bytes) -> None:
        """Attach files that nodes say they have read, such as the gait library."""
        try:
            event = read_event(raw)
            files = event.content["files"].values() if event.event == "began" else ()
            paths = [Path(described["path"]) for described in files]
        except (BagError, LookupError, TypeError, AttributeError):
            return  # not from our nodes: any node may publish here
        for path in paths:
            self._attach_file(path)

    def _attach_file(self, path: Path) -> None:
        try:
            if not path.is_file() or path.stat().st_size > _LARGEST_FILE:
                return
            content = path.read_bytes()
        except OSError:
            return
        name = f"{hashlib.sha256(content).hexdigest()}/{path.name}"
        if name not in self._files:
            self._files.add(name)
            self._bag.add_file(name, content)

    def _subscribe(self, name: str, type_name: str) -> bool:
        """Record a topic; False if it has no publisher yet or its type is not installed."""
        if name not in TYPES and not self._node.count_publishers(name):
            return False
        try:
            topic = RecordedTopic(self._node, type_name, name)
            topic.channel = self._bag.add_topic(name, type_name, topic.stored)
        except ValueError as error:
            self._unknown.add(name)
            self._node.get_logger().warning(f"{name} is not recorded: {error}")
            return False
        self._topics[name] = topic
        return True

    def _make_waiter(self) -> LaneWaiter:
        topics = self._topics.values()
        return LaneWaiter(self._node, [each for topic in topics for each in topic.subscriptions])


def _drain_order(topic: str) -> int:
    return _STREAM.get(topic, len(_STREAM) + (topic == Sensors.TOPIC))


def _after(name: str, names: list[str]) -> str:
    """The name after this one, in turn."""
    return names[bisect_right(names, name) % len(names)]


def _writer(arguments: argparse.Namespace) -> BagWriter:
    compress = arguments.compression_format == "zstd"
    if is_file(arguments.output):
        return BagWriter(arguments.output, new=True, compress=compress)
    return FolderWriter(
        arguments.output,
        compress=compress,
        max_bytes=arguments.max_bag_size,
        max_duration=arguments.max_bag_duration * 1_000_000_000,
    )


def _next_name(path: Path) -> Path:
    """A free name for the recording after this one: bag.mcap, bag_2.mcap, bag_3.mcap."""
    stem, _, last = path.stem.rpartition("_")
    number = int(last) + 1 if stem and last.isdecimal() and len(last) < 4 else 2
    stem = stem if number > 2 else path.stem
    names = (path.with_name(f"{stem}_{each}{path.suffix}") for each in count(number))
    return next(name for name in names if not name.exists())


def _metadata(path: Path | None) -> dict[str, dict[str, str]]:
    if path is None:
        return surroundings()
    content = read_mapping(path)
    for name, record in content.items():
        if not isinstance(record, dict):
            raise BagError(f"{path}: {name} = {record!r} is not a mapping of names to values")
    return {
        str(name): {str(key): str(value) for key, value in record.items()}
        for name, record in content.items()
    }


def run_recorder(arguments: argparse.Namespace) -> None:
    """Run the node until Ctrl-C."""
    run("record", lambda stop: Recorder(arguments, stop))
