"""Command `recover`: an indexed bag out of one that is damaged or was not closed."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from cassie_bags.bag.recover import recover
from cassie_bags.cli.frame import SAME, answer


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of `ros2 run cassie_bags recover`."""
    parser = argparse.ArgumentParser(
        prog="recover",
        description="Make an indexed bag of one that is damaged or whose writer was killed.",
        epilog="Exit codes: 0 something was saved, 2 nothing was or wrong arguments, 130 stopped. "
        "The bag itself and anything that exists stay as they are.",
    )
    parser.add_argument("file", type=Path, help="the damaged bag: a file, or a folder of ros2 bag")
    parser.add_argument(
        "-o", "--output", type=Path, default=None, help="new bag (default: FILE_recovered.mcap)"
    )
    arguments = parser.parse_args(argv)
    return answer("recover", lambda: _recover(arguments.file, arguments.output))


def _recover(source: Path, output: Path | None) -> int:
    ending = "" if source.is_dir() else ".mcap"
    stem = source.resolve().name if source.is_dir() else source.stem
    target = output or source.resolve().with_name(f"{stem}_recovered{ending}")
    saved = recover(source, target)
    state = "it was whole" if saved.complete else f"{saved.lost_bytes} bytes could not be read"
    print(f"{saved.messages} messages, {saved.duration:.2f} s saved to {target}; {state}")
    return SAME


if __name__ == "__main__":
    sys.exit(main())
