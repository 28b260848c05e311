"""Command `failsafes`: test every fail-safe of the robot by faults at random times."""

from __future__ import annotations

import sys
from pathlib import Path

from cassie_bags.cli.arguments import CommandParser, count, positive
from cassie_bags.cli.frame import command, exit_codes, study


def _parser() -> CommandParser:
    parser = CommandParser(
        prog="failsafes",
        description="Test every row of the table of fail-safes at random times, in one process, "
        "and report where the robot does not do what the table promises.",
        epilog=exit_codes("all as the table promises", "some not"),
    )
    parser.value("rows", "ROW", "rows (default: all)", nargs="*")
    parser.flag("--list", "list all rows and exit")
    parser.number("--phases", positive, 20, "runs of each row")
    parser.number("--first", count, 0, "number of the first run; it decides time and robot")
    parser.jobs()
    parser.value("--write", "FILE.md", "write the table into a README and run no test", Path)
    return parser


main = command(_parser, study("failsafes.table"))

if __name__ == "__main__":
    sys.exit(main())
