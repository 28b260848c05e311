"""Command `return_map`: how deviations by small pushes decay from step to step, for each gait."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from cassie_bags.cli.arguments import add_jobs, add_number, add_results, add_seed
from cassie_bags.cli.frame import CommandParser, command, exit_codes, study


def _parser() -> argparse.ArgumentParser:
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
    add = parser.add_argument
    library = "gait library: a file, optimized (default) or dense"
    add("file", nargs="?", metavar="FILE", help=library)
    add(
        "--speeds",
        nargs="+",
        type=float,
        metavar="V",
        help="m/s (default: those of the library's gaits)",
    )
    add_seed(parser, 0)
    add_number(parser, "--impulse", float, 4.0, "impulse of each push, in N s", "NS")
    add_jobs(parser)
    add(
        "--out", type=Path, metavar="FOLDER", help="draw the decay into this folder: return_map.png"
    )
    add_results(parser, "all speeds of the package's library")
    add("--allow-uncertified", action="store_true", help="allow a library without certificates")
    return parser


main = command(_parser, study("return_map_run"))

if __name__ == "__main__":
    sys.exit(main())
