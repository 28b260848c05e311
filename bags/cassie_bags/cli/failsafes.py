"""Command `failsafes`: let everything around the robot go wrong, and tell what it does."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from cassie_bags.cli.arguments import add_jobs, count, positive
from cassie_bags.cli.frame import exit_codes, play


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of `ros2 run cassie_bags failsafes`."""
    return play(_parser(), _run, argv)


def _run(arguments: argparse.Namespace) -> int:
    from cassie_bags.studies.failsafes.play import run

    return run(arguments)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="failsafes",
        description="Play every row of the table of fail-safes at random moments, in one process, "
        "and tell what was not as the table promises.",
        epilog=exit_codes("all as the table promises", "some not"),
    )
    parser.add_argument("rows", nargs="*", metavar="ROW", help="all of them if none is named")
    parser.add_argument("--list", action="store_true", help="name all rows and exit")
    parser.add_argument("--phases", type=positive, default=20, help="runs of each (default 20)")
    parser.add_argument(
        "--first", type=count, default=0, help="number of the first: draws moment and robot"
    )
    add_jobs(parser)
    parser.add_argument(
        "--write", type=Path, metavar="README", help="write the table into a README and play none"
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
