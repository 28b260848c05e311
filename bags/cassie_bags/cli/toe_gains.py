"""Command `toe_gains`: how the gains of the feet shake a Segway, as a table and a picture."""

from __future__ import annotations

import argparse
import contextlib
import signal
import sys
from pathlib import Path

from tqdm import tqdm

from cassie_bags.cli.arguments import positive
from cassie_bags.errors import RunError
from cassie_bags.studies.toe_gains import QUIET, draw, settings, shaking, table, trial_of, verdict
from cassie_bags.studies.trial import Figures, run_trial
from cassie_bags.studies.workers import workers

MET, NOT_MET, WRONG_INPUT, NO_RUN, STOPPED = 0, 1, 2, 3, 130
"""Exit codes."""

RATIO = 3.0
"""By how much the nominal gains are to shake more."""


def main() -> int:
    """Entry point of `ros2 run cassie_bags toe_gains`."""
    arguments = _arguments()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    points = settings()
    seeds = range(1, arguments.seeds + 1)
    jobs = [(index, seed) for index in range(len(points)) for seed in seeds]
    runs: list[list[Figures]] = [[] for _ in points]
    bar = tqdm(total=len(jobs), unit="run", disable=not sys.stderr.isatty(), leave=False)
    try:
        arguments.out.mkdir(parents=True, exist_ok=True)
        with contextlib.closing(workers(arguments.jobs, None)) as crew, bar:
            trials = [trial_of(points[index], seed) for index, seed in jobs]
            for number, figures in crew.results(run_trial, trials):
                runs[jobs[number][0]].append(figures)
                bar.update()
        found = [shaking(point, figures) for point, figures in zip(points, runs, strict=True)]
        (arguments.out / "toe_gains.txt").write_text(table(found) + "\n", "utf-8")
        draw(arguments.out / "toe_gains.png", found)
    except KeyboardInterrupt:
        print("toe_gains: stopped", file=sys.stderr)
        return STOPPED
    except RunError as error:
        print(f"toe_gains: error: {error}", file=sys.stderr)
        return NO_RUN
    except (ValueError, OSError) as error:
        print(f"toe_gains: error: {' '.join(str(error).split())}", file=sys.stderr)
        return WRONG_INPUT
    print(table(found))
    quiet, ratio = verdict(found)
    print(f"seeds 1 to {arguments.seeds}: shipped gains <= {quiet:.3f} deg (target {QUIET:g}),")
    print(f"the standing law with nominal ones >= {ratio:.1f} times that (target {RATIO:g})")
    return MET if quiet <= QUIET and ratio >= RATIO else NOT_MET


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="toe_gains",
        description="Let Cassie stand on a Segway that nobody holds, with gains of the feet from "
        "low to the paper's nominal ones, with the law of standing and that of riding, on softer "
        "and stiffer platforms; print how much the platform shakes and draw toe_gains.png.",
        epilog="Exit codes: 0 the nominal gains shake it three times as much, 1 they do not, "
        "2 wrong arguments, 3 a worker died, 130 stopped.",
    )
    parser.add_argument("--seeds", type=positive, default=3, help="robots, from 1 on (3)")
    parser.add_argument("--jobs", type=positive, help="processes (one for each processor)")
    parser.add_argument("--out", type=Path, default=Path("toe_gains"), help="folder (toe_gains)")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
