"""Command `record`: options of the recorder."""

from __future__ import annotations

import argparse
import re
import time
from collections.abc import Sequence
from pathlib import Path

from cassie_bags.cli.arguments import CommandParser, count, in_range, one_of
from cassie_bags.cli.frame import exit_codes, node_words

MIB = 1 << 20
"""Bytes of a MiB."""

LEAST_SIZE = 1_000_000
"""Least size of a file of a folder, in bytes: definitions alone have 100 000."""


def main(argv: Sequence[str] | None = None) -> None:
    """Entry point of `ros2 run cassie_bags record`."""
    arguments = parse(node_words("record") if argv is None else argv)
    from cassie_bags.ros.record import run_recorder  # loading ROS takes half a second

    run_recorder(arguments)


def parse(words: Sequence[str]) -> argparse.Namespace:
    """Read the words of a command line."""
    parser = CommandParser(
        prog="record",
        description="Record topics into an MCAP bag until Ctrl-C.",
        epilog="While it runs, the services /recorder/record (std_srvs/SetBool) end this recording "
        "and begin the next one, and /recorder/split (std_srvs/Trigger) begins the next file. "
        + exit_codes("ended, also by Ctrl-C", "the disk is full, or nearly", runs=False, node=True),
    )
    parser.value("names", "TOPIC", "topics to record (as with --topics)", _topic, nargs="*")
    about = "topics to record (default: the control lane and the usual ones)"
    parser.value("--topics", "TOPIC", about, _topic, nargs="+", default=[])
    about = "file NAME.mcap, or a folder as ros2 bag writes it (default: cassie_DATE_TIME.mcap)"
    parser.output("NAME.mcap|FOLDER", about)
    parser.flag("-a --all", "record every topic")
    times = parser.add_mutually_exclusive_group()
    times.add_argument(
        "--use-sim-time", action="store_true", help="log_time is robot time (default)"
    )
    times.add_argument(
        "--wall-clock", action="store_true", help="log_time is wall time instead of robot time"
    )
    about = f"bytes after which a new file begins: {LEAST_SIZE} or more"
    parser.value("-b --max-bag-size", "BYTES", about, _size, default=0)
    about = "seconds of log_time after which a new file begins"
    parser.value("-d --max-bag-duration", "SECONDS", about, count, default=0)
    compression = one_of(("zstd", "none"), "compression")
    about = "compression of the chunks: zstd or none (default zstd)"
    parser.value("--compression-format", "zstd|none", about, compression, default="zstd")
    parser.flag("--start-paused", "begin when /recorder/record asks for it")
    about = "end when less space is free on the disk (default: 100)"
    parser.value("--min-free-space", "MIB", about, _mebibytes, default=100 * MIB)
    parser.value("--metadata", "FILE", "YAML file of records to put into the bag", Path)
    arguments = parser.parse_args(words)
    arguments.topics = [*arguments.names, *arguments.topics]
    if arguments.all and arguments.topics:
        parser.error(f"--all records every topic: leave out {arguments.topics[0]}, or --all")
    split = arguments.max_bag_size or arguments.max_bag_duration
    if arguments.output is None:
        name = time.strftime("cassie_%Y-%m-%d_%H-%M-%S")
        arguments.output = Path(name if split else f"{name}.mcap")
    elif split and is_file(arguments.output):
        parser.error(f"several files need a folder, not {arguments.output}: -o FOLDER")
    return arguments


def _topic(word: str) -> str:
    """A topic from a command line, with its leading slash.

    Raises:
        argparse.ArgumentTypeError: if ROS permits no such name.
    """
    topic = word if word.startswith("/") else f"/{word}"
    if not re.fullmatch(r"(/[A-Za-z_][A-Za-z0-9_]*)+", topic):
        raise argparse.ArgumentTypeError(f"{word} is no name of a topic")
    return topic


def _size(word: str) -> int:
    """Size of a file; 0 for any.

    Raises:
        argparse.ArgumentTypeError: if the file could hold little more than definitions.
    """
    size = count(word)
    if 0 < size < LEAST_SIZE:
        raise argparse.ArgumentTypeError(f"{word} is less than {LEAST_SIZE} bytes")
    return size


def _mebibytes(word: str) -> int:
    return int(in_range(0.0, 1e9, "0 MiB or more")(word) * MIB)


def is_file(output: Path) -> bool:
    """Whether an output is one file, not a folder."""
    return output.suffix == ".mcap"


if __name__ == "__main__":
    main()
