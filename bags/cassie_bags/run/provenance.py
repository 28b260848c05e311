"""Where a run comes from: its file, what its seed drew, and the versions it was made with."""

from __future__ import annotations

import json
import platform
from importlib.metadata import PackageNotFoundError, version

from cassie_bags.run.experiment import Experiment, to_yaml
from cassie_msgs.tunables import as_mapping

_OURS = ("cassie_bags", "cassie_control", "cassie_gaits", "cassie_sim", "cassie_teleop")
_OTHERS = ("mujoco", "numpy", "pin", "mcap")


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
        "cassie_versions": versions(),
    }


def versions() -> dict[str, str]:
    """Version by package name; "not installed" for what runs from its sources."""
    found = {"python": platform.python_version(), "machine": platform.machine()}
    for package in _OURS + _OTHERS:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found
