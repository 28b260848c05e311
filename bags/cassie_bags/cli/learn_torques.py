"""Command `learn_torques`: learn feed-forward torques over repeated steps; measure their effect."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from cassie_bags.cli.arguments import (
    add_jobs,
    add_number,
    add_out,
    add_seeds,
    add_set,
    positive,
    seconds,
)
from cassie_bags.cli.frame import CommandParser, command, exit_codes, study


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(
        prog="learn_torques",
        description="Drawn robots walk at each speed and learn torques over their steps; "
        "their mean is kept. Other robots then walk with and without it, for comparison.",
        epilog=exit_codes("done", "tracking or falls got worse at a speed"),
    )
    add_seeds(parser, "to learn with")
    add_number(parser, "--rounds", positive, 2, "rounds of learning; each begins at the last mean")
    add_number(parser, "--seconds", seconds, 10.0, "time of learning at each speed, in s", "S")
    add_number(parser, "--held-out", positive, 3, "number of other robots for the comparison")
    parser.add_argument("--speeds", type=float, nargs="+", metavar="V", help="speeds in m/s")
    parser.add_argument(
        "--begin",
        type=Path,
        metavar="FILE",
        help="file of torques from which learning begins",
    )
    add_set(parser, "value for every run")
    add_jobs(parser, elsewhere=True)
    add_out(parser, "learn_torques")
    return parser


main = command(_parser, study("learn_torques"))

if __name__ == "__main__":
    sys.exit(main())
