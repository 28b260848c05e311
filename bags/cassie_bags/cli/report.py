"""Command `report`: one page about recorded runs."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from cassie_bags.cli.arguments import CommandParser
from cassie_bags.cli.frame import NOT_AS_EXPECTED, OK, command, exit_codes, labels, new_file


def _parser() -> CommandParser:
    parser = CommandParser(
        prog="report",
        description="Make one page about recorded runs, of experiments or drives by hand: "
        "expectations and results, modes, tracking, outputs, forces, torques, estimate, footsteps, "
        "images and a video. Up to three bags stand side by side.",
        epilog=exit_codes("done", "an experiment was not as expected", runs=False),
    )
    parser.bag("bags", nargs="+")
    default = Path("report.html")
    parser.output("FILE.html", f"the page (default: {default})", _page, default)
    parser.flag("--no-video", "make no video")
    return parser


def _run(arguments: argparse.Namespace) -> int:
    path = new_file(arguments.output)
    from cassie_bags.bag.output import new_files
    from cassie_bags.report.page import page
    from cassie_bags.report.recorded import recorded_entry
    from cassie_bags.run.provenance import versions

    names = labels(arguments.bags)
    with TemporaryDirectory(prefix="cassie_") as folder:
        entries = [
            recorded_entry(bag, name, Path(folder, str(index)), film=not arguments.no_video)
            for index, (bag, name) in enumerate(zip(arguments.bags, names, strict=True))
        ]
        title = "Cassie: " + ", ".join(dict.fromkeys(entry["name"] for entry in entries))
        text = page(title, entries, versions())
    with new_files([path]) as (part,):
        part.write_text(text, encoding="utf-8")
    print(f"{path}: {len(text) / 1e6:.1f} MB")
    failed = any(entry.get("passed") is False for entry in entries)
    return NOT_AS_EXPECTED if failed else OK


def _page(word: str) -> Path:
    if Path(word).suffix not in (".html", ".htm"):
        raise argparse.ArgumentTypeError(f"{word} does not end in .html")
    return Path(word)


main = command(_parser, _run)

if __name__ == "__main__":
    sys.exit(main())
