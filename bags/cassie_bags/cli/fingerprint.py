"""Command `fingerprint`: whether every trajectory is as it was, to the last bit."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from cassie_bags.cli.arguments import add_jobs
from cassie_bags.cli.frame import exit_codes, play


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of `ros2 run cassie_bags fingerprint`."""
    return play(_parser(), _run, argv)


def _run(arguments: argparse.Namespace) -> int:
    from cassie_bags.run.experiment import load_experiment

    for file in arguments.files:  # what is wrong in one is told before all the rest is loaded
        load_experiment(file)
    from cassie_bags.studies.fingerprints import run

    return run(arguments)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="fingerprint",
        description="Run experiments in one process, without ROS, and hold each topic against "
        "its recorded SHA-256: a change that is meant to change nothing changes none. With other "
        "libraries or another kind of processor the estimated pose in the first "
        "5 s must be the same within tolerances.",
        epilog=exit_codes("as recorded", "not"),
    )
    parser.add_argument("files", nargs="*", type=Path, help="experiments; all of the package")
    parser.add_argument("--fast", action="store_true", help="the first part of a few runs only")
    parser.add_argument("--renew", action="store_true", help="record fingerprints anew")
    parser.add_argument(
        "--bags",
        type=Path,
        metavar="FOLDER",
        help="read bags that the command experiments left here, in place of making these runs",
    )
    parser.add_argument("--file", type=Path, default=None, help="of fingerprints (the package's)")
    add_jobs(parser)
    return parser


if __name__ == "__main__":
    sys.exit(main())
