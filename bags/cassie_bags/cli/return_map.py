"""Command `return_map`: how deviations by small pushes decay from step to step, for each gait."""

from __future__ import annotations

import sys
from pathlib import Path

from cassie_bags.cli.arguments import CommandParser
from cassie_bags.cli.frame import command, exit_codes, study


def _parser() -> CommandParser:
    parser = CommandParser(
        prog="return_map",
        description="Push Cassie gently while it walks and compare each touchdown with that of "
        "the same run without the push. A deviation d is the norm of the differences in the CoM's "
        "velocity and in its place over the stance foot (times sqrt(g/h)); the table has its "
        "median over the pushes by what it was at the first touchdown, and the eigenvalues' "
        "magnitudes of the map of two steps that fits the deviations.",
        epilog=exit_codes(
            "the last d of every gait is below 1 and no push made it fall or lose step",
            "this is not so of one",
        ),
    )
    library = "gait library: a file, dense (default) or optimized"
    parser.value("file", "FILE", library, nargs="?")
    speeds = "m/s (default: those of FILE, else the paper's)"
    parser.value("--speeds", "V", speeds, float, nargs="+")
    parser.seed(0)
    parser.number("--impulse", float, 4.0, "impulse of each push, in N s", "NS")
    parser.jobs()
    parser.value("--out", "FOLDER", "draw the decay into this folder: return_map.png", Path)
    parser.results("all speeds of the package's library")
    parser.flag("--allow-uncertified", "allow a library without certificates")
    return parser


main = command(_parser, study("return_map"))

if __name__ == "__main__":
    sys.exit(main())
