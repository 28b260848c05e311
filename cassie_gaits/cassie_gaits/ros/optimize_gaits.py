"""`ros2 run cassie_gaits optimize_gaits`: find a library of gaits, certify it, write its file.

Exit status: 0 when every gait was found and certified and the file is written; 1 when one was
not, with the file left as it was; 2 for an impossible request.
"""

from __future__ import annotations

import argparse
import datetime
import multiprocessing
import sys
import time
from collections.abc import Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from pathlib import Path

from cassie_gaits.errors import CassieError, GaitLibraryError
from cassie_gaits.gait_library import Gait, GaitLibrary, Provenance
from cassie_gaits.gait_library_file import load_library, save_library
from cassie_gaits.model_hash import model_hash
from cassie_gaits.optimize.library import Result, find
from cassie_gaits.optimize.request import Request, as_document
from cassie_gaits.optimize.solution import prepare

SPEEDS = (-0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0)
"""Of the seven gaits of the paper. In m/s."""

_VERSION = "1"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if "--ros-args" in given:
        given = given[: given.index("--ros-args")]
    options = _parser().parse_args(given)
    start = time.monotonic()
    try:
        return _run(options, start)
    except (CassieError, OSError) as error:
        print(f"optimize_gaits: error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("optimize_gaits: stopped; --resume goes on from here", file=sys.stderr)
        return 130


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="optimize_gaits", description=__doc__)
    add = parser.add_argument
    add("--speeds", type=float, nargs="+", default=SPEEDS, help="mean sagittal speeds, m/s")
    add("--lateral", type=float, default=0.0, help="mean speed to the left, m/s")
    add("--yaw-rate", type=float, default=0.0, help="mean turning rate to the left, rad/s")
    add("--step-time", type=float, default=0.4, help="duration of a step, s")
    add("--clearance", type=float, default=0.15, help="of the swing foot at mid-step, m")
    add("--slope", type=float, default=0.0, help="rise of the ground ahead, rad")
    add("--landing-speed", type=float, default=0.5, help="largest, of the swing foot, m/s")
    add("--feet-apart", type=float, default=0.25, help="least distance of the feet, m")
    add("--torso-tilt", type=float, default=0.05, help="bound of torso pitch and roll, rad")
    add("--hip-yaw", type=float, default=0.03, help="bound beyond what turning takes, rad")
    add("--pelvis-distance", type=float, default=0.97, help="largest, to the stance foot, m")
    add("--general", action="store_true", help="two steps on the robot as it is, not mirrored")
    add("--jobs", type=int, default=2, help="local processes")
    add("--scheduler", help="address of a Dask scheduler, in place of local processes")
    add("--resume", action="store_true", help="take over gaits of a run that was stopped")
    add("--out", type=Path, default=Path("gaits.json"), help="file to write")
    return parser


def _run(options: argparse.Namespace, start: float) -> int:
    requests = _requests(options)
    if options.jobs < 1:
        raise GaitLibraryError(f"--jobs is {options.jobs}, expected 1 or more")
    if not options.out.parent.is_dir():
        raise GaitLibraryError(f"--out: there is no folder {options.out.parent}")
    partial = options.out.with_name(options.out.name + ".partial")
    found = _taken_over(partial, requests) if options.resume else {}
    for request in found:
        print(f"{request.name}: taken over from {partial}", flush=True)
    failed = _search(requests, options, found, partial)
    if failed:
        print(f"{failed} of {len(requests)} gaits failed; {options.out} is left as it was")
        return 1
    save_library(_library([found[request] for request in requests], options), options.out)
    partial.unlink(missing_ok=True)
    spent = time.monotonic() - start
    print(f"{len(requests)} gaits certified in {spent:.1f} s: {options.out}")
    return 0


def _requests(options: argparse.Namespace) -> list[Request]:
    straight = options.lateral == 0.0 and options.yaw_rate == 0.0
    if options.slope != 0.0 and not straight:
        raise GaitLibraryError("on a slope gaits go straight: no --lateral, no --yaw-rate")
    return [
        Request(
            vx=speed,
            vy=options.lateral,
            yaw_rate=options.yaw_rate,
            step_time=options.step_time,
            clearance=options.clearance,
            slope=options.slope,
            landing_speed=options.landing_speed,
            feet_apart=options.feet_apart,
            torso_tilt=options.torso_tilt,
            hip_yaw=options.hip_yaw,
            pelvis_distance=options.pelvis_distance,
            symmetric=straight and not options.general,
        )
        for speed in sorted(set(options.speeds))
    ]


def _search(
    requests: list[Request], options: argparse.Namespace, found: dict[Request, Gait], partial: Path
) -> int:
    """Find what is missing; each gait goes to `found` and to the partial file at once."""
    failed, taken = 0, dict(found)
    with _executor(options, symmetric=requests[0].symmetric) as executor:
        for result in find(requests, executor, taken):
            failed += result.gait is None
            if result.gait is not None:
                found[result.request] = result.gait
                rising = [found[request] for request in requests if request in found]
                save_library(_library(rising, options), partial)
            print(f"[{len(found) + failed}/{len(requests)}] {_line(result)}", flush=True)
    return failed


def _executor(options: argparse.Namespace, *, symmetric: bool) -> Executor:
    if options.scheduler:
        return _cluster(options.scheduler)
    # Forked processes share the program, which takes a second to set up.
    prepare(symmetric=symmetric)
    context = multiprocessing.get_context("fork")
    return ProcessPoolExecutor(options.jobs, mp_context=context)


def _cluster(address: str) -> Executor:
    try:
        from distributed import Client
    except ImportError:
        raise GaitLibraryError("--scheduler needs the package distributed (Dask)") from None
    try:
        executor: Executor = Client(address, timeout=10.0).get_executor(pure=False)
    except (OSError, ValueError) as error:
        raise GaitLibraryError(f"--scheduler {address}: {error}") from error
    return executor


def _line(result: Result) -> str:
    outcome = result.outcome
    if result.gait is None or outcome is None:
        return f"{result.request.name}: failed: {result.reason}"
    return (
        f"{result.request.name}: {outcome.iterations:3d} iterations, cost {outcome.cost:.1f}, "
        f"worst violation {outcome.violation:.1e}, {outcome.seconds:.2f} s CPU, certified"
    )


def _taken_over(partial: Path, requests: list[Request]) -> dict[Request, Gait]:
    """Gaits of a run that was stopped, as far as they are still wanted."""
    if not partial.exists():
        return {}
    library = load_library(partial)
    if library.model_hash != model_hash():
        raise GaitLibraryError(f"{partial} is for another model of the robot")
    return {
        request: gait
        for request in requests
        for gait in library.gaits
        if gait.certificate is not None and gait.solver.get("request") == as_document(request)
    }


def _library(gaits: list[Gait], options: argparse.Namespace) -> GaitLibrary:
    settings = {
        name: getattr(options, name)
        for name in (
            *("lateral", "yaw_rate", "step_time", "clearance", "slope"),
            *("landing_speed", "feet_apart", "torso_tilt", "hip_yaw"),
            *("pelvis_distance", "general"),
        )
    }
    provenance = Provenance(
        "cassie_gaits.optimize_gaits", _VERSION, datetime.date.today().isoformat(), settings
    )
    return GaitLibrary(tuple(gaits), "optimized", model_hash(), provenance)


if __name__ == "__main__":
    sys.exit(main())
