"""Command `plot`: a bag's fields over time, or the standard set of plots."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from cassie_bags.cli.arguments import CommandParser, picture
from cassie_bags.cli.frame import OK, command, exit_codes, new_file, stem


def _parser() -> CommandParser:
    parser = CommandParser(
        prog="plot",
        description="Draw fields of a bag over time, or without a field the modes, tracking, "
        "forces and torques of the run.",
        epilog="Fields are those of export: state.q.yaw, sensors.drive_torque, "
        "/imu/data.linear_acceleration.x. " + exit_codes("done", runs=False),
    )
    parser.bag("bag")
    words = "one panel each; /cassie/ may be left out"
    parser.value("fields", "TOPIC.FIELD", words, nargs="*")
    parser.output("FILE", ".png, .svg or .pdf (default: BAG.png)", picture)
    return parser


def _run(arguments: argparse.Namespace) -> int:
    name = stem(arguments.bag)
    path = new_file(arguments.output or Path(f"{name}.png"))
    from cassie_bags.bag.output import new_files
    from cassie_bags.bag.summary import summarize
    from cassie_bags.bag.tables import read_curves
    from cassie_bags.report.plots import save_curves, save_overview
    from cassie_bags.report.view import events_of_bag, view_of_bag

    curves = read_curves(arguments.bag, arguments.fields) if arguments.fields else []
    summary = summarize(arguments.bag)
    if summary.damage:
        print(f"plot: {arguments.bag} is {summary.damage}", file=sys.stderr)
    if curves:
        events = events_of_bag(summary)
        with new_files([path]) as (part,):
            save_curves(curves, summary.modes, events, name, part)
    else:
        view = view_of_bag(arguments.bag, name, summary)
        with new_files([path]) as (part,):
            save_overview(view, part)
    print(path)
    return OK


main = command(_parser, _run)

if __name__ == "__main__":
    sys.exit(main())
