"""Command `tune`: search for controller parameters for many grounds and robots."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from cassie_bags.cli.arguments import CommandParser, count, in_range, positive
from cassie_bags.cli.frame import command, exit_codes, study


def _parser() -> CommandParser:
    parser = CommandParser(
        prog="tune",
        description="Search for controller parameters by CMA-ES, in process, on local processes "
        "or a Dask cluster. Ctrl-C keeps the result so far.",
        epilog=exit_codes("done or stopped with a result", ""),
    )
    patterns = "patterns of controller parameters, such as 'walk.joints.*' (default: the joint, "
    parser.value("parameters", "PATTERN", f"{patterns}torso and leg-angle gains)", nargs="*")
    objective = "file of courses, model errors and costs (default: the package's)"
    parser.value("--objective", "FILE", objective, Path)
    parser.number("--robots", positive, 2, "new robots in each generation")
    parser.number("--held-out", count, 10, "other robots for the final report")
    parser.number("--generations", count, 30, "total number")
    parser.number("--population", _population, 0, "size of a generation; 0: auto")
    factor, step = in_range(1.01, 100.0, "1.01 .. 100"), in_range(0.001, 1.0, "0.001 .. 1")
    parser.number("--factor", factor, 2.0, "largest factor on a value, up and down", "RATIO")
    parser.number("--step", step, 0.3, "first step as a share of the range", "RATIO")
    parser.number("--seed", positive, 1, "seed of the search")
    parser.set("value for every run; the search begins at controller parameters given here")
    parser.flag("--resume", "continue the search in --out")
    parser.jobs(elsewhere=True)
    parser.out("tune")
    return parser


def _population(word: str) -> int:
    if (size := count(word)) == 1:
        raise argparse.ArgumentTypeError("1 is not 0 (auto), or 2 or more")
    return size


main = command(_parser, study("tune.tune"))

if __name__ == "__main__":
    sys.exit(main())
