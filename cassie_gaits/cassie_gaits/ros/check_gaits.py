"""`ros2 run cassie_gaits check_gaits FILE`: certify a gait library independently of its maker.

Every gait is integrated on the 20-DoF model under its own torques, and every row of the table is
looked at on 401 points. Exit status: 0 when all is met, 1 on any miss, 2 for a file that cannot be
read.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from cassie_gaits.certificate.certify import Certificate, certify
from cassie_gaits.certificate.table import Row
from cassie_gaits.errors import GaitLibraryError
from cassie_gaits.gait_library import Gait
from cassie_gaits.gait_library_file import PACKAGED, library_path, load_library
from cassie_gaits.model_hash import model_hash
from cassie_gaits.processes import local_processes


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if "--ros-args" in given:
        given = given[: given.index("--ros-args")]
    parser = argparse.ArgumentParser(prog="check_gaits", description=__doc__)
    named = f"library to check: a file, or one of {', '.join(PACKAGED)}"
    parser.add_argument("file", type=library_path, metavar="FILE", help=named)
    parser.add_argument("--jobs", type=int, default=2, help="local processes")
    options = parser.parse_args(given)
    try:
        library = load_library(options.file)
        if library.model_hash != model_hash():
            raise GaitLibraryError(f"gait library {options.file}: it is for another model")
        if options.jobs < 1:
            raise GaitLibraryError(f"--jobs is {options.jobs}, expected 1 or more")
        return _check(library.gaits, options.jobs)
    except GaitLibraryError as error:
        print(f"check_gaits: error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("check_gaits: stopped", file=sys.stderr)
        return 130


def _check(gaits: Sequence[Gait], jobs: int) -> int:
    missed = 0
    with local_processes(jobs) as pool:
        futures = [pool.submit(certify, gait) for gait in gaits]
        for gait, future in zip(gaits, futures, strict=True):
            name = f"vx {gait.vx:+.2f} vy {gait.vy:+.2f} m/s yaw {gait.yaw_rate:+.2f} rad/s"
            try:
                certificate = future.result()
            except GaitLibraryError as error:
                print(f"{name}: cannot be checked: {error}")
                missed += 1
                continue
            missed += not certificate.met
            print(_table(name, certificate), flush=True)
    print(f"{len(gaits) - missed} of {len(gaits)} gaits certified")
    return 1 if missed else 0


def _table(name: str, certificate: Certificate) -> str:
    verdict = "certified" if certificate.met else "NOT certified"
    header = f"{'row':46s} {'bound':>20s} {'worst':>12s} {'margin':>10s}"
    lines = [f"{name}: {verdict}", header, *map(_line, certificate.rows), ""]
    return "\n".join(lines)


def _line(row: Row) -> str:
    bound = f"{row.low:.4g} .. {row.high:.4g}"
    miss = "" if row.met else "  MISS"
    return f"{row.name:46s} {bound:>20s} {row.worst:12.4g} {row.margin:10.2g} {row.unit}{miss}"


if __name__ == "__main__":
    sys.exit(main())
