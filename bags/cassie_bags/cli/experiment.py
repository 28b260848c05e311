"""Command `experiment`: run experiment files, report on them, exit by their expectations."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from cassie_bags.cli.arguments import CommandParser, count, positive
from cassie_bags.cli.frame import command, exit_codes


def _run(arguments: argparse.Namespace) -> int:
    from cassie_bags.run.experiment import load_experiment
    from cassie_bags.run.yaml_file import consistent

    changes = consistent(arguments.set)
    for file in arguments.files:  # report errors in files before the slow imports
        load_experiment(file, changes)
    from cassie_bags.ros.experiments import run

    return run(arguments)


def _parser() -> CommandParser:
    parser = CommandParser(
        prog="experiment",
        description="Run experiment files, with all nodes as processes. For one file it prints a "
        "table on stderr and, where stdout is no terminal, one line of JSON on stdout; for several "
        "files it writes bags, pictures and one page, report.html.",
        epilog=exit_codes("as expected", "not as expected"),
    )
    parser.value("files", "FILE.yaml", "YAML files, see bags/README.md", Path, nargs="*")
    parser.flag("--all", "run all experiments of the package")
    seeds = parser.add_mutually_exclusive_group()
    seeds.add_argument("--seed", type=count, metavar="N", help="seed instead of the file's seed")
    seeds.add_argument(
        "--seeds", type=positive, default=0, metavar="N", help="run each file with seeds 1 to N"
    )
    parser.set("replace a value of the file: controller.walk.law=paper, operator.3.vx=0.6")
    parser.value(
        "--out",
        "FOLDER",
        "keep bag, pictures, table, JSON and page in this folder; of several runs each has a "
        "folder in it (build/experiments). Results of an earlier run are replaced",
        Path,
    )
    how = parser.add_mutually_exclusive_group()
    how.add_argument(
        "--stack", action="store_true", help="estimator and controller in one process, over DDS"
    )
    how.add_argument(
        "--in-process",
        action="store_true",
        help="run without ROS, in one process for each core of the machine, as fast as "
        "possible; the trajectories are the same to the last bit",
    )
    parser.flag("--json", "print one line of JSON on stdout, also on a terminal")
    parser.flag("--no-pictures", "with --out: no pictures")
    parser.flag("--no-video", "with --out: no video")
    parser.jobs()
    return parser


main = command(_parser, _run)

if __name__ == "__main__":
    sys.exit(main())
