"""Command `recover`: an indexed bag out of one whose writer was killed."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from cassie_bags.bag.recover import recover
from cassie_bags.errors import BagError


def main() -> int:
    """Entry point of `ros2 run cassie_bags recover`."""
    parser = argparse.ArgumentParser(
        prog="recover", description="Make an indexed bag of one whose writer was killed."
    )
    parser.add_argument("file", type=Path, help="the damaged bag; it is not changed")
    parser.add_argument(
        "-o", "--output", type=Path, default=None, help="new bag (default: FILE_recovered.mcap)"
    )
    arguments = parser.parse_args()
    source: Path = arguments.file
    target = arguments.output or source.with_name(f"{source.stem}_recovered.mcap")
    try:
        saved = recover(source, target)
    except BagError as error:
        print(f"recover: error: {error}", file=sys.stderr)
        return 2
    state = "it was whole" if saved.complete else f"{saved.lost_bytes} bytes could not be read"
    print(f"{saved.messages} messages, {saved.duration:.2f} s saved to {target}; {state}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
