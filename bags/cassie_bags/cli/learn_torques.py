"""Command `learn_torques`: learn feed-forward torques over repeated steps; measure their effect."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from cassie_bags.cli.arguments import add_jobs, add_out, add_seeds, add_set, positive, seconds
from cassie_bags.cli.frame import CommandParser, command, exit_codes, study


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(
        prog="learn_torques",
        description="Drawn robots walk at each speed and learn torques over their steps; "
        "their mean is kept. Other robots then walk with and without it, for comparison.",
        epilog=exit_codes("done", "tracking or falls got worse at a speed"),
    )
    add_seeds(parser, 4, "to learn with")
    parser.add_argument(
        "--rounds",
        type=positive,
        default=2,
        metavar="N",
        help="rounds of learning; each begins at the last mean (default 2)",
    )
    parser.add_argument(
        "--seconds",
        type=seconds,
        default=10.0,
        metavar="S",
        help="time of learning at each speed, in s (default 10)",
    )
    parser.add_argument(
        "--held-out",
        type=positive,
        default=3,
        metavar="N",
        help="number of other robots for the comparison (default 3)",
    )
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
