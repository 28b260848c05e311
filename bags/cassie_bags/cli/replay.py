"""Command `replay`: options of the node that plays a bag."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from cassie_bags.bag.playback import RATES
from cassie_bags.cli import verify
from cassie_bags.cli.arguments import in_range
from cassie_bags.cli.frame import CommandParser, exit_codes, node_words

KEYS = "space: pause, right: step, left: 5 s back, up/down: rate, q: end"
"""Keys on a terminal."""


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of `ros2 run cassie_bags replay`."""
    words = node_words("replay") if argv is None else argv
    if "--verify" in words:
        return verify.main(words)
    arguments = parse(words)
    from cassie_bags.ros.replay import run_replay  # loading ROS takes half a second

    run_replay(arguments)
    return 0


def parse(words: Sequence[str]) -> argparse.Namespace:
    """Read the words of a command line."""
    seconds = in_range(0.0, 1e6, "0 s or more")
    parser = CommandParser(
        prog="replay",
        description="Publish the messages of a bag on their topics, with /clock.",
        epilog=f"Keys on a terminal: {KEYS}. Services: /replay/pause (std_srvs/SetBool), "
        "/replay/step (std_srvs/Trigger); parameters rate and position (s), which seeks. With "
        "--verify nothing is published: the bag goes through estimator, supervisor and controller "
        "again, and their answers are compared bit by bit (--verify --help). "
        + exit_codes(
            "ended, also by Ctrl-C",
            "another node began to publish what it plays",
            runs=False,
            node=True,
        ),
    )
    parser.add_argument("file", type=Path, metavar="BAG", help="MCAP file, or folder of ros2 bag")
    parser.add_argument(
        "-r",
        "--rate",
        type=in_range(*RATES, "a rate of {:g} .. {:g}".format(*RATES)),
        default=1.0,
        metavar="RATIO",
        help="ratio of robot time to wall time (default: 1)",
    )
    parser.add_argument(
        "--topics", nargs="+", default=[], metavar="TOPIC", help="play only these topics"
    )
    parser.add_argument(
        "--commands",
        action="store_true",
        help="also play topics that move a robot: motor commands, modes, operator commands",
    )
    parser.add_argument(
        "--allow-second",
        action="store_true",
        help="play although another node publishes on a played topic; the robot's nodes read the "
        "first one alone",
    )
    parser.add_argument("-l", "--loop", action="store_true", help="repeat the playback")
    parser.add_argument(
        "--start",
        "--start-offset",
        type=seconds,
        default=0.0,
        metavar="SECONDS",
        help="begin this time after the first message",
    )
    parser.add_argument(
        "--duration",
        "--playback-duration",
        type=in_range(1e-9, 1e6, "more than 0 s"),
        metavar="SECONDS",
        help="length of the played part",
    )
    parser.add_argument(
        "-p", "--start-paused", action="store_true", help="begin on a key or a service's request"
    )
    parser.add_argument("--disable-keyboard-controls", action="store_true", help="read no keys")
    parser.add_argument(
        "--wait",
        type=seconds,
        default=0.0,
        metavar="SECONDS",
        help="time-out for subscribers, in s (default: 0)",
    )
    return parser.parse_args(words)


if __name__ == "__main__":
    sys.exit(main())
