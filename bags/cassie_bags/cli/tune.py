"""Command `tune`: search for controller parameters for many grounds and robots."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from cassie_bags.cli.arguments import add_jobs, add_out, add_set, count, in_range, positive
from cassie_bags.cli.frame import CommandParser, command, exit_codes, study


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(
        prog="tune",
        description="Search for controller parameters by CMA-ES, in process, on local processes "
        "or a Dask cluster. Ctrl-C keeps the result so far.",
        epilog=exit_codes("done or stopped with a result", ""),
    )
    parser.add_argument(
        "parameters",
        nargs="*",
        metavar="PATTERN",
        help="patterns of controller parameters, such as 'walk.joints.*' (default: the joint, "
        "torso and leg-angle gains)",
    )
    parser.add_argument(
        "--objective",
        type=Path,
        metavar="FILE",
        help="file of courses, model errors and costs (default: the package's)",
    )
    parser.add_argument(
        "--seeds",
        type=positive,
        default=2,
        metavar="N",
        help="new robots in each generation (%(default)s)",
    )
    parser.add_argument(
        "--held-out",
        type=count,
        default=10,
        metavar="N",
        help="other robots for the final report (%(default)s)",
    )
    parser.add_argument(
        "--generations", type=count, default=30, metavar="N", help="total number (%(default)s)"
    )
    parser.add_argument(
        "--population",
        type=_population,
        default=0,
        metavar="N",
        help="size of a generation; 0: auto (0)",
    )
    parser.add_argument(
        "--factor",
        type=in_range(1.01, 100.0, "1.01 .. 100"),
        default=2.0,
        metavar="RATIO",
        help="largest factor on a value, up and down (%(default)s)",
    )
    parser.add_argument(
        "--step",
        type=in_range(0.001, 1.0, "0.001 .. 1"),
        default=0.3,
        metavar="RATIO",
        help="first step as a share of the range (%(default)s)",
    )
    parser.add_argument(
        "--seed", type=positive, default=1, metavar="N", help="seed of the search (%(default)s)"
    )
    add_set(parser, "value for every run; the search begins at controller parameters given here")
    parser.add_argument("--resume", action="store_true", help="continue the search in --out")
    add_jobs(parser, elsewhere=True)
    add_out(parser, "tune")
    return parser


def _population(word: str) -> int:
    if (size := count(word)) == 1:
        raise argparse.ArgumentTypeError("1 is not 0 (auto), or 2 or more")
    return size


main = command(_parser, study("tune.tune"))

if __name__ == "__main__":
    sys.exit(main())
