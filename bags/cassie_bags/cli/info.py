"""Command `info`: what is in a bag."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from cassie_bags.cli.frame import SAME, answer, bag_argument


def main() -> int:
    """Entry point of `ros2 run cassie_bags info`."""
    parser = argparse.ArgumentParser(
        prog="info",
        description="Say what is in a bag: duration, topics and their rates, missing samples, "
        "episodes, modes over time, faults, falls, what was drawn, versions.",
        epilog="Exit codes: 0, or 2 for a wrong file or arguments.",
    )
    parser.add_argument("bag", type=bag_argument, help="MCAP file, or folder that ros2 bag wrote")
    parser.add_argument("--json", action="store_true", help="one line of JSON instead of text")
    arguments = parser.parse_args()
    return answer("info", lambda: _info(arguments.bag, as_json=arguments.json))


def _info(bag: Path, *, as_json: bool) -> int:
    from cassie_bags.bag.summary import summarize
    from cassie_bags.report.summary import summary_json, summary_text
    from cassie_bags.signals.falls import falls

    summary = summarize(bag)
    found = falls(summary.recording)
    print(summary_json(summary, found) if as_json else summary_text(summary, found))
    return SAME


if __name__ == "__main__":
    sys.exit(main())
