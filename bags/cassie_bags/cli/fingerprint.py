"""Command `fingerprint`: whether every trajectory is unchanged, to the last bit."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from cassie_bags.cli.arguments import CommandParser
from cassie_bags.cli.frame import command, exit_codes


def _run(arguments: argparse.Namespace) -> int:
    from cassie_bags.run.experiment import load_experiment

    for file in arguments.files:  # report errors in files before the slow imports
        load_experiment(file)
    from cassie_bags.studies.fingerprints import run

    return run(arguments)


def _parser() -> CommandParser:
    parser = CommandParser(
        prog="fingerprint",
        description="Run experiments in one process, without ROS, and compare each topic with "
        "its recorded SHA-256. A change of structure alone must change none of them. With other "
        "libraries or another kind of processor the estimated pose in the first "
        "5 s must be the same within tolerances.",
        epilog=exit_codes("as recorded", "not"),
    )
    files = "experiments (default: all of the package)"
    parser.value("files", "FILE.yaml", files, Path, nargs="*")
    parser.flag("--fast", "run only the first part of a few experiments")
    parser.flag("--renew", "record new fingerprints")
    bags = "read bags of the command experiment from this folder instead of running them"
    parser.value("--bags", "FOLDER", bags, Path)
    parser.value("--file", "FILE.yaml", "file of fingerprints (default: the package's)", Path)
    parser.jobs()
    return parser


main = command(_parser, _run)

if __name__ == "__main__":
    sys.exit(main())
