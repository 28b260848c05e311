"""Node `replay`: messages of a bag back onto their topics, paced by the robot's clock."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.utilities import remove_ros_args
from rosgraph_msgs.msg import Clock

from cassie_bags.bag.clock import CLOCK_TOPIC
from cassie_bags.bag.reader import BagIndex, read_messages
from cassie_bags.cli import verify
from cassie_bags.cli.arguments import number
from cassie_bags.errors import BagError
from cassie_bags.ros.recorded_topic import message_class
from cassie_msgs.layout import Mode, MotorCommand, OperatorCommand
from cassie_msgs.ros.claim import free_domain
from cassie_msgs.ros.fast_lane import WRITER
from cassie_msgs.ros.one_writer import UNKNOWN, identity, writers
from cassie_msgs.ros.process import Stop, run

CLOCK_PERIOD = 10_000_000
"""Robot time between two messages on /clock. In ns."""

_LATCHED = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
_LATCHED_TOPICS = frozenset(["/robot_description", "/tf_static"])
COMMAND_TOPICS = frozenset([OperatorCommand.TOPIC, Mode.TOPIC, MotorCommand.TOPIC])
"""Topics by which a robot is moved: played only where that is asked for."""

_DISCOVERY = 1.5  # s of wall time in which nodes that run already are found
_ACKED = Duration(seconds=0.1)  # for which a wait cannot be ended
_LOOK = 0.02  # s between two looks whether somebody listens


class Replay(Node):
    """Publishes a bag."""

    def __init__(self, arguments: argparse.Namespace, stop: Stop) -> None:
        super().__init__("replay")
        self._stop = stop
        self._rate: float = arguments.rate
        self._loop_forever: bool = arguments.loop
        self._patience: float = arguments.wait
        self._messages = self._load(arguments.file, arguments.topics, arguments.commands)
        self._refuse_beside_writers()
        self._clock = self.create_publisher(Clock, CLOCK_TOPIC, 10)

    def loop(self) -> None:
        """Play to the end, again and again if asked to."""
        if not self._await_listeners():
            return
        start = self._messages[0][0]
        length = self._messages[-1][0] - start + CLOCK_PERIOD
        offset = 0  # robot time goes on over the rounds
        while not self._stop.requested:
            self._play(offset)
            if not self._loop_forever:
                break
            offset += length
        if not self._stop.requested:
            for publisher in self._publishers_by_topic.values():
                # Bit by bit: Ctrl-C does not end a wait, and a subscriber may be stopped.
                while not self._stop.requested and not publisher.wait_for_all_acked(_ACKED):
                    pass
            self.get_logger().info(f"{len(self._messages)} messages replayed")

    def _load(
        self, path: Path, topics: Sequence[str], commands: bool
    ) -> list[tuple[int, Any, bytes]]:
        """Messages in order of robot time, each with its publisher.

        Args:
            path: The bag.
            topics: Those to play; all if none is named.
            commands: Whether topics that move a robot may be played.

        Raises:
            BagError: if the file is no bag, has none of the topics asked for, or one of them moves
                a robot and that was not asked for.
        """
        moving = sorted(COMMAND_TOPICS.intersection(topics))
        if moving and not commands:
            raise BagError(f"{moving[0]} moves a robot that listens: play it with --commands")
        index = BagIndex()
        found = list(read_messages(path, topics or None, index))
        if not index.complete:
            lost = f"{index.lost_bytes} bytes could not be read" if index.lost_bytes else "no end"
            self.get_logger().warning(f"{path} is damaged or was not closed: {lost}")
        names = sorted({topic for topic, *_ in found} - {CLOCK_TOPIC})
        for topic in topics:
            if topic not in names:
                raise BagError(f"{path} has no message on {topic}")
        if not commands:
            names = [name for name in names if name not in COMMAND_TOPICS]
        if not names:
            raise BagError(f"{path} has no messages")
        self._publishers_by_topic = {
            topic: self.create_publisher(
                message_class(index.types[topic]),
                topic,
                _LATCHED if topic in _LATCHED_TOPICS else WRITER,
            )
            for topic in names
        }
        messages = [
            (robot, self._publishers_by_topic[topic], raw)
            for topic, robot, _, raw in found
            if topic in self._publishers_by_topic
        ]
        return sorted(messages, key=lambda entry: entry[0])

    def _refuse_beside_writers(self) -> None:
        """Hold that no other node writes what is to be played.

        Raises:
            BagError: naming the topic and the node.
        """
        own = {topic: identity(each) for topic, each in self._publishers_by_topic.items()}
        deadline = time.monotonic() + _DISCOVERY
        while True:
            for topic, gid in own.items():
                others = {name for writer, name in writers(self, topic).items() if writer != gid}
                if others := others - {UNKNOWN}:
                    raise BagError(
                        f"{topic} is written by {', '.join(sorted(others))}: end it, or play into "
                        f"another ROS domain, such as ROS_DOMAIN_ID={free_domain()}"
                    )
            if time.monotonic() > deadline or self._stop.wait(_LOOK):
                return

    def _await_listeners(self) -> bool:
        """Wait until each topic has a subscriber, as long as asked for; False if stopped."""
        deadline = time.monotonic() + self._patience
        while time.monotonic() < deadline:
            publishers = self._publishers_by_topic.values()
            if all(publisher.get_subscription_count() for publisher in publishers):
                break
            if self._stop.wait(_LOOK):
                break
        return not self._stop.requested

    def _play(self, offset: int) -> None:
        """Publish everything once.

        Args:
            offset: What /clock is ahead of the bag's robot time. In ns.
        """
        started = time.monotonic_ns()
        first = self._messages[0][0]
        next_clock = first
        for robot, publisher, raw in self._messages:
            due = started + int((robot - first) / self._rate)
            wait = (due - time.monotonic_ns()) * 1e-9
            if wait > 0.0005 and self._stop.wait(wait):
                return
            if robot >= next_clock:
                self._publish_clock(robot + offset)
                next_clock = robot + CLOCK_PERIOD
            publisher.publish(raw)
            if self._stop.requested:
                return

    def _publish_clock(self, robot: int) -> None:
        seconds, nanoseconds = divmod(robot, 1_000_000_000)
        self._clock.publish(Clock(clock=Time(sec=seconds, nanosec=nanoseconds)))


def _arguments(words: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="replay",
        description="Publish the messages of a bag on their topics, with /clock.",
        epilog="With --verify nothing is published: the bag goes through estimator, supervisor and "
        "controller again, and their answers are compared bit by bit (--verify --help).",
    )
    parser.add_argument("file", type=Path)
    parser.add_argument("--rate", type=_rate, default=1.0, help="robot time per wall time")
    parser.add_argument("--topics", nargs="+", default=[], help="only these")
    parser.add_argument(
        "--commands",
        action="store_true",
        help="also what moves a robot that listens: motor commands, modes, operator commands",
    )
    parser.add_argument("--loop", action="store_true", help="again and again")
    parser.add_argument(
        "--wait", type=_patience, default=0.0, help="wait up to so many seconds for subscribers"
    )
    return parser.parse_args(words)


def _rate(word: str) -> float:
    value = number(word)
    if not 0.0 < value < 1e6:
        raise argparse.ArgumentTypeError(f"{word} is not a rate above 0")
    return value


def _patience(word: str) -> float:
    value = number(word)
    if not 0.0 <= value < 1e6:
        raise argparse.ArgumentTypeError(f"{word} is not 0 s or more")
    return value


def main() -> None:
    """Entry point of `ros2 run cassie_bags replay`."""
    if "--verify" in sys.argv[1:]:
        sys.exit(verify.main(sys.argv[1:]))
    arguments = _arguments(remove_ros_args(sys.argv)[1:])
    run("replay", lambda stop: Replay(arguments, stop))


if __name__ == "__main__":
    main()
