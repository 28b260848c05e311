"""Node `recorder`: topics into a bag, without loss on the control lane.

Messages are taken as bytes from a wait set, past rclpy's executor, in batches: the queues are
deep, so a wake-up for each message would only cost the other nodes time.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from rclpy.node import Node
from rclpy.utilities import remove_ros_args

from cassie_bags.bag.clock import RobotClock
from cassie_bags.bag.continuity import SeqMonitor
from cassie_bags.bag.recording import SEGWAY_IMU_TOPIC, SEGWAY_TRUTH_TOPIC, TYPES
from cassie_bags.bag.writer import BagWriter
from cassie_bags.errors import BagError
from cassie_bags.ros.recorded_topic import RecordedTopic, offered_qos, recorded_qos
from cassie_bags.run.provenance import versions
from cassie_bags.run.yaml_file import read_mapping
from cassie_msgs.ros.fast_lane import LaneWaiter
from cassie_msgs.ros.process import Stop, run

DEFAULT_TOPICS = (
    *TYPES,
    "/cassie/node_events",
    "/cassie/operator_in_force",
    "/cassie/supervisor_status",
    "/clock",
    "/diagnostics",
    "/imu/data",
    "/joint_states",
    "/joy",
    "/odom",
    "/robot_description",
    "/tf",
    "/tf_static",
)
"""What is recorded if nothing else is asked for."""

COMPLETE = "the control lane is complete"
"""What the recorder says once it has heard every topic of the control lane."""

_BATCH = 0.01  # s between two looks at the queues
_GRAPH = 0.2  # s between two looks for new topics
_QUIET = 0.1  # s without a message after which nothing more comes
_AFTERWARDS = 1.0  # s after Ctrl-C in which what is on its way is recorded, where others go on
_NEEDED = frozenset(TYPES) - {"/cassie/controller_status", SEGWAY_TRUTH_TOPIC, SEGWAY_IMU_TOPIC}


class Recorder(Node):
    """Subscriptions, and the loop that empties them into a bag."""

    def __init__(self, arguments: argparse.Namespace, stop: Stop) -> None:
        super().__init__("recorder")
        self._stop = stop
        self._all = arguments.all
        self._wanted = set(arguments.topics or DEFAULT_TOPICS)
        self._wall_clock = arguments.wall_clock
        self._subscriptions_by_topic: dict[str, RecordedTopic] = {}
        self._unknown: set[str] = set()
        self._clock_of_robot = RobotClock()
        self._monitor = SeqMonitor()
        self._silent = set(_NEEDED)
        self._first: int | None = None
        self._last = 0
        metadata = _metadata(arguments.metadata)
        if arguments.output.exists():
            raise BagError(f"{arguments.output} exists: give another file with -o, or remove it")
        self._bag = BagWriter(arguments.output)
        for name, content in metadata.items():
            self._bag.add_metadata(name, content)
        for topic in TYPES if self._all else self._wanted & TYPES.keys():
            self._subscribe(topic, TYPES[topic])
        self._waiter = LaneWaiter(self, self._subscriptions_by_topic.values())
        stop.on_request(lambda: self._waiter.wake())

    def loop(self) -> None:
        """Record until Ctrl-C, then what is still on its way."""
        print(f"recording to {self._bag.path}", file=sys.stderr, flush=True)
        try:
            self._record()
        except BagError as error:
            print(f"record: error: {error}", file=sys.stderr)
            self._stop.request(exit_code=1)

    def _record(self) -> None:
        next_look = 0.0
        while not self._stop.requested:
            if time.monotonic() >= next_look:
                self._look_for_topics()
                next_look = time.monotonic() + _GRAPH
            if self._waiter.wait(_GRAPH):
                self._drain()
                self._stop.wait(_BATCH)
            self._bag.flush_if_due(time.time_ns())
        deadline = time.monotonic() + _AFTERWARDS
        while (self._drain() or self._waiter.wait(_QUIET)) and time.monotonic() < deadline:
            pass

    def close(self) -> None:
        """Close the bag and say what is in it."""
        self._bag.close()
        counts = [count for count in self._bag.counts.values() if count]
        seconds = (self._last - (self._first or 0)) * 1e-9
        print(
            f"recorded {sum(counts)} messages of {len(counts)} topics, "
            f"{seconds:.2f} s, to {self._bag.path}",
            file=sys.stderr,
        )
        for gap in self._monitor.gaps():
            print(f"lost: {gap}", file=sys.stderr)
        sys.stderr.flush()

    def _drain(self) -> int:
        """Write all that has come; returns the number of messages."""
        wall = time.time_ns()
        count = 0
        for subscription in self._subscriptions_by_topic.values():
            while (raw := subscription.take_raw()) is not None:
                self._write(subscription, raw, wall)
                count += 1
        return count

    def _write(self, subscription: RecordedTopic, raw: bytes, wall: int) -> None:
        topic = subscription.topic
        robot = self._clock_of_robot.time_of(topic, raw, wall)
        log_time = wall if self._wall_clock else robot
        self._bag.write(subscription.channel, raw, log_time, wall)
        self._first = log_time if self._first is None else self._first
        self._last = log_time
        self._monitor.note(topic, raw)
        if topic in self._silent:
            self._silent.discard(topic)
            if not self._silent:
                print(COMPLETE, file=sys.stderr, flush=True)

    def _look_for_topics(self) -> None:
        """Subscribe to what has appeared, in the way it is offered."""
        known = self._subscriptions_by_topic.keys() | self._unknown
        found = False
        for topic, types in self.get_topic_names_and_types():
            if topic not in known and (self._all or topic in self._wanted):
                found = self._subscribe(topic, types[0]) or found
        if found:
            self._waiter = LaneWaiter(self, self._subscriptions_by_topic.values())

    def _subscribe(self, topic: str, type_name: str) -> bool:
        """Record a topic; False if nobody writes it yet or its type is not installed."""
        lane = topic in TYPES
        qos = offered_qos(self, topic, lossless=lane)
        if qos is None:
            return False
        try:
            channel = self._bag.add_topic(topic, type_name, recorded_qos(qos, 100 if lane else 10))
            subscription = RecordedTopic(self, type_name, topic, qos, channel)
        except ValueError as error:
            self._unknown.add(topic)
            self.get_logger().warning(f"{topic} is not recorded: {error}")
            return False
        self._subscriptions_by_topic[topic] = subscription
        return True


def _metadata(path: Path | None) -> dict[str, dict[str, str]]:
    if path is None:
        return {"cassie_versions": versions()}
    content = read_mapping(path)
    for name, record in content.items():
        if not isinstance(record, dict):
            raise BagError(f"{path}: {name} = {record!r} is not a mapping of names to values")
    return {
        str(name): {str(key): str(value) for key, value in record.items()}
        for name, record in content.items()
    }


def _arguments(words: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="record", description="Record topics into an MCAP bag until Ctrl-C."
    )
    parser.add_argument(
        "topics", nargs="*", help="topics to record (default: the control lane and the usual ones)"
    )
    parser.add_argument(
        "-o", "--output", type=Path, default=None, help="file (default: cassie_DATE_TIME.mcap)"
    )
    parser.add_argument("-a", "--all", action="store_true", help="record every topic there is")
    parser.add_argument(
        "--wall-clock", action="store_true", help="log_time is wall time instead of robot time"
    )
    parser.add_argument(
        "--metadata", type=Path, default=None, help="YAML file of records to put into the bag"
    )
    arguments = parser.parse_args(words)
    if arguments.output is None:
        arguments.output = Path(time.strftime("cassie_%Y-%m-%d_%H-%M-%S.mcap"))
    return arguments


def main() -> None:
    """Entry point of `ros2 run cassie_bags record`."""
    arguments = _arguments(remove_ros_args(sys.argv)[1:])
    # It does not give way to the loop: what it cannot take in time is lost.
    run("record", lambda stop: Recorder(arguments, stop))


if __name__ == "__main__":
    main()
