"""Command `sweep`: measure the robot's abilities, row by row, compared with the paper's law."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from cassie_bags.cli.arguments import (
    add_jobs,
    add_out,
    add_results,
    add_set,
    count,
    positive,
    seconds,
)
from cassie_bags.cli.frame import CommandParser, command, exit_codes, study
from cassie_bags.studies.trial import SEEDS


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(
        prog="sweep",
        description="Measure what the robot can do: a table of target, result, and result with "
        "the paper's own law. Runs in process, without ROS, as fast as possible.",
        epilog=exit_codes("all targets reached", "not all"),
    )
    _add_extent(parser)
    _add_comparison(parser)
    parser.add_argument(
        "--resume", action="store_true", help="leave out what stands in --out already"
    )
    add_jobs(parser, elsewhere=True)
    add_out(parser, "sweeps")
    add_results(parser, "rows that it has are replaced")
    return parser


def _add_extent(parser: argparse.ArgumentParser) -> None:
    """Add the options about the number and length of runs."""
    parser.add_argument(
        "rows", nargs="*", metavar="ROW", help="rows or groups of rows (default: all promised rows)"
    )
    parser.add_argument(
        "--rows",
        type=Path,
        dest="own",
        metavar="FILE.yaml",
        help="rows of your own, all of them if no ROW is named; the README of cassie_bags says how "
        "to write them",
    )
    parser.add_argument(
        "--list",
        action="store_true",
        help="list all rows and exit; `beyond` is the group of rows that are not promised",
    )
    parser.add_argument(
        "--seeds", type=positive, metavar="N", help=f"robots for each setting ({SEEDS})"
    )
    parser.add_argument(
        "--first",
        type=positive,
        default=1,
        metavar="SEED",
        help="seed of the first robot (1); another one makes a column of results of its own",
    )
    parser.add_argument(
        "--phases",
        type=positive,
        metavar="N",
        help="times within two steps for pushes and stops (10)",
    )
    parser.add_argument(
        "--seconds", type=seconds, metavar="S", help="length of the measured part, in s (40)"
    )
    parser.add_argument(
        "--beyond",
        type=count,
        metavar="N",
        help="harder levels to try after a met target (default: until one fails)",
    )
    parser.add_argument(
        "--quick", action="store_true", help="3 seeds, 5 phases, 15 s, where these are not given"
    )


def _add_comparison(parser: argparse.ArgumentParser) -> None:
    """Add the options about the law that is measured."""
    add_set(parser, "value for every run, such as controller.walk.map_gain_y=0.9")
    parser.add_argument(
        "--compare",
        metavar="KEY=VALUE",
        help="measure also with this value, or with the values in @FILE (default: the paper's own "
        "law, with drive gains with which the robot walks)",
    )
    parser.add_argument(
        "--compare-seeds",
        type=positive,
        metavar="N",
        help="robots and times for the comparison (default: as many)",
    )
    parser.add_argument("--no-compare", action="store_true", help="measure without a comparison")


main = command(_parser, study("sweep.measure"))

if __name__ == "__main__":
    sys.exit(main())
