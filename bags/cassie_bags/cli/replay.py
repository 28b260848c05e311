"""Command `replay`: options of the node that plays a bag."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from cassie_bags.bag.playback import RATES
from cassie_bags.cli import verify
from cassie_bags.cli.arguments import CommandParser, in_range
from cassie_bags.cli.frame import exit_codes, node_words

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
    parser.value("file", "BAG", "MCAP file, or folder of ros2 bag", Path)
    rate = in_range(*RATES, "a rate of {:g} .. {:g}".format(*RATES))
    about = "ratio of robot time to wall time (default: 1)"
    parser.value("-r --rate", "RATIO", about, rate, default=1.0)
    parser.value("--topics", "TOPIC", "play only these topics", nargs="+", default=[])
    about = "also play topics that move a robot: motor commands, modes, operator commands"
    parser.flag("--commands", about)
    about = "play although another node publishes on a played topic; the robot's nodes read the "
    parser.flag("--allow-second", f"{about}first one alone")
    parser.flag("-l --loop", "repeat the playback")
    about = "begin this time after the first message"
    parser.value("--start --start-offset", "SECONDS", about, seconds, default=0.0)
    duration = in_range(1e-9, 1e6, "more than 0 s")
    about = "length of the played part"
    parser.value("--duration --playback-duration", "SECONDS", about, duration)
    parser.flag("-p --start-paused", "begin on a key or a service's request")
    parser.flag("--disable-keyboard-controls", "read no keys")
    about = "time-out for subscribers, in s (default: 0)"
    parser.value("--wait", "SECONDS", about, seconds, default=0.0)
    return parser.parse_args(words)


if __name__ == "__main__":
    sys.exit(main())
