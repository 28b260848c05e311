"""With what a run was made: versions of the packages that decide its numbers."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version

_OURS = ("cassie_bags", "cassie_control", "cassie_gaits", "cassie_sim", "cassie_teleop")
_OTHERS = ("mujoco", "numpy", "pin", "mcap")


def versions() -> dict[str, str]:
    """Version by package name; "not installed" for what runs from its sources."""
    found = {"python": platform.python_version(), "machine": platform.machine()}
    for package in _OURS + _OTHERS:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found
