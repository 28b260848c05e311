"""`ros2 run cassie_gaits check_gaits FILE`: certify a gait library independently of its maker.

Every gait is integrated on the 20-DoF model under its own torques, and every row of the table is
checked at 401 points. Then the certificates in the file are compared with its content; --certify
writes new ones if all requirements are met. Exit status: 0 if all requirements are met and the
file's certificates are valid, 1 if not, 2 for a file that cannot be read or written. With
--neighbours nothing is certified: the output is the distances of gaits to their neighbours, and the
gaits that may be in another local optimum.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from cassie_gaits.certificate.certify import Certificate, certify
from cassie_gaits.certificate.seal import sealed
from cassie_gaits.certificate.table import Row
from cassie_gaits.errors import GaitLibraryError
from cassie_gaits.gait_library import Gait
from cassie_gaits.gait_library_file import (
    PACKAGED,
    hold_robot,
    library_path,
    load_certified,
    load_library,
    save_library,
)
from cassie_gaits.neighbours import report
from cassie_gaits.processes import available_cores, local_processes
from cassie_gaits.ros.frame import tool


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="ros2 run cassie_gaits check_gaits", description=__doc__)
    named = f"library to check: a file, or one of {', '.join(PACKAGED)}"
    parser.add_argument("file", type=library_path, metavar="FILE", help=named)
    jobs = "processes (default: one for each core)"
    parser.add_argument("--jobs", type=int, default=available_cores(), metavar="N", help=jobs)
    parser.add_argument("--certify", action="store_true", help="write certificates into the file")
    apart = "only print the distances of gaits to their neighbours"
    parser.add_argument("--neighbours", action="store_true", help=apart)
    every = "with --neighbours: name all pairs that are far apart, not 10 for each speed"
    parser.add_argument("--all", action="store_true", help=every)
    return parser


def _run(options: argparse.Namespace) -> int:
    library = load_library(options.file)
    try:
        hold_robot(library)
    except GaitLibraryError as error:
        raise GaitLibraryError(f"gait library {options.file}: {error}") from None
    if options.neighbours and options.certify:
        raise GaitLibraryError("--neighbours certifies nothing: leave it out, or --certify")
    if options.neighbours:
        print(report(library.gaits, None if options.all else 10))
        return 0
    if options.all:
        raise GaitLibraryError("--all needs --neighbours")
    if options.jobs < 1:
        raise GaitLibraryError(f"--jobs is {options.jobs}, expected 1 or more")
    certified = _check(library.gaits, options.jobs)
    if len(certified) < len(library.gaits):
        return 1
    if options.certify:
        save_library(replace(library, gaits=tuple(certified)), options.file)
        print(f"certificates written: {options.file}")
    return _hold_file(options.file)


def _check(gaits: Sequence[Gait], jobs: int) -> list[Gait]:
    """Check and print each gait; returns those that meet all requirements, with certificates."""
    certified = []
    with local_processes(min(jobs, len(gaits))) as pool:
        futures = [pool.submit(certify, gait) for gait in gaits]
        for gait, future in zip(gaits, futures, strict=True):
            name = f"vx {gait.vx:+.2f} vy {gait.vy:+.2f} m/s yaw {gait.yaw_rate:+.2f} rad/s"
            try:
                certificate = future.result()
            except GaitLibraryError as error:
                print(f"{name}: cannot be checked: {error}")
                continue
            print(_table(name, certificate), flush=True)
            if certificate.met:
                certified.append(sealed(gait, certificate.as_document()))
    print(f"{len(certified)} of {len(gaits)} gaits certified")
    return certified


def _hold_file(path: Path) -> int:
    """Print whether the file can be loaded for walking; returns the exit status."""
    try:
        load_certified(path)
    except GaitLibraryError as error:
        print(f"the certificates in the file do not hold: {error}")
        return 1
    print("the certificates in the file hold")
    return 0


def _table(name: str, certificate: Certificate) -> str:
    verdict = "certified" if certificate.met else "NOT certified"
    header = f"{'row':46s} {'bound':>20s} {'worst':>12s} {'margin':>10s}"
    lines = [f"{name}: {verdict}", header, *map(_line, certificate.rows), ""]
    return "\n".join(lines)


def _line(row: Row) -> str:
    bound = f"{row.low:.4g} .. {row.high:.4g}"
    miss = "" if row.met else "  MISS"
    return f"{row.name:46s} {bound:>20s} {row.worst:12.4g} {row.margin:10.2g} {row.unit}{miss}"


main = tool("check_gaits", _parser, _run)

if __name__ == "__main__":
    sys.exit(main())
