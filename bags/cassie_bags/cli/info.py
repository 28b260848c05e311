"""Command `info`: summary of a bag."""

from __future__ import annotations

import argparse
import sys

from cassie_bags.cli.arguments import CommandParser
from cassie_bags.cli.frame import OK, command, exit_codes


def _parser() -> CommandParser:
    parser = CommandParser(
        prog="info",
        description="Say what is in a bag: duration, topics and their rates, missing samples, "
        "episodes, modes over time, faults, falls, values drawn, versions.",
        epilog=exit_codes("done", runs=False),
    )
    parser.bag("bag")
    parser.flag("--json", "print one line of JSON instead of text")
    return parser


def _run(arguments: argparse.Namespace) -> int:
    from cassie_bags.bag.summary import summarize
    from cassie_bags.report.summary import summary_json, summary_text
    from cassie_bags.signals.falls import falls

    summary = summarize(arguments.bag)
    fall_times = falls(summary.recording)
    print(
        summary_json(summary, fall_times) if arguments.json else summary_text(summary, fall_times)
    )
    return OK


main = command(_parser, _run)

if __name__ == "__main__":
    sys.exit(main())
