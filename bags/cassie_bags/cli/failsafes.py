"""Command `failsafes`: test every fail-safe of the robot by faults at random times."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from cassie_bags.cli.arguments import add_jobs, add_number, count, positive
from cassie_bags.cli.frame import CommandParser, command, exit_codes, study


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(
        prog="failsafes",
        description="Test every row of the table of fail-safes at random times, in one process, "
        "and report where the robot does not do what the table promises.",
        epilog=exit_codes("all as the table promises", "some not"),
    )
    parser.add_argument("rows", nargs="*", metavar="ROW", help="rows (default: all)")
    parser.add_argument("--list", action="store_true", help="list all rows and exit")
    add_number(parser, "--phases", positive, 20, "runs of each row")
    add_number(parser, "--first", count, 0, "number of the first run; it decides time and robot")
    add_jobs(parser)
    parser.add_argument(
        "--write",
        type=Path,
        metavar="FILE.md",
        help="write the table into a README and run no test",
    )
    return parser


main = command(_parser, study("failsafes.table"))

if __name__ == "__main__":
    sys.exit(main())
