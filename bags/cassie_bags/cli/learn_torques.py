"""Command `learn_torques`: learn feed-forward torques over repeated steps; measure their effect."""

from __future__ import annotations

import sys
from pathlib import Path

from cassie_bags.cli.arguments import CommandParser, positive, seconds
from cassie_bags.cli.frame import command, exit_codes, study


def _parser() -> CommandParser:
    parser = CommandParser(
        prog="learn_torques",
        description="Drawn robots walk at each speed and learn torques over their steps; "
        "their mean is kept. Other robots then walk with and without it, for comparison.",
        epilog=exit_codes("done", "tracking or falls got worse at a speed"),
    )
    parser.seeds("to learn with")
    parser.number("--rounds", positive, 2, "rounds of learning; each begins at the last mean")
    parser.number("--seconds", seconds, 10.0, "time of learning at each speed, in s", "S")
    parser.number("--held-out", positive, 3, "number of other robots for the comparison")
    parser.value("--speeds", "V", "speeds in m/s", float, nargs="+")
    parser.value("--begin", "FILE", "file of torques from which learning begins", Path)
    parser.set("value for every run")
    parser.jobs(elsewhere=True)
    parser.out("learn_torques")
    return parser


main = command(_parser, study("learn_torques"))

if __name__ == "__main__":
    sys.exit(main())
