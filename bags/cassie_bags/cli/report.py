"""Command `report`: one page about recorded runs."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from cassie_bags.cli.frame import DIFFERENT, SAME, answer, bag_argument, new_file, stem


def main() -> int:
    """Entry point of `ros2 run cassie_bags report`."""
    parser = argparse.ArgumentParser(
        prog="report",
        description="Make one page of recorded runs, of experiments or drives by hand: what was "
        "expected and what came, modes, tracking, outputs, forces, torques, estimate, footsteps, "
        "images and a video. Up to three bags stand side by side.",
        epilog="Exit codes: 0, 1 if an experiment was not as expected, 2 for a wrong file or "
        "arguments, 130 stopped.",
    )
    parser.add_argument(
        "bags", nargs="+", metavar="BAG", type=bag_argument, help="MCAP file, or folder of ros2 bag"
    )
    parser.add_argument(
        "-o", "--output", type=Path, default=Path("report.html"), help="default: report.html"
    )
    parser.add_argument("--no-video", action="store_true", help="leave the video out")
    arguments = parser.parse_args()
    return answer("report", lambda: _report(arguments))


def _report(arguments: argparse.Namespace) -> int:
    path = new_file(arguments.output)
    from cassie_bags.report.page import page
    from cassie_bags.report.recorded import recorded_entry
    from cassie_bags.run.provenance import versions

    with TemporaryDirectory(prefix="cassie_") as folder:
        entries = [
            recorded_entry(bag, stem(bag), Path(folder, str(index)), film=not arguments.no_video)
            for index, bag in enumerate(arguments.bags)
        ]
        title = "Cassie: " + ", ".join(dict.fromkeys(entry["name"] for entry in entries))
        text = page(title, entries, versions())
    path.write_text(text, encoding="utf-8")
    print(f"{path}: {len(text) / 1e6:.1f} MB")
    return DIFFERENT if any(entry.get("passed") is False for entry in entries) else SAME


if __name__ == "__main__":
    sys.exit(main())
