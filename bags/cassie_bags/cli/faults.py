"""Command `faults`: let every sensor fail in every way and measure the reaction of Cassie."""

from __future__ import annotations

import sys

from cassie_bags.cli.arguments import CommandParser, one_of
from cassie_bags.cli.frame import command, exit_codes, study


def _parser() -> CommandParser:
    parser = CommandParser(
        prog="faults",
        description="Let sensors fail while Cassie stands and walks; print a table of what Cassie "
        "does, and of the time from the error's bound until the channel is reported.",
        epilog=exit_codes("all faults end safely and are reported within 100 ms", "some do not"),
    )
    channels = "such as drive_position.3 (default: all)"
    parser.value("channels", "CHANNEL", channels, _channel, nargs="*")
    kinds = "off, stuck, nan, spike, delay (default: all)"
    parser.value("--kinds", "KIND", kinds, _kind, nargs="+")
    parser.value("--modes", "MODE", "standing, walking (default: both)", nargs="+")
    parser.seed(1)
    parser.jobs()
    parser.results("all channels, kinds and modes")
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
