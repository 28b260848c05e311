"""Command `compare`: whether two bags are the same, and where they first differ."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from cassie_bags.cli.arguments import CommandParser, picture
from cassie_bags.cli.frame import NOT_AS_EXPECTED, OK, command, exit_codes, labels, new_file
from cassie_bags.errors import BagError

if TYPE_CHECKING:
    from cassie_bags.bag.recording import Recording
    from cassie_bags.bag.summary import Summary


def _parser() -> CommandParser:
    parser = CommandParser(
        prog="compare",
        description="Say whether two bags hold the same samples, where they first differ, and how "
        "much the metrics of the runs differ.",
        epilog=exit_codes("the same", "different", runs=False),
    )
    for name in ("a", "b"):
        parser.bag(name, name.upper())
    parser.output("FILE", "also plot both: .png, .svg or .pdf", picture)
    return parser


def _run(arguments: argparse.Namespace) -> int:
    path = None if arguments.output is None else new_file(arguments.output)
    from cassie_bags.bag.comparison import compare_recordings
    from cassie_bags.bag.summary import summarize
    from cassie_bags.report.compared import comparison_text, in_one_bag

    summaries = summarize(arguments.a), summarize(arguments.b)
    one, other = summaries
    for bag, summary in zip((arguments.a, arguments.b), summaries, strict=True):
        if summary.damage:
            print(f"compare: {bag} is {summary.damage}", file=sys.stderr)
    topics = compare_recordings(one.recording, other.recording)
    recordings, note = _with_poses(one, other)
    metrics: tuple[dict[str, float], dict[str, float]] | str
    try:
        metrics = _metrics_of(recordings[0]), _metrics_of(recordings[1])
    except BagError as error:
        metrics = str(error)
    print(comparison_text(summaries, topics, metrics, note))
    if path is not None:
        from cassie_bags.bag.output import new_files
        from cassie_bags.report.plots import save_overlay
        from cassie_bags.report.view import view_of

        a, b = (
            view_of(recording, name, None, summary)
            for recording, name, summary in zip(
                recordings, labels((arguments.a, arguments.b)), summaries, strict=True
            )
        )
        with new_files([path]) as (part,):
            save_overlay(a, b, part)
        print(path)
    same = all(topic.same for topic in topics) and not in_one_bag(summaries)
    return OK if same else NOT_AS_EXPECTED


def _with_poses(one: Summary, other: Summary) -> tuple[tuple[Recording, Recording], str]:
    """Recordings with a pose of one kind, and a note if it is the estimated one.

    If a bag has no true pose, the estimated pose replaces the true one in both.
    """
    from cassie_bags.signals.track import with_estimate_as_truth

    recordings = one.recording, other.recording
    blind = [name for name, each in zip("AB", recordings, strict=True) if not len(each.truth)]
    if not blind:
        return recordings, ""
    holders = "A and B hold" if len(blind) == 2 else f"{blind[0]} holds"
    note = f"{holders} no true pose: the figures of both are from the estimate"
    return (with_estimate_as_truth(recordings[0]), with_estimate_as_truth(recordings[1])), note


def _metrics_of(recording: Recording) -> dict[str, float]:
    """Metrics of a run by name.

    Raises:
        BagError: if the run cannot be measured.
    """
    from cassie_bags.signals.metrics import measure
    from cassie_bags.signals.track import make_track

    return measure(recording, make_track(recording), ()).run


main = command(_parser, _run)

if __name__ == "__main__":
    sys.exit(main())
