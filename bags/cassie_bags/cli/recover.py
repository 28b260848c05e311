"""Command `recover`: make an indexed bag from one that is damaged or was not closed."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from cassie_bags.cli.arguments import CommandParser
from cassie_bags.cli.frame import OK, command, exit_codes


def _parser() -> CommandParser:
    parser = CommandParser(
        prog="recover",
        description="Make an indexed bag from one that is damaged or whose writer was killed.",
        epilog="The bag itself and anything that exists stay as they are. "
        + exit_codes("messages were recovered", runs=False),
    )
    parser.value("file", "BAG", "the damaged bag: a file, or a folder of ros2 bag", Path)
    parser.output("BAG", "new bag (default: FILE_recovered.mcap)")
    return parser


def _run(arguments: argparse.Namespace) -> int:
    from cassie_bags.bag.recover import recover

    source: Path = arguments.file
    place = Path(os.path.realpath(source))  # works also for links in a circle
    ending = "" if source.is_dir() else ".mcap"
    stem = place.name if source.is_dir() else source.stem
    target = arguments.output or place.with_name(f"{stem}_recovered{ending}")
    saved = recover(source, target)
    state = "it was whole" if saved.complete else f"{saved.lost_bytes} bytes could not be read"
    print(f"{saved.messages} messages, {saved.duration:.2f} s saved to {target}; {state}")
    return OK


main = command(_parser, _run)

if __name__ == "__main__":
    sys.exit(main())
