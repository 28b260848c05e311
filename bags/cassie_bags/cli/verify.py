"""`replay --verify`: whether estimator, supervisor and controller compute the recorded messages."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from cassie_bags.cli.arguments import CommandParser, picture
from cassie_bags.cli.frame import (
    NOT_AS_EXPECTED,
    OK,
    WRONG_INPUT,
    command,
    exit_codes,
    new_file,
)

_PICTURE = Path("replay.png")
"""Picture of what other parameters would have given, in the working folder."""


def _run(arguments: argparse.Namespace) -> int:
    other = bool(arguments.changes or arguments.gaits)
    plot = arguments.plot or (_PICTURE if other else None)
    if plot is not None:
        new_file(plot, "--plot")
    from cassie_bags.bag.output import new_files  # these imports are slow
    from cassie_bags.run.progress import progress_bar
    from cassie_bags.run.verify import START, TOLERANCE, verify
    from cassie_bags.run.yaml_file import consistent

    changes = consistent(arguments.changes)
    with progress_bar("message") as bar:

        def watch(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        verification = verify(arguments.file, changes, arguments.gaits, watch)
    for topic, replayed in verification.replayed.items():
        differing = replayed.different_count()
        result = f"{differing} differ" if differing else "identical"
        count = len(replayed.recorded)
        print(f"{topic:24} {count:7} messages  {result if count else 'none could be replayed'}")
    for first in verification.differences:
        recorded, computed = first.values
        print(
            f"{first.topic}: {first.field} differs first at tick {first.tick} of episode "
            f"{first.episode} ({first.time:.3f} s): recorded {recorded!r}, "
            f"computed {computed!r}"
        )
    if verification.environment_changes:
        print(f"not as recorded: {'; '.join(verification.environment_changes)}")
        print(f"so the first {START:g} s are held to {TOLERANCE:g} in place of the bits: ", end="")
        print("they agree" if verification.holds else "they do NOT agree")
    for gap in verification.gaps:
        print(f"gap: {gap}")
    if verification.damage:
        print(f"replay --verify: {arguments.file} is {verification.damage}", file=sys.stderr)
    if plot is not None:
        from cassie_bags.report.replayed import draw

        with new_files([plot]) as (part,):
            draw(verification, part)
        print(f"picture: {plot}")
    if not verification.compared:
        print("nothing could be verified", file=sys.stderr)
        return WRONG_INPUT
    return OK if verification.holds or other else NOT_AS_EXPECTED


def _parser() -> CommandParser:
    parser = CommandParser(
        prog="replay --verify",
        description="Feed a bag's samples, operator commands and parameters through estimator, "
        "supervisor and controller again, as fast as possible, and compare their states, modes and "
        "motor commands with the recorded ones, to the last bit.",
        epilog=exit_codes("identical", "not"),
    )
    parser.value("file", "BAG", "MCAP file, or folder of ros2 bag", Path)
    parser.flag("--verify", argparse.SUPPRESS)
    parser.value(
        "--with",
        "KEY=VALUE",
        "draw what another parameter would have given on the same data: "
        "controller.walk.joints.kp_knee=500, estimator.…, supervisor.…; or @file.yaml",
        dest="changes",
        action="append",
        default=[],
    )
    gaits = "draw what another gait library would have given on the same data"
    parser.value("--gaits", "FILE", gaits, Path)
    plot = "draw a picture, .png, .svg or .pdf; --with and --gaits draw one in any case "
    parser.value("--plot", "FILE", f"{plot}(default: {_PICTURE})", picture)
    return parser


main = command(_parser, _run)
