"""Origin of a run: its file, the values drawn from its seed, and the versions of software."""

from __future__ import annotations

import datetime
import json
import os
import platform
import subprocess
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING

from cassie_msgs.tunables import as_mapping

if TYPE_CHECKING:
    from cassie_msgs.experiment.file import Experiment

_OURS = ("cassie_bags", "cassie_control", "cassie_gaits", "cassie_sim", "cassie_teleop")
_OTHERS = ("mujoco", "numpy", "pin", "mcap")
_NUMERIC = ("mujoco", "numpy", "numba", "llvmlite", "pin", "scipy")
_VARIABLES = ("OPENBLAS_CORETYPE", "OPENBLAS_NUM_THREADS")
_CPU_INFO = Path("/proc/cpuinfo")


@dataclass(frozen=True)
class Origin:
    """Origin of measured values.

    Attributes:
        command: Command that measures the values again.
        date: Day on which the measurement began, ISO 8601.
        revision: Git revision of the sources, see `revision`.
        machine: Processor and number of cores.
        versions: Versions of Python and of the libraries that affect the last bit.
        seeds: Robots that were drawn.
    """

    command: str
    date: str
    revision: str
    machine: str
    versions: str
    seeds: str


def origin(command: str, seeds: str, now: datetime.datetime) -> Origin:
    """The origin of values that are measured here from `now` on.

    Args:
        command: Command that measures the values again.
        seeds: Robots that are drawn.
        now: Time of the wall clock.
    """
    libraries = {"python": platform.python_version(), **_versions(_NUMERIC)}
    named = ", ".join(f"{name} {number}" for name, number in libraries.items())
    return Origin(command, now.date().isoformat(), revision(), machine(), named, seeds)


_RUNS = ":/", ":(top,exclude)*.md"  # git's pathspec of all files except Markdown


def revision(source: Path = Path(__file__)) -> str:
    """Git revision of the sources that run, shortened, or "unknown".

    "with changes" follows where tracked files of the working tree differ from this revision.
    Markdown files, such as the results themselves, do not count. The revision is unknown where git
    does not track `source`, as in an installed package.

    Args:
        source: A file of these sources.
    """
    source = source.resolve()

    def git(*words: str) -> str:
        command = ["git", "-C", str(source.parent), *words]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    try:
        git("ls-files", "--error-unmatch", source.name)
        commit = git("rev-parse", "--short=10", "HEAD")
        changed = git("status", "--porcelain", "--untracked-files=no", "--", *_RUNS)
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return f"{commit} with changes" if changed else commit


def machine(cpu_info: Path = _CPU_INFO) -> str:
    """Processor and number of cores of this computer.

    Args:
        cpu_info: Linux's file about the processors; without it the architecture is named.
    """
    try:
        lines = cpu_info.read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    cores = os.cpu_count() or 1
    return f"{models[0] if models else platform.machine()}, {cores} cores"


def metadata_of(experiment: Experiment) -> dict[str, dict[str, str]]:
    """Metadata that the run of a drawn experiment writes into its bag, by name of the record."""
    from cassie_msgs.experiment.file import to_yaml  # this import loads NumPy

    return {
        "cassie_experiment": {
            "name": experiment.name,
            "seed": str(experiment.seed),
            "draw": json.dumps(as_mapping(experiment.scenario.draw)),
            "file": to_yaml(experiment),
        },
        **surroundings(),
    }


def surroundings() -> dict[str, dict[str, str]]:
    """Versions and environment of a recording, as records of a bag."""
    return {"cassie_versions": versions(), "cassie_environment": environment()}


def versions() -> dict[str, str]:
    """Version by package name; "not installed" for a package that runs from its sources."""
    basics = {"python": platform.python_version(), "machine": platform.machine()}
    return basics | _versions(_OURS + _OTHERS)


def environment() -> dict[str, str]:
    """What affects the last bit of a result, besides this project's code."""
    import numpy as np

    settings = {"machine": platform.machine(), "libc": " ".join(platform.libc_ver())}
    used = np.show_config(mode="dicts")["SIMD Extensions"]
    settings["vector instructions"] = " ".join([*used["baseline"], *used["found"]])
    settings |= {name: os.environ.get(name, "not set") for name in _VARIABLES}
    settings["python"] = platform.python_version()
    return settings | _versions(_NUMERIC)


def changes_of_environment(recorded: Mapping[str, str]) -> list[str]:
    """Differences of this machine and its libraries from those that `environment` recorded."""
    here = environment()
    return [
        f"{name} {here.get(name, 'unknown')}, recorded {recorded.get(name, 'unknown')}"
        for name in {**recorded, **here}
        if here.get(name) != recorded.get(name)
    ]


def _versions(packages: Iterable[str]) -> dict[str, str]:
    numbers = {}
    for package in packages:
        try:
            numbers[package] = version(package)
        except PackageNotFoundError:
            numbers[package] = "not installed"
    return numbers
