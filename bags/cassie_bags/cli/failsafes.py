"""Command `failsafes`: let everything around the robot go wrong, and tell what it does."""

from __future__ import annotations

import argparse
import signal
import sys
from collections import Counter
from pathlib import Path

from tqdm import tqdm

from cassie_bags.cli.arguments import count, positive
from cassie_bags.errors import RunError
from cassie_bags.studies.failsafes.rows import ROWS
from cassie_bags.studies.failsafes.table import cases, results, with_table
from cassie_bags.studies.workers import available_cores, workers
from cassie_gaits.errors import CassieError

SAFE, UNSAFE, WRONG_INPUT, NO_RUN, STOPPED = 0, 1, 2, 3, 130
"""Exit codes."""


def main() -> int:
    """Entry point of `ros2 run cassie_bags failsafes`."""
    arguments = _arguments()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        if arguments.write is not None:
            text = arguments.write.read_text(encoding="utf-8")
            arguments.write.write_text(with_table(text), encoding="utf-8")
            return SAFE
        return _play(arguments)
    except KeyboardInterrupt:
        print("failsafes: stopped", file=sys.stderr)
        return STOPPED
    except RunError as error:
        print(f"failsafes: error: {error}", file=sys.stderr)
        return NO_RUN
    except (ValueError, OSError, CassieError) as error:
        print(f"failsafes: error: {' '.join(str(error).split())}", file=sys.stderr)
        return WRONG_INPUT


def _play(arguments: argparse.Namespace) -> int:
    rows = [row for row in ROWS if not arguments.rows or row.name in arguments.rows]
    chosen = cases(rows, arguments.phases, arguments.first)
    safe: Counter[tuple[str, str]] = Counter()
    played: Counter[tuple[str, str]] = Counter()
    pool = workers(arguments.jobs, None)
    try:
        with tqdm(total=len(chosen), unit="run", disable=not sys.stderr.isatty()) as bar:
            for case, problem in results(chosen, pool):
                played[case.row, case.state] += 1
                safe[case.row, case.state] += not problem
                if problem:
                    bar.write(
                        f"{case.row}, {case.state}, phase {case.phase}: {problem}", sys.stderr
                    )
                bar.update()
    finally:
        pool.close()
    print(f"{'row':24}{'state':16}safe")
    for (row, state), number in played.items():
        print(f"{row:24}{state:16}{safe[row, state]} of {number}")
    total, good = sum(played.values()), sum(safe.values())
    last = arguments.first + arguments.phases - 1
    print(f"phases {arguments.first} to {last}: {good} of {total} runs as the table promises")
    return SAFE if good == total else UNSAFE


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="failsafes",
        description="Play every row of the table of fail-safes at random moments, in one process, "
        "and tell what was not as the table promises.",
        epilog="Exit codes: 0 all as promised, 1 some not, 2 wrong arguments, 3 a worker died, "
        "130 stopped.",
    )
    names = [row.name for row in ROWS]
    parser.add_argument("rows", nargs="*", metavar="ROW", help=f"all, or of {', '.join(names)}")
    parser.add_argument("--phases", type=positive, default=20, help="runs of each (default 20)")
    parser.add_argument(
        "--first", type=count, default=0, help="number of the first: draws moment and robot"
    )
    parser.add_argument(
        "--jobs", type=positive, default=available_cores(), help="processes; one for each core"
    )
    parser.add_argument(
        "--write", type=Path, metavar="README", help="write the table into a README and play none"
    )
    arguments = parser.parse_args()
    for name in arguments.rows:
        if name not in names:
            parser.error(f"{name} is not a row: {', '.join(names)}")
    return arguments


if __name__ == "__main__":
    sys.exit(main())
