"""Command `fingerprint`: whether every trajectory is unchanged, to the last bit."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from cassie_bags.cli.arguments import add_jobs
from cassie_bags.cli.frame import CommandParser, command, exit_codes


def _run(arguments: argparse.Namespace) -> int:
    from cassie_bags.run.experiment import load_experiment

    for file in arguments.files:  # report errors in files before the slow imports
        load_experiment(file)
    from cassie_bags.studies.fingerprints import run

    return run(arguments)


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(
        prog="fingerprint",
        description="Run experiments in one process, without ROS, and compare each topic with "
        "its recorded SHA-256. A change of structure alone must change none of them. With other "
        "libraries or another kind of processor the estimated pose in the first "
        "5 s must be the same within tolerances.",
        epilog=exit_codes("as recorded", "not"),
    )
    parser.add_argument(
        "files",
        nargs="*",
        type=Path,
        metavar="FILE.yaml",
        help="experiments (default: all of the package)",
    )
    parser.add_argument(
        "--fast", action="store_true", help="run only the first part of a few experiments"
    )
    parser.add_argument("--renew", action="store_true", help="record new fingerprints")
    parser.add_argument(
        "--bags",
        type=Path,
        metavar="FOLDER",
        help="read bags of the command experiment from this folder instead of running them",
    )
    parser.add_argument(
        "--file",
        type=Path,
        metavar="FILE.yaml",
        help="file of fingerprints (default: the package's)",
    )
    add_jobs(parser)
    return parser


main = command(_parser, _run)

if __name__ == "__main__":
    sys.exit(main())
