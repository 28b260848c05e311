"""Command `tune`: search for controller parameters for many grounds and robots."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from cassie_bags.cli.arguments import (
    add_jobs,
    add_number,
    add_out,
    add_set,
    count,
    in_range,
    positive,
)
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
    add_number(parser, "--robots", positive, 2, "new robots in each generation")
    add_number(parser, "--held-out", count, 10, "other robots for the final report")
    add_number(parser, "--generations", count, 30, "total number")
    add_number(parser, "--population", _population, 0, "size of a generation; 0: auto")
    factor, step = in_range(1.01, 100.0, "1.01 .. 100"), in_range(0.001, 1.0, "0.001 .. 1")
    add_number(parser, "--factor", factor, 2.0, "largest factor on a value, up and down", "RATIO")
    add_number(parser, "--step", step, 0.3, "first step as a share of the range", "RATIO")
    add_number(parser, "--seed", positive, 1, "seed of the search")
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
