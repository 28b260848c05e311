"""Command `export`: topics of a bag as CSV, Parquet or npz."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from cassie_bags.cli.arguments import CommandParser, one_of
from cassie_bags.cli.frame import OK, command, exit_codes, stem

FORMATS = ("csv", "parquet", "npz")


def _parser() -> CommandParser:
    parser = CommandParser(
        prog="export",
        description="Write topics of a bag into files for other programs, one for each topic, and "
        "fields.csv with the unit of every column.",
        epilog=exit_codes("done", runs=False),
    )
    parser.bag("bag")
    form, words = one_of(FORMATS, "format"), f"{', '.join(FORMATS)} (default csv)"
    parser.value("--format", "csv|npz|parquet", words, form, default="csv")
    parser.value("--topics", "TOPIC", "topics (default: all)", nargs="+")
    parser.output("FOLDER", "target folder (default: BAG_FORMAT)")
    return parser


def _run(arguments: argparse.Namespace) -> int:
    from cassie_bags.bag.export import export, fitting
    from cassie_bags.bag.reader import BagIndex
    from cassie_bags.bag.tables import read_tables
    from cassie_bags.errors import BagError

    folder = arguments.output or Path(f"{stem(arguments.bag)}_{arguments.format}")
    unreadable: dict[str, str] = {}
    index = BagIndex()
    tables = read_tables(arguments.bag, arguments.topics, unreadable, index)
    if index.damage:
        print(f"export: {arguments.bag} is {index.damage}", file=sys.stderr)
    for topic, reason in unreadable.items():
        print(f"export: {topic} is left out: {reason}", file=sys.stderr)
    if not tables:
        raise BagError(f"{arguments.bag}: no topic can be read")
    tables = {topic: fitting(table, arguments.format) for topic, table in tables.items()}
    for table in tables.values():
        for name in table.left_out:
            print(f"export: {table.topic}: {name} is too long, left out", file=sys.stderr)
    for topic in arguments.topics or ():
        if topic not in tables and topic not in unreadable:
            print(f"export: {topic} holds no message: left out", file=sys.stderr)
    files = export(tables, folder, arguments.format)
    count = sum(len(table.log_time) for table in tables.values())
    print(f"{count} messages of {len(tables)} topics in {len(files)} files in {folder}")
    return OK


main = command(_parser, _run)

if __name__ == "__main__":
    sys.exit(main())
