"""Node `replay`: publishes the messages of a bag on their topics, paced by robot time."""

from __future__ import annotations

import argparse
import contextlib
import sys
import threading
import time
from collections import Counter
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from builtin_interfaces.msg import Time
from mcap.records import Channel, Schema
from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor, SetParametersResult
from rclpy.duration import Duration
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool, Trigger

from cassie_bags.bag.clock import CLOCK_TOPIC
from cassie_bags.bag.definitions import definition, parse_definition
from cassie_bags.bag.playback import RATES, Playback
from cassie_bags.bag.reader import BagIndex, read_messages, unknown_topic
from cassie_bags.bag.recording import TYPES
from cassie_bags.bag.rosbag2 import QOS_KEY, read_profiles
from cassie_bags.cli.replay import KEYS
from cassie_bags.errors import BagError
from cassie_bags.ros.recorded_topic import message_class
from cassie_msgs.layout import Mode, MotorCommand, OperatorCommand, Sensors
from cassie_msgs.ros.claim import free_domain
from cassie_msgs.ros.one_writer import UNKNOWN, identity, writers
from cassie_msgs.ros.process import Stop, run
from cassie_teleop.terminal import Terminal

CLOCK_PERIOD = 10_000_000
"""Robot time between two messages on /clock. In ns."""

_CLOCK_END = (1 << 31) * 1_000_000_000  # ns; seconds of builtin_interfaces/Time are an int32

# A second of a topic at 500 Hz, at four times the speed, for slow subscribers.
_MOST_KEPT = 2000
_PLAYED = QoSProfile(depth=_MOST_KEPT, reliability=ReliabilityPolicy.RELIABLE)
_LATCHED_TOPICS = frozenset(["/robot_description", "/tf_static"])
COMMAND_TOPICS = frozenset([OperatorCommand.TOPIC, Mode.TOPIC, MotorCommand.TOPIC])
"""Topics that move a robot: played only on request."""

OWN_TOPICS = frozenset(["/parameter_events", "/rosout"])
"""Topics on which every node publishes about itself: never played."""

_DIAGNOSTICS = "/diagnostics"  # a topic on which several nodes publish at once
_BACK = 5_000_000_000  # ns, step of the key that seeks back
_FASTER = 1.1  # factor of the keys on the rate
_DISCOVERY = 3.0  # s of wall time for discovery of running nodes, also on a busy machine
_ACKED = Duration(seconds=0.1)  # longest wait that cannot be ended
_WRITERS_PERIOD = 0.5  # s between two checks for other writers while it plays
_CHECK_PERIOD = 0.02  # s between two checks for subscribers
_KEY_WAIT = 0.2  # s


@dataclass
class _PlayedIndex(BagIndex):
    """Index of a bag with the QoS that the writers of each topic offered."""

    offers: dict[str, dict[Hashable, Sequence[Mapping[str, Any]]]] = field(default_factory=dict)

    def add_channel(self, key: Hashable, channel: Channel, schema: Schema, *, used: bool) -> None:
        """See `BagIndex.add_channel`."""
        super().add_channel(key, channel, schema, used=used)
        profiles, _ = read_profiles(channel.metadata.get(QOS_KEY, ""))
        self.offers.setdefault(channel.topic, {})[key] = profiles

    def qos(self, topic: str, count: int) -> QoSProfile:
        """QoS with which a topic of so many messages is played: what all its writers offered.

        A publisher of the replay stands for all writers of the topic, so that it keeps each latched
        message. The nodes of the control lane rely on reliable writers.
        """
        offers = [each for profiles in self.offers.get(topic, {}).values() for each in profiles]
        latched = offers and all(each.get("durability") == "transient_local" for each in offers)
        if topic in _LATCHED_TOPICS or (latched and topic not in TYPES):
            return QoSProfile(
                depth=min(max(count, 1), _MOST_KEPT), durability=DurabilityPolicy.TRANSIENT_LOCAL
            )
        weak = any(each.get("reliability") == "best_effort" for each in offers)
        if weak and topic not in TYPES:
            return QoSProfile(depth=_MOST_KEPT, reliability=ReliabilityPolicy.BEST_EFFORT)
        return _PLAYED


def is_installed(schema: Schema) -> bool:
    """Whether a bag's definition of a type has the fields of the installed one.

    A definition that is not written in ROS's own form, or missing, is not compared.
    """
    if schema.encoding != "ros2msg" or not schema.data:
        return True
    own = parse_definition(schema.name, schema.data.decode("utf-8", "replace"))
    return own == parse_definition(schema.name, definition(schema.name))


class Replay(Node):
    """Publishes a bag.

    Its parameters `rate` and `position` (s since the beginning) may be set while it plays. The
    services ~/pause and ~/step pause it, and advance it to the next message.
    """

    def __init__(self, arguments: argparse.Namespace, stop: Stop) -> None:
        super().__init__("replay")
        self._stop = stop
        self._timeout: float = arguments.wait
        self._keys_wanted: bool = not arguments.disable_keyboard_controls
        messages = self._load(arguments.file, arguments.topics, arguments.commands)
        self._messages = messages
        self._own = {topic: identity(each) for topic, each in self._publishers_by_topic.items()}
        if not arguments.allow_second:
            self._refuse_other_writers()
            self.create_timer(_WRITERS_PERIOD, self._end_for_other_writer)
        self._clock_publisher = self.create_publisher(Clock, CLOCK_TOPIC, 10)
        times = [robot for robot, *_ in messages]
        begin, end = times[0] + int(arguments.start * 1e9), times[-1]
        if arguments.duration is not None:
            end = min(end, begin + int(arguments.duration * 1e9))
        if end >= _CLOCK_END:
            raise BagError(
                f"{arguments.file}: a log time of {end * 1e-9:.0f} s does not fit into /clock, "
                "which ends at 2147483647 s"
            )
        self._lock = threading.Lock()
        self._changed = threading.Event()  # the next message may have changed
        self._playback = Playback(
            times,
            rate=arguments.rate,
            loop=arguments.loop,
            paused=arguments.start_paused,
            begin=begin,
            end=end,
        )
        self._skipped: list[int] = [*self._playback.before]  # since the last message
        if self._playback.finished:
            raise BagError(f"{arguments.file} has no message in the part asked for")
        about = "Ratio of robot time to wall time"
        self._declare("rate", arguments.rate, RATES, about)
        about = "Position in s since the beginning; seeks when set"
        self._declare("position", 0.0, (0.0, max((end - begin) * 1e-9, 1e-9)), about)
        self.add_on_set_parameters_callback(self._on_parameters)
        self.create_service(SetBool, "~/pause", self._on_pause)
        self.create_service(Trigger, "~/step", self._on_step)
        stop.on_request(self._changed.set)

    def loop(self) -> None:
        """Play to the end, repeatedly if requested."""
        if not self._await_listeners():
            return
        with self._keys():
            self._play()
        if not self._stop.requested:
            for publisher in self._publishers_by_topic.values():
                # In short waits: Ctrl-C does not end a wait, and a subscriber may be stopped.
                while not self._stop.requested and not publisher.wait_for_all_acked(_ACKED):
                    pass
            self.get_logger().info(f"{self._played} messages replayed")

    def _load(
        self, path: Path, topics: Sequence[str], commands: bool
    ) -> list[tuple[int, Any, bytes]]:
        """Messages of some topics, or of all, in order of robot time, each with its publisher.

        Raises:
            BagError: if the file is no bag or lacks a topic in `topics`, or if such a topic moves a
                robot and `commands` is False.
        """
        moving = sorted(COMMAND_TOPICS.intersection(topics))
        for topic in OWN_TOPICS.intersection(topics):
            raise BagError(f"{topic} is what every node publishes of itself: it is not played")
        if moving and not commands:
            raise BagError(f"{moving[0]} moves a robot that listens: play it with --commands")
        index = _PlayedIndex()
        recorded = list(read_messages(path, topics or None, index))
        if index.damage:
            self.get_logger().warning(f"{path} is {index.damage}")
        names = sorted({topic for topic, *_ in recorded} - {CLOCK_TOPIC} - OWN_TOPICS)
        for topic in topics:
            if topic not in index.types:
                raise BagError(f"{path}: {unknown_topic(topic, index.types)}")
            if topic not in names:
                raise BagError(f"{path} has no message on {topic}")
        if not commands:
            names = [name for name in names if name not in COMMAND_TOPICS]
        counts = Counter(topic for topic, *_ in recorded)
        self._publishers_by_topic = {}
        self._latched: set[Publisher] = set()
        for topic in names:
            try:
                qos = index.qos(topic, counts[topic])
                publisher = self._publishers_by_topic[topic] = self._publisher(topic, index, qos)
                if qos.durability == DurabilityPolicy.TRANSIENT_LOCAL:
                    self._latched.add(publisher)
            except BagError as error:
                self.get_logger().warning(f"{topic or repr(topic)} is not replayed: {error}")
        if not self._publishers_by_topic:
            problem = ": no topic can be played" if names else " has no messages"
            raise BagError(f"{path}{problem}")
        messages = [
            (robot, self._publishers_by_topic[topic], raw)
            for topic, robot, _, raw in recorded
            if topic in self._publishers_by_topic
        ]
        return sorted(messages, key=lambda entry: entry[0])

    def _publisher(self, topic: str, index: BagIndex, qos: QoSProfile) -> Publisher:
        """Publisher of a recorded topic.

        Raises:
            BagError: if the topic's messages cannot be published, or its name is not valid.
        """
        if topic in index.unreadable:
            raise BagError(index.unreadable[topic])
        kind = message_class(index.types[topic][0])
        if not is_installed(index.definitions[topic]):
            raise BagError(f"the bag has other fields in {index.types[topic][0]} than this machine")
        try:
            return self.create_publisher(kind, topic, qos)
        except InvalidTopicNameException:
            raise BagError("this is not a valid name of a topic") from None

    def _declare(self, name: str, value: float, limits: tuple[float, float], about: str) -> None:
        bounds = FloatingPointRange(from_value=limits[0], to_value=limits[1])
        self.declare_parameter(
            name, value, ParameterDescriptor(description=about, floating_point_range=[bounds])
        )

    def _on_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            if parameter.name == "rate":
                self._set_rate(parameter.value)
            elif parameter.name == "position":
                self._seek(self._playback.begin + int(parameter.value * 1e9))
        return SetParametersResult(successful=True)

    def _on_pause(self, request: Any, response: Any) -> Any:
        self._pause(request.data)
        response.success = True
        response.message = "paused" if request.data else "playing"
        return response

    def _on_step(self, _: Any, response: Any) -> Any:
        response.success = self._step()
        response.message = "" if response.success else "it is not paused, or at the end"
        return response

    @contextlib.contextmanager
    def _changing(self) -> Iterator[int]:
        """Hold the lock for a change of the playback; gives the wall time in ns."""
        with self._lock:
            yield time.monotonic_ns()
        self._changed.set()

    def _pause(self, paused: bool) -> None:
        with self._changing() as wall:
            self._playback.pause(paused, wall)

    def _step(self) -> bool:
        with self._changing() as wall:
            return self._playback.step(wall)

    def _seek(self, robot: int) -> None:
        with self._changing() as wall:
            self._skipped += self._playback.seek(robot, wall)
            self._next_clock = 0

    def _set_rate(self, rate: float) -> None:
        with self._changing() as wall:
            self._playback.set_rate(rate, wall)

    def _press(self, key: str) -> None:
        playback = self._playback
        if key == " ":
            self._pause(not playback.paused)
        elif key == "right":
            self._step()
        elif key == "left":
            self._seek(playback.position(time.monotonic_ns()) - _BACK)
        elif key in ("up", "down"):
            self._set_rate(playback.rate * (_FASTER if key == "up" else 1 / _FASTER))
        elif key in ("q", "Q"):
            self._stop.request()

    @contextlib.contextmanager
    def _keys(self) -> Iterator[None]:
        """Follow keys during the `with` statement, if there is a terminal."""
        try:
            terminal = Terminal(sink=sys.stderr) if self._keys_wanted else None
        except OSError:
            terminal = None
        if terminal is None:
            yield
            return
        ended = threading.Event()

        def follow() -> None:
            with contextlib.suppress(EOFError):
                while not ended.is_set():
                    for key in terminal.keys(_KEY_WAIT):
                        self._press(key)
                    terminal.show([self._status()])

        terminal.say(KEYS)
        thread = threading.Thread(target=follow, name="keys", daemon=True)
        thread.start()
        try:
            yield
        finally:
            ended.set()
            thread.join(2 * _KEY_WAIT)
            terminal.close()

    def _status(self) -> str:
        playback = self._playback
        at = (playback.position(time.monotonic_ns()) - playback.begin) * 1e-9
        length = (playback.end - playback.begin) * 1e-9
        paused = "  paused" if playback.paused else ""
        return f"{at:7.2f} of {length:.2f} s  x{playback.rate:.3g}{paused}"

    def _refuse_other_writers(self) -> None:
        """Check that no other node publishes on the played topics.

        Raises:
            BagError: naming the topic and the node.
        """
        deadline = time.monotonic() + _DISCOVERY
        while True:
            late = time.monotonic() > deadline
            if other := self._other_writer(nameless=late):
                raise BagError(other)
            if late or self._stop.wait(_CHECK_PERIOD):
                return

    def _end_for_other_writer(self) -> None:
        """End when another node begins to publish on a played topic."""
        if not self._stop.requested and (other := self._other_writer()):
            print(f"replay: error: {other}", file=sys.stderr, flush=True)
            self._stop.request(exit_code=1)

    def _other_writer(self, *, nameless: bool = False) -> str:
        """Other nodes that publish on played topics, in words; empty if there are none.

        An operator's node may run together with a replayed robot, which does not obey its commands.
        Writers whose node's name has not been found count if `nameless`.
        """
        shared = {_DIAGNOSTICS}
        if {Sensors.TOPIC, Mode.TOPIC} <= self._own.keys():
            shared.add(OperatorCommand.TOPIC)
        for topic, gid in self._own.items():
            if topic in shared:
                continue
            others = {name for writer, name in writers(self, topic).items() if writer != gid}
            if others := others if nameless else others - {UNKNOWN}:
                return (
                    f"{topic} is written by {', '.join(sorted(others))}: end it, or play into "
                    f"another ROS domain, such as ROS_DOMAIN_ID={free_domain()} (--allow-second "
                    "plays here)"
                )
        return ""

    def _await_listeners(self) -> bool:
        """Wait until each topic has a subscriber, or until the time-out; False if stopped."""
        deadline = time.monotonic() + self._timeout
        while time.monotonic() < deadline:
            publishers = self._publishers_by_topic.values()
            if all(publisher.get_subscription_count() for publisher in publishers):
                break
            if self._stop.wait(_CHECK_PERIOD):
                break
        return not self._stop.requested

    def _play(self) -> None:
        """Publish the messages when they are due, until the end."""
        playback, messages = self._playback, self._messages
        span = playback.end - playback.begin + CLOCK_PERIOD
        self._played = 0
        self._next_clock = 0
        while not self._stop.requested:
            self._changed.clear()
            with self._lock:
                skipped, self._skipped = self._skipped, []
                self._publish_latched(skipped)
                index, wait = playback.next(time.monotonic_ns())
            if index is None:
                if playback.finished:
                    return
                if wait > 0.0005:
                    self._changed.wait(None if wait == float("inf") else wait)
                continue
            robot, publisher, raw = messages[index]
            now = robot + playback.rounds * span  # robot time continues over the rounds
            if now >= self._next_clock:
                self._publish_clock(now)
                self._next_clock = now + CLOCK_PERIOD
            publisher.publish(raw)
            self._played += 1

    def _publish_latched(self, skipped: Iterable[int]) -> None:
        """Publish the latched ones of messages that are not played, for late subscribers."""
        for index in skipped:
            _, publisher, raw = self._messages[index]
            if publisher in self._latched:
                publisher.publish(raw)

    def _publish_clock(self, robot: int) -> None:
        seconds, nanoseconds = divmod(robot, 1_000_000_000)
        self._clock_publisher.publish(Clock(clock=Time(sec=seconds, nanosec=nanoseconds)))


def run_replay(arguments: argparse.Namespace) -> None:
    """Run the node to the end of the bag, or until Ctrl-C."""
    run("replay", lambda stop: Replay(arguments, stop))
