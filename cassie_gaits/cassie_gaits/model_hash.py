"""A short name for the numbers in `cassie_gaits.robot`, to tell which robot a gait was made for."""

from __future__ import annotations

import functools
import hashlib
import json
from dataclasses import asdict

from cassie_gaits import robot

_ONLY_LOOKS = ("mesh", "capsule")


@functools.cache
def model_hash() -> str:
    """Hash of everything in the robot table that changes how the robot moves.

    Meshes and collision shapes do not count. 16 hexadecimal digits.
    """
    links = [asdict(link) for link in (robot.PELVIS, *robot.LEFT_LEG)]
    for link in links:
        for field in _ONLY_LOOKS:
            del link[field]
    table = {
        "links": links,
        "rods": [asdict(rod) for rod in robot.RODS],
        "drives": {name: asdict(drive) for name, drive in robot.DRIVES.items()},
        "contacts": robot.FOOT_CONTACTS,
        "sole": robot.SOLE_RADIUS,
        "delay": robot.DRIVE_DELAY,
    }
    text = json.dumps(table, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]
