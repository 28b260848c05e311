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
from collections.abc import Callable, Mapping
from concurrent import futures
from operator import itemgetter
from pathlib import Path
from typing import Any

from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from cassie_bags.bag.clock import RobotClock
from cassie_bags.bag.continuity import SeqMonitor
from cassie_bags.bag.node_events import EVENTS_TOPIC, read_event
from cassie_bags.bag.recording import SEGWAY_IMU_TOPIC, SEGWAY_TRUTH_TOPIC, TYPES
from cassie_bags.bag.rosbag2 import Qos
from cassie_bags.bag.writer import BagWriter, FolderWriter
from cassie_bags.cli.record import MIB, is_file
from cassie_bags.errors import BagError
from cassie_bags.ros.node_parameters import PARAMETERS_RECORD, NodeParameters, parameters_record
from cassie_bags.ros.recorded_topic import RecordedTopic, offered_qos
from cassie_bags.run.provenance import surroundings
from cassie_bags.run.yaml_file import read_mapping
from cassie_msgs.layout import ControllerStatus, Mode, MotorCommand, RobotState, Sensors
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
_Message = tuple[int | None, RecordedTopic, bytes, int, int]
"""Log time if known, topic, content, time of receipt, and number of those lost before it."""

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
        self._session = Session(self, self._arguments, self._metadata, self._scheduling)
        self._arguments.output = _next_name(self._session.path)
        text = f"recording to {self._session.path}"
        print(text, file=sys.stderr, flush=True)
        return text

    def _end(self) -> str:
        session, self._session = self._running, None
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
        self._subscriptions: dict[str, RecordedTopic] = {}
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
        self._experiment = "cassie_experiment" in metadata
        for name, content in metadata.items():
            self._bag.add_metadata(name, content)
        for topic in TYPES if arguments.all else self._wanted & TYPES.keys():
            self._subscribe(topic, TYPES[topic])
        self._waiter = LaneWaiter(node, self._subscriptions.values())

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
            for subscription in self._subscriptions.values():
                self._node.destroy_subscription(subscription.subscription)
        counts = [each for each in self._bag.counts.values() if each]
        first, last = self._span or (0, 0)
        summary = (
            f"recorded {sum(counts)} messages of {len(counts)} topics, "
            f"{(last - first) * 1e-9:.2f} s, to {self.path}"
        )
        print(summary, file=sys.stderr)
        for topic, lost in self._lost().items():
            print(f"lost: {topic}: {lost} messages", file=sys.stderr)
        for topic, each in self._subscriptions.items():
            if each.unreadable:
                print(f"left out: {topic}: {each.unreadable} of another type", file=sys.stderr)
        for topic in self._arguments.topics:
            if topic not in self._subscriptions and topic not in self._unknown:
                print(f"never published: {topic}", file=sys.stderr)
        for gap in self._monitor.gaps():
            print(f"missing: {gap}", file=sys.stderr)
        sys.stderr.flush()
        return summary

    def split(self) -> None:
        """Continue in a new file.

        Raises:
            BagError: if this recording is a single file.
        """
        if not isinstance(self._bag, FolderWriter):
            raise BagError(f"{self.path} is a single file: give a folder with -o")
        self._bag.split()

    def wake(self) -> None:
        """End a wait."""
        self._waiter.wake()

    def _lost(self) -> dict[str, int]:
        return {topic: each.lost for topic, each in self._subscriptions.items() if each.lost}

    def _drain(self, settle: float = 0.0) -> int:
        """Write all messages that have come, in order of time; returns their number.

        Topics are read against the direction of the control lane: answers first, sensors last. The
        input of an answer has come before it, so no recording ends with an answer without input.
        `settle` (s) is a wait between two topics, for messages that overtook others.
        """
        wall = time.time_ns()
        batch = self._waiting
        waiting = len(batch)
        for topic in sorted(self._subscriptions, key=_drain_order):
            subscription = self._subscriptions[topic]
            if settle and (topic in _STREAM or topic == Sensors.TOPIC):
                time.sleep(settle)
            while (raw := subscription.take_raw()) is not None:
                batch.append(self._received(subscription, raw, wall))
        received = len(batch) - waiting
        if self._arguments.wall_clock or self._robot_clock.known:
            self._waiting = []
            self._write(batch)
        elif batch and wall - batch[0][3] > _WITHOUT_ROBOT and not self._experiment:
            self._write_waiting()
        return received

    def _received(self, subscription: RecordedTopic, raw: bytes, wall: int) -> _Message:
        topic = subscription.topic
        self._monitor.note(topic, raw)
        if topic == RobotState.TOPIC:
            self._state.load(raw)
            self._scheduling.follow(bool(self._state.wall_paced))
        if topic == EVENTS_TOPIC:
            self._attach_files_of(raw)
        if topic in self._missing_topics:
            self._missing_topics.discard(topic)
            if not self._missing_topics:
                print(COMPLETE, file=sys.stderr, flush=True)
        robot = self._robot_clock.time_of(topic, raw, wall)
        known = robot if self._robot_clock.known else None
        log_time = wall if self._arguments.wall_clock else known
        return log_time, subscription, raw, wall, subscription.lost

    def _write_waiting(self) -> None:
        """Write the messages that wait for robot time, which has not come."""
        if self._waiting and not self._robot_clock.known:
            self._robot_clock.run_on_wall(self._waiting[0][3])
        messages, self._waiting = self._waiting, []
        self._write(messages)

    def _write(self, batch: list[_Message]) -> None:
        clock = self._robot_clock
        timed = [
            (clock.time_of(each.topic, raw, wall) if at is None else at, each, raw, wall, lost)
            for at, each, raw, wall, lost in batch
        ]
        timed.sort(key=itemgetter(0))
        for log_time, each, raw, wall, lost in timed:
            self._bag.write(each.channel, raw, log_time, wall, lost)
        if timed:
            first, last = self._span or (timed[0][0], 0)
            self._span = min(first, timed[0][0]), max(last, timed[-1][0])

    def _check_graph(self) -> None:
        """Check for new topics and nodes, and for free space on the disk."""
        self._check_disk()
        known = self._subscriptions.keys() | self._unknown
        added = False
        for topic, types in self._node.get_topic_names_and_types():
            if topic not in known and (self._arguments.all or topic in self._wanted):
                added = self._subscribe(topic, types[0]) or added
        if added:
            self._waiter = LaneWaiter(self._node, self._subscriptions.values())
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

    def _subscribe(self, topic: str, type_name: str) -> bool:
        """Record a topic; False if it has no publisher yet or its type is not installed."""
        lane = topic in TYPES
        qos = offered_qos(self._node, topic, lossless=lane)
        if qos is None:
            return False
        try:
            depth = 100 if lane else 10  # of a writer, for a replay
            stored = Qos(qos.reliability.name.lower(), qos.durability.name.lower(), depth=depth)
            channel = self._bag.add_topic(topic, type_name, stored)
            subscription = RecordedTopic(self._node, type_name, topic, qos, channel)
        except ValueError as error:
            self._unknown.add(topic)
            self._node.get_logger().warning(f"{topic} is not recorded: {error}")
            return False
        self._subscriptions[topic] = subscription
        return True


def _drain_order(topic: str) -> int:
    return _STREAM.get(topic, len(_STREAM) + (topic == Sensors.TOPIC))


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
    """A name for the recording after this one: bag.mcap, bag_2.mcap, bag_3.mcap."""
    stem, _, last = path.stem.rpartition("_")
    number = int(last) + 1 if stem and last.isdecimal() and len(last) < 4 else 2
    return path.with_name(f"{stem if number > 2 else path.stem}_{number}{path.suffix}")


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
