"""Command `toe_gains`: how the gains of the feet shake a Segway, as a table and a picture."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from cassie_bags.cli.arguments import add_jobs, add_out, add_seeds
from cassie_bags.cli.frame import exit_codes, play


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of `ros2 run cassie_bags toe_gains`."""
    return play(_parser(), _run, argv)


def _run(arguments: argparse.Namespace) -> int:
    from cassie_bags.studies.toe_gains import run

    return run(arguments)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="toe_gains",
        description="Let Cassie stand on a Segway that nobody holds, with gains of the feet from "
        "low to the paper's nominal ones, with the law of standing and that of riding, on softer "
        "and stiffer platforms; print how much the platform shakes and draw toe_gains.png.",
        epilog=exit_codes("the nominal gains shake it three times as much", "they do not"),
    )
    add_seeds(parser, 3, "tried")
    add_jobs(parser)
    add_out(parser, "toe_gains")
    return parser


if __name__ == "__main__":
    sys.exit(main())
