"""`make bench`: speed of the loop over DDS, with rclpy's default executor, and without DDS.

All variants run the same cores on the same experiment, one after another, several times. The
results are medians. The command prints a table and writes a JSON file.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import signal
import statistics
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path

from cassie_bags.cli.arguments import positive, seconds
from cassie_bags.cli.frame import OK, command
from cassie_bags.errors import RunError
from cassie_bags.ros.bench_parts import PARTS
from cassie_bags.ros.processes import Processes

TARGETS = {
    "rtf_five_processes_500hz": (4.5, "at least"),
    "rtf_five_processes_1000hz": (2.6, "at least"),
    "rtf_five_processes_2000hz": (1.4, "at least"),
    "rtf_stack_500hz": (5.5, "at least"),
    "rtf_in_process_500hz": (14.0, "at least"),
    "round_trip_p50_us": (300.0, "at most"),
    "round_trip_p99_us": (1000.0, "at most"),
    "tick_us": (100.0, "at most"),
    "tick_p99_us": (250.0, "at most"),
    "missed_share_realtime_500hz": (1e-4, "at most"),
    "missed_share_realtime_500hz_busy": (0.01, "at most"),
    "missed_share_realtime_500hz_operated": (1e-3, "at most"),
    "page_processor_share": (0.15, "at most"),
    "stick_to_command_page_p99_ms": (60.0, "at most"),
    "stick_to_command_joy_p99_ms": (25.0, "at most"),
}

PART_TIMEOUT = 180.0
"""Time-out of one part, beside 10 times its robot time. In s of wall time."""

_CHECK_PERIOD = 0.05  # s between two checks of a part
_PRINTS = 1.0  # s for a part to print where it hangs


def _parser() -> argparse.ArgumentParser:
    usage = "python -m cassie_bags.ros.bench [OPTION …]"
    parser = argparse.ArgumentParser(prog="bench", usage=usage, description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("build/bench.json"))
    parser.add_argument("--repetitions", type=positive, default=3)
    parser.add_argument("--seconds", type=seconds, default=30.0, help="robot time of a run")
    return parser


def _run(arguments: argparse.Namespace) -> int:
    """Measure, print and write."""
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    failures: list[str] = []
    results = [_measure(arguments.seconds, n, failures) for n in range(arguments.repetitions)]
    names = dict.fromkeys(name for result in results for name in result)
    figures = {name: [result[name] for result in results if name in result] for name in names}
    content = {
        **{name: statistics.median(values) for name, values in figures.items()},
        "failures": failures,
        "repetitions": results,
        "machine": {
            "cores": len(os.sched_getaffinity(0)),
            "load": os.getloadavg()[0],
            "machine": platform.machine(),
            "python": platform.python_version(),
        },
        "robot_s": arguments.seconds,
    }
    arguments.out.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    print(_table(figures, len(results)))
    print(f"written to {arguments.out}")
    if failures:
        raise RunError(f"not measured: {'; '.join(failures)}")
    return OK


def _measure(robot_s: float, number: int, failures: list[str]) -> dict[str, float]:
    """Measure every part once; those that fail are added to `failures`."""
    values: dict[str, float] = {}
    for part in PARTS:
        print(f"run {number + 1}: {part}", file=sys.stderr, flush=True)
        try:
            values |= measure_apart(part, robot_s)
        except RunError as error:
            print(f"bench: {error}", file=sys.stderr)
            failures.append(f"{part} in run {number + 1}")
    return values


def measure_apart(part: str, robot_s: float) -> dict[str, float]:
    """Measure a part in a process of its own, so that nothing but this part is lost if DDS hangs.

    Args:
        part: One of `PARTS`.
        robot_s: Robot time of a run. In s.

    Returns:
        The figures by name.

    Raises:
        RunError: naming the part, if it fails or takes too long.
    """
    limit = PART_TIMEOUT + 10.0 * robot_s
    with (
        tempfile.TemporaryDirectory(prefix="cassie_bench_") as name,
        Processes(os.environ, Path(name)) as processes,
    ):
        file = Path(name) / "figures.json"
        program = [sys.executable, "-m", "cassie_bags.ros.bench_parts"]
        processes.start(part, [*program, part, f"{robot_s:g}", file])
        deadline = time.monotonic() + limit
        while processes.running(part):
            if time.monotonic() > deadline:
                processes.signal(part, signal.SIGABRT)  # prints the stacks of its threads
                time.sleep(_PRINTS)
                print(processes.log(part).read_text(errors="replace"), file=sys.stderr)
                raise RunError(f"{part} takes more than {limit:g} s")
            time.sleep(_CHECK_PERIOD)
        processes.check(part)
        figures: dict[str, float] = json.loads(file.read_text(encoding="utf-8"))
    return figures


def _table(figures: Mapping[str, list[float]], repetitions: int) -> str:
    lines = [f"{'median of ' + str(repetitions):38}{'value':>10}{'least':>10}{'most':>10}  target"]
    for name, values in figures.items():
        target = "{1} {0:g}".format(*TARGETS[name]) if name in TARGETS else ""
        numbers = statistics.median(values), min(values), max(values)
        cells = "".join(f"{number:10.4g}" for number in numbers)
        lines.append(f"{name:38}{cells}  {target}")
    load = os.getloadavg()[0]
    lines.append(f"{len(os.sched_getaffinity(0))} cores, load {load:.1f} over the last minute")
    return "\n".join(lines)


main = command(_parser, _run)

if __name__ == "__main__":
    sys.exit(main())
