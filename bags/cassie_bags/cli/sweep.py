"""Command `sweep`: measure the robot's abilities, row by row, compared with the paper's law."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from cassie_bags.cli.arguments import CommandParser, count, positive, seconds
from cassie_bags.cli.frame import command, exit_codes, study
from cassie_bags.errors import ExperimentError
from cassie_bags.studies.trial import SEEDS


def _parser() -> CommandParser:
    parser = CommandParser(
        prog="sweep",
        description="Measure what the robot can do: a table of target, result, and result with "
        "the paper's own law. Runs in process, without ROS, as fast as possible.",
        epilog=exit_codes("all targets reached", "not all"),
    )
    _add_extent(parser)
    _add_comparison(parser)
    parser.flag("--resume", "leave out what stands in --out already")
    parser.jobs(elsewhere=True)
    parser.out("sweeps")
    parser.results("rows that it has are replaced")
    return parser


def _add_extent(parser: CommandParser) -> None:
    """Add the options about the number and length of runs."""
    rows = "rows or groups of rows (default: all promised rows)"
    parser.value("rows", "ROW", rows, nargs="*")
    parser.value(
        "--rows",
        "FILE.yaml",
        "rows of your own, all of them if no ROW is named; the README of cassie_bags says how "
        "to write them",
        Path,
        dest="own",
    )
    listed = "list all rows and exit; `beyond` is the group of rows that are not promised"
    parser.flag("--list", listed)
    parser.value("--seeds", "N", f"robots for each setting ({SEEDS})", positive)
    first = "seed of the first robot (1); another one makes a column of results of its own"
    parser.value("--first", "SEED", first, positive, default=1)
    parser.value("--phases", "N", "times within two steps for pushes and stops (10)", positive)
    parser.value("--seconds", "S", "length of the measured part, in s (40)", seconds)
    beyond = "harder levels to try after a met target (default: until one fails)"
    parser.value("--beyond", "N", beyond, count)
    parser.flag("--quick", "3 seeds, 5 phases, 15 s, where these are not given")


def _add_comparison(parser: CommandParser) -> None:
    """Add the options about the law that is measured."""
    parser.set("value for every run, such as controller.walk.map_gain_y=0.9")
    parser.value(
        "--compare",
        "KEY=VALUE",
        "measure also with this value, or with the values in @FILE (default: the paper's own "
        "law, with drive gains with which the robot walks)",
    )
    compared = "robots and times for the comparison (default: as many)"
    parser.value("--compare-seeds", "N", compared, positive)
    parser.flag("--no-compare", "measure without a comparison")


def _run(arguments: argparse.Namespace) -> int:
    for name in ("compare", "compare_seeds"):
        if arguments.no_compare and getattr(arguments, name) is not None:
            option = f"--{name.replace('_', '-')}"
            raise ExperimentError(f"--no-compare leaves out what {option} is about: give one")
    return study("sweep.measure")(arguments)


main = command(_parser, _run)

if __name__ == "__main__":
    sys.exit(main())
