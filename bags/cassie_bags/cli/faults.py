"""Command `faults`: let every sensor fail in every way and measure the reaction of Cassie."""

from __future__ import annotations

import argparse
import sys

from cassie_bags.cli.arguments import add_jobs, add_results, add_seed, one_of
from cassie_bags.cli.frame import CommandParser, command, exit_codes, study


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(
        prog="faults",
        description="Let sensors fail while Cassie stands and walks; print a table of what Cassie "
        "does, and of the time from the error's bound until the channel is reported.",
        epilog=exit_codes("all faults end safely and are reported within 100 ms", "some do not"),
    )
    parser.add_argument(
        "channels",
        nargs="*",
        type=_channel,
        metavar="CHANNEL",
        help="such as drive_position.3 (default: all)",
    )
    parser.add_argument(
        "--kinds",
        nargs="+",
        type=_kind,
        metavar="KIND",
        help="off, stuck, nan, spike, delay (default: all)",
    )
    parser.add_argument(
        "--modes", nargs="+", metavar="MODE", help="standing, walking (default: both)"
    )
    add_seed(parser, 1)
    add_jobs(parser)
    add_results(parser, "all channels, kinds and modes")
    return parser


def _channel(word: str) -> str:
    from cassie_control.estimator.channels import CHANNELS

    return one_of([name for name, _ in CHANNELS], "channel")(word)


def _kind(word: str) -> str:
    from cassie_msgs.experiment.scenario import FAULT_KINDS

    return one_of(FAULT_KINDS, "kind")(word)


main = command(_parser, study("faults"))

if __name__ == "__main__":
    sys.exit(main())
