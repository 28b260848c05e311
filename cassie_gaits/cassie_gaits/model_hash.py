"""Hash of the numbers in `cassie_gaits.robot`, which identifies the robot of a gait."""

from __future__ import annotations

import functools
import hashlib
import json
from dataclasses import asdict

from cassie_gaits import robot

_ONLY_LOOKS = ("mesh", "capsule")


@functools.cache
def model_hash() -> str:
    """Hash of everything in the robot table that changes the robot's motion.

    It has 16 hexadecimal digits. Meshes and collision shapes are not part of it.
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
