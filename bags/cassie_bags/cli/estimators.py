"""Command `estimators`: both state estimators on the same samples, compared with the truth."""

from __future__ import annotations

import argparse
import sys

from cassie_bags.cli.arguments import add_results, add_seed
from cassie_bags.cli.frame import CommandParser, command, exit_codes, study


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(
        prog="estimators",
        description="Walk on each ground once, give the recorded samples to both estimators and "
        "print their errors against the truth.",
        epilog=exit_codes("done", ""),
    )
    parser.add_argument("grounds", nargs="*", metavar="GROUND", help="grounds (default: all)")
    add_seed(parser, 1)
    add_results(parser, "all grounds")
    return parser


main = command(_parser, study("estimators"))

if __name__ == "__main__":
    sys.exit(main())
