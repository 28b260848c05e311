"""Where a run comes from: its file, what its seed drew, and the versions it was made with."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterable, Mapping
from importlib.metadata import PackageNotFoundError, version

import numpy as np

from cassie_bags.run.experiment import Experiment, to_yaml
from cassie_msgs.tunables import as_mapping

_OURS = ("cassie_bags", "cassie_control", "cassie_gaits", "cassie_sim", "cassie_teleop")
_OTHERS = ("mujoco", "numpy", "pin", "mcap")
_NUMERIC = ("mujoco", "numpy", "numba", "llvmlite", "pin", "scipy")
_VARIABLES = ("OPENBLAS_CORETYPE", "OPENBLAS_NUM_THREADS")


def metadata_of(experiment: Experiment) -> dict[str, dict[str, str]]:
    """What goes into a bag beside the messages.

    Args:
        experiment: What is run, drawn.
    """
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
    """With what a recording is made, as records of a bag."""
    return {"cassie_versions": versions(), "cassie_environment": environment()}


def versions() -> dict[str, str]:
    """Version by package name; "not installed" for what runs from its sources."""
    found = {"python": platform.python_version(), "machine": platform.machine()}
    return found | _versions(_OURS + _OTHERS)


def environment() -> dict[str, str]:
    """What the last bit of a result depends on besides this project's code."""
    found = {"machine": platform.machine(), "libc": " ".join(platform.libc_ver())}
    used = np.show_config(mode="dicts")["SIMD Extensions"]
    found["vector instructions"] = " ".join([*used["baseline"], *used["found"]])
    found |= {name: os.environ.get(name, "not set") for name in _VARIABLES}
    found["python"] = platform.python_version()
    return found | _versions(_NUMERIC)


def changes_of_environment(recorded: Mapping[str, str]) -> list[str]:
    """In what this machine and its libraries are not those recorded by `environment`."""
    here = environment()
    return [
        f"{name} {here.get(name, 'unknown')}, recorded {recorded.get(name, 'unknown')}"
        for name in {**recorded, **here}
        if here.get(name) != recorded.get(name)
    ]


def _versions(packages: Iterable[str]) -> dict[str, str]:
    found = {}
    for package in packages:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found
