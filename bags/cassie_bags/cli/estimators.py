"""Command `estimators`: both state estimators on the same samples, against the truth."""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Iterable

from tqdm import tqdm

from cassie_bags.studies.estimators import GROUNDS, Errors, compare, table
from cassie_gaits.errors import CassieError

DONE, WRONG_INPUT, STOPPED = 0, 2, 130
"""Exit codes."""


def main() -> int:
    """Entry point of `ros2 run cassie_bags estimators`."""
    arguments = _arguments()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    results: list[Errors] = []
    try:
        for ground in arguments.grounds or GROUNDS:
            results += compare(ground, arguments.seed, _progress)
    except KeyboardInterrupt:
        print("estimators: stopped", file=sys.stderr)
        return STOPPED
    except (ValueError, CassieError) as error:
        print(f"estimators: error: {' '.join(str(error).split())}", file=sys.stderr)
        return WRONG_INPUT
    print(f"seed {arguments.seed}; RMS errors against the truth", file=sys.stderr)
    print("\n".join(table(results)))
    return DONE


def _progress(ticks: range) -> Iterable[int]:
    bar: Iterable[int] = tqdm(ticks, unit="tick", disable=not sys.stderr.isatty(), leave=False)
    return bar


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="estimators",
        description="Walk on each ground once, give the recorded samples to both estimators and "
        "print their errors against the truth.",
        epilog="Exit codes: 0 done, 2 wrong arguments, 130 stopped.",
    )
    parser.add_argument("grounds", nargs="*", metavar="GROUND", help=f"of {', '.join(GROUNDS)}")
    parser.add_argument("--seed", type=int, default=1, help="robot and noise drawn (default 1)")
    arguments = parser.parse_args()
    for ground in arguments.grounds:
        if ground not in GROUNDS:
            parser.error(f"unknown ground {ground}: choose from {', '.join(GROUNDS)}")
    if arguments.seed < 0:
        parser.error(f"--seed = {arguments.seed} is outside 0 .. inf")
    return arguments


if __name__ == "__main__":
    sys.exit(main())
