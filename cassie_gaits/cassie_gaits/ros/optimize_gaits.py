"""`ros2 run cassie_gaits optimize_gaits`: find a library of gaits, certify it, write its file.

Without speeds it finds the paper's seven gaits; several values of --lateral and --yaw-rate make a
grid. Gaits of a grid that are far from a neighbour are solved again from it.

Exit status: 0 if every gait was found and certified (with --holes: all but that share) and the
file is written; 1 if not, and the file is unchanged; 2 for an impossible request.
"""

from __future__ import annotations

import argparse
import contextlib
import datetime
import sys
import time
from collections.abc import Iterator
from concurrent.futures import Executor
from itertools import product
from pathlib import Path
from typing import Any

from cassie_gaits.errors import GaitLibraryError
from cassie_gaits.gait_library import Gait, GaitLibrary, Provenance
from cassie_gaits.gait_library_file import save_library
from cassie_gaits.model_hash import model_hash
from cassie_gaits.optimize.library import Result, apart, find, improve
from cassie_gaits.optimize.partial_file import Found, PartialFile
from cassie_gaits.optimize.request import TABLE_ONLY, Request
from cassie_gaits.optimize.solution import prepare
from cassie_gaits.processes import available_cores, local_processes
from cassie_gaits.ros.frame import tool

SPEEDS = (-0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0)
"""Speeds of the seven gaits of the paper. In m/s."""

DENSE = {
    "speeds": [round(0.1 * (i - 10), 1) for i in range(29)],
    "lateral": [round(0.1 * (i - 3), 1) for i in range(7)],
    "yaw_rate": [round(0.3 * (i - 3), 1) for i in range(7)],
    "straight": [-1.3, -1.2, -1.1, 1.9, 2.0, 2.1, 2.2, 2.3, 2.4],
    "holes": 0.03,
}
"""Values that --grid stands for."""

DEFAULTS = {"speeds": list(SPEEDS), "lateral": [0.0], "yaw_rate": [0.0], "straight": []} | {
    "holes": 0.0,
    **{"step_time": 0.4, "clearance": 0.15, "slope": 0.0, "jobs": available_cores()},
    **{"landing_speed": 0.25, "feet_apart": 0.25, "torso_pitch": 0.05, "torso_roll": 0.005},
    **{"hip_yaw": 0.005, "pelvis_distance": 0.97, "detour": 0.03},
}
"""Values of the options that are not given and that neither --grid nor --table-only sets."""

SETTINGS = (
    *("step_time", "clearance", "slope", "landing_speed", "feet_apart"),
    *("torso_pitch", "torso_roll", "hip_yaw", "pelvis_distance", "detour"),
)
"""Options that all gaits of a run share."""

CONNECT_TIMEOUT = 10.0
"""Time within which a scheduler must answer and have a worker. In s."""

_VERSION = "2"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="ros2 run cassie_gaits optimize_gaits", description=__doc__
    )
    add = parser.add_argument
    many: dict[str, Any] = {"type": float, "nargs": "+"}
    add("--speeds", **many, help="mean sagittal speeds, m/s")
    add("--lateral", **many, help="mean speeds to the left, m/s")
    add("--yaw-rate", **many, help="mean turning rates to the left, rad/s")
    add("--straight", **many, help="sagittal speeds at which gaits only go straight, m/s")
    dense = (
        "-1 .. 1.8 by 0.1 m/s, -0.3 .. 0.3 by 0.1 m/s, -0.9 .. 0.9 by 0.3 rad/s; straight from "
        "-1.3 to 2.4 m/s; --holes 0.03"
    )
    add("--grid", action="store_true", help=dense)
    add("--holes", type=float, help="share of the gaits that may be missing")
    add("--step-time", type=float, help="duration of a step, s (default: 0.4)")
    add("--clearance", type=float, help="height of the swing foot at mid-step, m (default: 0.15)")
    add("--slope", type=float, help="rise of the ground ahead, rad (default: 0)")
    add("--landing-speed", type=float, help="largest of the landing foot, m/s")
    add("--feet-apart", type=float, help="least distance of the feet, m")
    add("--torso-pitch", type=float, help="bound of torso pitch, rad")
    add("--torso-roll", type=float, help="bound of torso roll, rad")
    add("--hip-yaw", type=float, help="bound of hip yaw besides that to turn, rad")
    add("--pelvis-distance", type=float, help="largest, to stance foot, m")
    add("--detour", type=float, help="swing foot beyond its ends, fore and aft, m")
    add("--table-only", action="store_true", help="the last seven as wide as the paper's table")
    add("--general", action="store_true", help="two steps on the real robot, not mirrored")
    jobs = "processes (default: one for each core)"
    add("--jobs", type=int, metavar="N", help=jobs)
    add("--scheduler", help="address of a Dask scheduler, instead of local processes")
    add("--resume", action="store_true", help="use the results of a run that was stopped")
    add("--import", dest="mat", type=Path, metavar="FILE.mat", help="FROST-style library to import")
    add("--out", type=Path, default=Path("gaits.json"), help="file to write; .json or .json.gz")
    return parser


def _run(options: argparse.Namespace) -> int:
    start = time.monotonic()
    if not options.out.parent.is_dir():
        raise GaitLibraryError(f"--out: there is no folder {options.out.parent}")
    if options.out.is_dir():
        raise GaitLibraryError(f"--out: {options.out} is a folder, expected a file")
    if not options.out.name.endswith((".json", ".json.gz")):
        raise GaitLibraryError(f"--out: {options.out} ends neither in .json nor in .json.gz")
    if options.mat is not None:
        _refuse_beside_import(options)
        from cassie_gaits.mat_import import import_mat  # scipy's readers take long to load

        library = import_mat(options.mat)
        save_library(library, options.out)
        count = len(library.gaits)
        print(f"{count} gait{'' if count == 1 else 's'} imported, not certified: {options.out}")
        for remark in library.provenance.settings["remarks"]:
            print(f"  {remark}")
        return 0
    _expand(options)
    requests = _requests(options)
    partial = PartialFile(options.out)
    found = partial.read(requests) if options.resume else {}
    if found:
        print(f"{len(found)} of {len(requests)} taken over from {partial.path}", flush=True)
    known = set(found)
    _search(requests, options, found, partial)
    gaits = [result for request in requests if isinstance(result := found[request], Gait)]
    reasons = {r: result for r in requests if isinstance(result := found[r], str)}
    for request, reason in reasons.items():
        if request in known:
            print(f"no gait for {request.name}: {reason}")
    if len(reasons) > options.holes * len(requests):
        print(f"{len(reasons)} of {len(requests)} gaits failed; {options.out} is left as it was")
        return 1
    save_library(_library(gaits, options), options.out)
    partial.remove()
    spent = time.monotonic() - start
    print(
        f"{len(gaits)} of {len(requests)} gaits certified in {spent:.1f} s "
        f"({spent / len(requests):.2f} s a gait): {options.out}"
    )
    return 0


def _expand(options: argparse.Namespace) -> None:
    """Insert the values of --grid and --table-only and the defaults, and check the options."""
    values = vars(options)
    for option, stands_for in (("grid", DENSE), ("table_only", TABLE_ONLY)):
        if not values[option]:
            continue
        for name, value in stands_for.items():
            if values[name] is not None:
                raise GaitLibraryError(f"{_flag(option)} sets {_flag(name)}: give only one of them")
            values[name] = value
    for name, value in DEFAULTS.items():
        if values[name] is None:
            values[name] = value
    if options.jobs < 1:
        raise GaitLibraryError(f"--jobs is {options.jobs}, expected 1 or more")
    if not 0.0 <= options.holes < 1.0:
        raise GaitLibraryError(f"--holes is {options.holes}, expected 0 or more and less than 1")


def _refuse_beside_import(options: argparse.Namespace) -> None:
    given = (*DEFAULTS, "grid", "table_only", "general", "resume", "scheduler")
    for name in given:
        if vars(options)[name] not in (None, False):
            raise GaitLibraryError(f"--import ignores {_flag(name)}: leave it out")


def _flag(name: str) -> str:
    """The option with which a value is given."""
    return "--" + name.replace("_", "-")


def _requests(options: argparse.Namespace) -> list[Request]:
    common = {name: getattr(options, name) for name in SETTINGS}
    points = {*product(options.speeds, options.lateral, options.yaw_rate)}
    points |= {(vx, 0.0, 0.0) for vx in options.straight}
    requests = []
    for vx, vy, yaw_rate in sorted(points):
        straight = vy == 0.0 and yaw_rate == 0.0
        if options.slope != 0.0 and not straight:
            raise GaitLibraryError("on a slope gaits go straight: no --lateral, no --yaw-rate")
        symmetric = straight and not options.general
        requests.append(Request(vx, vy, yaw_rate, symmetric=symmetric, **common))
    return requests


def _search(
    requests: list[Request], options: argparse.Namespace, found: Found, partial: PartialFile
) -> None:
    """Find the missing gaits, and solve those again that are far from a neighbour.

    Each result is added to `found` and to the partial file at once.
    """
    done = {r: result if isinstance(result, Gait) else None for r, result in found.items()}
    start, before = time.monotonic(), len(found)
    missing = len(requests) - before
    jobs = missing or len(apart(_gaits(found)))
    if not jobs:
        return
    forms = {request.symmetric for request in requests}
    with _executor(options, forms, jobs) as executor:
        partial.begin(found)
        for result in find(requests, executor, done):
            content = _reason(result) if result.gait is None else result.gait
            found[result.request] = content
            partial.add(result.request, content)
            left = (time.monotonic() - start) / (len(found) - before) * (len(requests) - len(found))
            ahead = f", {left / 60.0:.0f} min left" if left > 60.0 else ""
            print(f"[{len(found)}/{len(requests)}{ahead}] {_line(result)}", flush=True)
        gaits = _gaits(found)
        if again := len(apart(gaits)):
            print(f"solving again from neighbours that are far apart: {again} starts", flush=True)
        for better in improve(gaits, executor):
            if better.gait is not None:
                found[better.request] = better.gait
                partial.add(better.request, better.gait)
                print(_line(better), flush=True)


def _gaits(found: Found) -> dict[Request, Gait]:
    return {request: gait for request, gait in found.items() if isinstance(gait, Gait)}


@contextlib.contextmanager
def _executor(options: argparse.Namespace, forms: set[bool], count: int) -> Iterator[Executor]:
    """A cluster, or local processes, which end with this process even if it is stopped.

    Args:
        options: Options of the command.
        forms: Kinds of gaits, whether symmetric, whose programs are needed.
        count: Number of gaits to find; more processes would be idle.
    """
    if options.scheduler:
        with _cluster(options.scheduler, forms) as cluster:
            yield cluster
        return
    # Forked processes share the programs, whose setup takes one or two seconds.
    for symmetric in forms:
        prepare(symmetric=symmetric)
    with local_processes(min(options.jobs, count)) as pool:
        yield pool


@contextlib.contextmanager
def _cluster(address: str, forms: set[bool]) -> Iterator[Executor]:
    """A Dask cluster; it runs on when this command ends.

    All workers set up the programs at the beginning, not at their first gait.
    """
    try:
        from distributed import Client, KilledWorker
    except ImportError:
        raise GaitLibraryError("--scheduler needs the package distributed (Dask)") from None
    try:
        client = Client(address, timeout=CONNECT_TIMEOUT)
    except (OSError, ValueError) as error:
        raise GaitLibraryError(f"--scheduler {address}: {error}") from error
    with client:
        try:
            client.wait_for_workers(1, timeout=CONNECT_TIMEOUT)
        except TimeoutError:
            raise GaitLibraryError(
                f"--scheduler {address}: no worker within {CONNECT_TIMEOUT:g} s"
            ) from None
        try:
            begun = [
                client.submit(prepare, symmetric=symmetric, workers=[worker], pure=False)
                for symmetric in forms
                for worker in client.nthreads()
            ]
            with client.get_executor(pure=False) as executor:
                yield executor
            del begun  # Dask releases results without references
        except KilledWorker as error:
            raise GaitLibraryError(f"--scheduler {address}: {error}") from None


def _reason(result: Result) -> str:
    """Why there is no gait, without the solver's own word for its end."""
    outcome = result.outcome
    if outcome is None or not result.reason.startswith(outcome.status):
        return result.reason
    ended = f"no gait found in {outcome.iterations} iterations"
    return ended + result.reason.removeprefix(outcome.status)


def _line(result: Result) -> str:
    outcome = result.outcome
    if result.gait is None or outcome is None:
        return f"{result.request.name}: failed: {_reason(result)}"
    return (
        f"{result.request.name}: {outcome.iterations:3d} iterations, cost {outcome.cost:.1f}, "
        f"worst violation {outcome.violation:.1e}, {outcome.seconds:.2f} s CPU, certified"
    )


def _library(gaits: list[Gait], options: argparse.Namespace) -> GaitLibrary:
    settings = {name: getattr(options, name) for name in (*SETTINGS, "general")}
    provenance = Provenance(
        "cassie_gaits.optimize_gaits", _VERSION, datetime.date.today().isoformat(), settings
    )
    return GaitLibrary(tuple(gaits), "optimized", model_hash(), provenance)


main = tool("optimize_gaits", _parser, _run, stopped="stopped; --resume goes on from here")

if __name__ == "__main__":
    sys.exit(main())
