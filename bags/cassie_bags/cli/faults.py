"""Command `faults`: let every sensor fail in every way and tell what becomes of Cassie."""

from __future__ import annotations

import argparse
import signal
import sys

from tqdm import tqdm

from cassie_bags.cli.arguments import count, positive
from cassie_bags.errors import RunError
from cassie_bags.studies.faults import MODES, Cell, all_channels, run_table, table
from cassie_bags.studies.workers import available_cores
from cassie_gaits.errors import CassieError
from cassie_msgs.tunables import unknown_name
from cassie_sim.scenario import FAULT_KINDS

SAFE, UNSAFE, WRONG_INPUT, NO_RUN, STOPPED = 0, 1, 2, 3, 130
"""Exit codes."""


def main() -> int:
    """Entry point of `ros2 run cassie_bags faults`."""
    arguments = _arguments()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    channels = arguments.channels or all_channels()
    total = len(channels) * len(arguments.kinds) * len(arguments.modes)
    cells: list[Cell] = []
    try:
        cells.extend(
            tqdm(
                run_table(
                    channels, arguments.kinds, arguments.modes, arguments.seed, arguments.jobs
                ),
                total=total,
                unit="fault",
                disable=not sys.stderr.isatty(),
                leave=False,
            )
        )
    except KeyboardInterrupt:
        print("faults: stopped", file=sys.stderr)
        return STOPPED
    except RunError as error:
        print(f"faults: error: {error}", file=sys.stderr)
        return NO_RUN
    except (ValueError, CassieError) as error:
        print(f"faults: error: {' '.join(str(error).split())}", file=sys.stderr)
        return WRONG_INPUT
    print("\n".join(table(cells)))
    unsafe = [cell for cell in cells if not cell.safe]
    print(f"seed {arguments.seed}: {len(cells) - len(unsafe)} of {len(cells)} safe and in time")
    return UNSAFE if unsafe else SAFE


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="faults",
        description="Let sensors fail while Cassie stands and walks; print a table of what she "
        "does and how long after the error's bound the channel is reported.",
        epilog="Exit codes: 0 all faults end safely and are reported within 100 ms, 1 some do not, "
        "2 wrong arguments, 3 a worker died, 130 stopped.",
    )
    parser.add_argument("channels", nargs="*", metavar="CHANNEL", help="drive_position.3; all")
    parser.add_argument("--kinds", nargs="+", default=FAULT_KINDS, choices=FAULT_KINDS)
    parser.add_argument("--modes", nargs="+", default=MODES, choices=MODES)
    parser.add_argument("--seed", type=count, default=1, help="robot and noise drawn (default 1)")
    parser.add_argument(
        "--jobs", type=positive, default=available_cores(), help="processes; one for each core"
    )
    arguments = parser.parse_args()
    for channel in arguments.channels:
        if channel not in all_channels():
            parser.error(unknown_name(channel, all_channels(), "channel"))
    return arguments


if __name__ == "__main__":
    sys.exit(main())
