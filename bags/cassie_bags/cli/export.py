"""Command `export`: topics of a bag as CSV, Parquet or npz."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from cassie_bags.cli.frame import SAME, answer, bag_argument, stem

FORMATS = ("csv", "parquet", "npz")


def main() -> int:
    """Entry point of `ros2 run cassie_bags export`."""
    parser = argparse.ArgumentParser(
        prog="export",
        description="Write topics of a bag into files for other programs, one for each topic, and "
        "fields.csv with the unit of every column.",
        epilog="Exit codes: 0, 2 for a wrong file or arguments, 130 stopped.",
    )
    parser.add_argument("bag", type=bag_argument, help="MCAP file, or folder that ros2 bag wrote")
    parser.add_argument("--format", choices=FORMATS, default="csv", help="default: csv")
    parser.add_argument(
        "--topics", nargs="+", metavar="TOPIC", default=None, help="topics (default: all)"
    )
    parser.add_argument(
        "-o", "--output", type=Path, default=None, help="folder (default: BAG_FORMAT)"
    )
    arguments = parser.parse_args()
    return answer("export", lambda: _export(arguments))


def _export(arguments: argparse.Namespace) -> int:
    from cassie_bags.bag.export import export
    from cassie_bags.bag.tables import read_tables

    folder = arguments.output or Path(f"{stem(arguments.bag)}_{arguments.format}")
    tables = read_tables(arguments.bag, arguments.topics)
    for table in tables.values():
        for name in table.left_out:
            print(f"export: {table.topic}: {name} is too long, left out", file=sys.stderr)
    files = export(tables, folder, arguments.format)
    count = sum(len(table.log_time) for table in tables.values())
    print(f"{count} messages of {len(tables)} topics in {len(files)} files in {folder}")
    return SAME


if __name__ == "__main__":
    sys.exit(main())
