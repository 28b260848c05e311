"""Command `compare`: whether two bags are the same, and where they first differ."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from cassie_bags.cli.frame import (
    NOT_AS_EXPECTED,
    OK,
    bag_argument,
    exit_codes,
    labels,
    new_file,
    picture,
    run_command,
)
from cassie_bags.errors import BagError

if TYPE_CHECKING:
    from cassie_bags.bag.summary import Summary


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of `ros2 run cassie_bags compare`."""
    return run_command(_parser(), _run, argv)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="compare",
        description="Say whether two bags hold the same samples, where they first differ, and how "
        "much the metrics of the runs differ.",
        epilog=exit_codes("the same", "different", runs=False),
    )
    for name in ("a", "b"):
        parser.add_argument(
            name, metavar=name.upper(), type=bag_argument, help="MCAP file, or folder of ros2 bag"
        )
    parser.add_argument(
        "-o", "--output", type=picture, default=None, help="also plot both: .png, .svg or .pdf"
    )
    return parser


def _run(arguments: argparse.Namespace) -> int:
    path = None if arguments.output is None else new_file(arguments.output)
    from cassie_bags.bag.comparison import compare_recordings
    from cassie_bags.bag.summary import summarize
    from cassie_bags.report.compared import comparison_text, in_one_bag

    summaries = summarize(arguments.a), summarize(arguments.b)
    one, other = summaries
    topics = compare_recordings(one.recording, other.recording)
    metrics: tuple[dict[str, float], dict[str, float]] | str
    try:
        metrics = _metrics_of(one), _metrics_of(other)
    except BagError as error:
        metrics = str(error)
    print(comparison_text(summaries, topics, metrics))
    if path is not None:
        from cassie_bags.output import new_files
        from cassie_bags.report.plots import save_overlay
        from cassie_bags.report.view import view_of

        a, b = (
            view_of(summary.recording, name, None, summary)
            for summary, name in zip(summaries, labels((arguments.a, arguments.b)), strict=True)
        )
        with new_files([path]) as (part,):
            save_overlay(a, b, part)
        print(path)
    same = all(topic.same for topic in topics) and not in_one_bag(summaries)
    return OK if same else NOT_AS_EXPECTED


def _metrics_of(summary: Summary) -> dict[str, float]:
    """Metrics of a run by name.

    Raises:
        BagError: if the run cannot be measured.
    """
    from cassie_bags.signals.metrics import measure
    from cassie_bags.signals.track import make_track

    return measure(summary.recording, make_track(summary.recording), ()).run


if __name__ == "__main__":
    sys.exit(main())
