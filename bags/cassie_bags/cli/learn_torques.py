"""Command `learn_torques`: learn feed-forward torques over repeated steps, and what they bring."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from cassie_bags.cli.arguments import add_jobs, add_out, add_seeds, positive, seconds
from cassie_bags.cli.frame import exit_codes, play


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of `ros2 run cassie_bags learn_torques`."""
    return play(_parser(), _run, argv)


def _run(arguments: argparse.Namespace) -> int:
    from cassie_bags.studies.learn_torques import run

    return run(arguments)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="learn_torques",
        description="Drawn robots walk at each speed and learn torques over their steps; "
        "their mean is kept and held against walking without it, by robots not seen before.",
        epilog=exit_codes("done", "tracking or falls got worse at a speed"),
    )
    add_seeds(parser, 4, "to learn with")
    parser.add_argument("--rounds", type=positive, default=2, help="each from the mean before")
    parser.add_argument("--seconds", type=seconds, default=10.0, help="learned at each speed")
    parser.add_argument("--held-out", type=positive, default=3, help="other robots to report on")
    parser.add_argument("--measured", type=seconds, default=8.0, help="length of their runs in s")
    parser.add_argument("--speeds", type=float, nargs="+", default=None, help="in m/s")
    parser.add_argument("--begin", type=Path, default=None, metavar="FILE", help="learn on from it")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    add_jobs(parser, elsewhere=True)
    add_out(parser, "learn_torques")
    return parser


if __name__ == "__main__":
    sys.exit(main())
