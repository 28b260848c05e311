"""Command `sweep`: measure what the robot can do, row by row, beside the paper's own law."""

from __future__ import annotations

import argparse
import datetime
import sys
from collections.abc import Sequence

from cassie_bags.cli.arguments import add_jobs, add_out, add_results, count, positive, seconds
from cassie_bags.cli.frame import exit_codes, play


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of `ros2 run cassie_bags sweep`."""
    return play(_parser(), _run, argv)


def _run(arguments: argparse.Namespace) -> int:
    from cassie_bags.studies.sweep.measure import run

    return run(arguments, datetime.datetime.now(datetime.timezone.utc))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="sweep",
        description="Measure what the robot can do: a table of target, figure, and the same with "
        "the paper's own law. Runs in process, without ROS, as fast as it goes.",
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
    """How much to run."""
    parser.add_argument(
        "rows", nargs="*", help="rows or groups of rows; if left out, all that are promised"
    )
    parser.add_argument(
        "--list",
        action="store_true",
        help="name all rows and exit; `beyond` is all that are not promised",
    )
    parser.add_argument("--seeds", type=positive, help="robots tried for each setting (10)")
    parser.add_argument(
        "--phases", type=positive, help="moments over two steps for pushes and stops (10)"
    )
    parser.add_argument("--seconds", type=seconds, help="length of the part that is measured (40)")
    parser.add_argument(
        "--beyond",
        type=count,
        help="harder levels to try where a target is met; until one does not hold if left out",
    )
    parser.add_argument(
        "--quick", action="store_true", help="3 seeds, 5 phases, 15 s, unless they are given"
    )


def _add_comparison(parser: argparse.ArgumentParser) -> None:
    """With which law."""
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="for every run: controller.walk.map_gain_y=0.9",
    )
    parser.add_argument(
        "--compare",
        default=None,
        metavar="KEY=VALUE",
        help="measure also with this, or with what stands in @FILE (the paper's own law with "
        "drive gains with which it walks)",
    )
    parser.add_argument(
        "--compare-seeds", type=positive, help="robots and moments for that, if fewer will do"
    )
    parser.add_argument("--no-compare", action="store_true", help="measure only as it is")


if __name__ == "__main__":
    sys.exit(main())
