"""Table of learned feed-forward torques, and its file beside the gait library.

    {"schema_version": 1, "robot": "cassie", "model_hash": "...",
     "provenance": {"tool": "...", "version": "...", "date": "2025-01-31", "settings": {...}},
     "joints": ["stance_hip_roll", ..., "swing_toe"], "speeds": [-0.5, ..., 1.0],
     "torques": for each speed, for each joint, values at evenly spaced phases from 0 to 1}

Speeds in m/s, rising; torques in Nm, of a step on the left leg. The file of `optimized.json` is
`optimized.learned.json`.
"""

from __future__ import annotations

import json
import reprlib
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from cassie_control.errors import ControlError
from cassie_gaits.drive_limits import TORQUE_LIMITS
from cassie_gaits.errors import CassieError
from cassie_gaits.gait_library import Provenance
from cassie_gaits.gait_library_file import library_path
from cassie_gaits.json_file import check_free, read_json
from cassie_gaits.model_hash import model_hash
from cassie_gaits.names import LEG_DRIVES
from cassie_gaits.records import FloatArray

SCHEMA_VERSION = 1

JOINTS = tuple(f"{role}_{drive}" for role in ("stance", "swing") for drive in LEG_DRIVES)
"""Rows of the table: the stance leg's drives, then the swing leg's."""

PHASES = 21
"""Points of a new table from phase 0 to 1: 20 ms apart, near the drives' bandwidth."""

SPEEDS = (-0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0)
"""Speeds of a new table: those of the paper's library. In m/s."""

_KEYS = {"schema_version", "robot", "model_hash", "provenance", "joints", "speeds", "torques"}
_MAX_SPEEDS, _MAX_PHASES = 64, 1001  # of a file: bounds of its memory
_DECIMALS = 3  # of a torque in Nm, in files


class LearnedTorquesError(ControlError):
    """Learned torques, or their file, cannot be used."""


@dataclass(frozen=True, eq=False)
class LearnedTorques:
    """Torques by speed, joint and phase, of a step on the left leg.

    Attributes:
        speeds: Speeds, rising. Shape (s,), in m/s.
        torques: Rows of `JOINTS` at evenly spaced phases from 0 to 1. Shape (s, 10, n), in Nm.
        provenance: Where they come from, or None.

    Raises:
        LearnedTorquesError: if shapes do not match, speeds do not rise, or a value is not finite, a
            torque exceeds its drive's limit, or the stance toe gets torques.
    """

    speeds: FloatArray
    torques: FloatArray
    provenance: Provenance | None = None

    def __post_init__(self) -> None:
        speeds, torques = self.speeds, self.torques
        if speeds.ndim != 1 or not 1 <= len(speeds) <= _MAX_SPEEDS:
            raise LearnedTorquesError(f"speeds are {speeds.shape}, expected 1 .. {_MAX_SPEEDS}")
        if torques.ndim != 3 or torques.shape[:2] != (len(speeds), len(JOINTS)):
            expected = (len(speeds), len(JOINTS), "n")
            raise LearnedTorquesError(f"torques have shape {torques.shape}, expected {expected}")
        if not 2 <= torques.shape[2] <= _MAX_PHASES:
            raise LearnedTorquesError(f"{torques.shape[2]} phases, expected 2 .. {_MAX_PHASES}")
        if not (np.isfinite(speeds).all() and np.isfinite(torques).all()):
            raise LearnedTorquesError("a speed or torque is not finite")
        for before, after in pairwise(speeds.tolist()):
            if not after > before:
                raise LearnedTorquesError(f"speed {after:g} follows {before:g}, expected to rise")
        if torques[:, JOINTS.index("stance_toe")].any():
            raise LearnedTorquesError("stance_toe gets torques, but is torque-free while walking")
        limits = TORQUE_LIMITS
        largest = np.abs(torques).max(axis=(0, 2))
        for joint, value, bound in zip(JOINTS, largest, limits, strict=True):
            if value > bound:
                raise LearnedTorquesError(
                    f"{joint} gets {value:g} Nm, at most {bound:g} Nm are permitted"
                )


def zero_torques(speeds: tuple[float, ...] = SPEEDS) -> LearnedTorques:
    """A table of zeros over speeds (m/s)."""
    return LearnedTorques(np.array(speeds), np.zeros((len(speeds), len(JOINTS), PHASES)))


def path_for_library(library: str | Path) -> Path:
    """Path of the torques learned on a gait library, from the library's name or file."""
    library = library_path(str(library))
    stem = library.name.removesuffix(".gz").removesuffix(".json")
    return library.with_name(f"{stem}.learned.json")


def load_for_library(library: str | Path, path: str | Path = "") -> LearnedTorques:
    """The torques of a file, or those beside a gait library: none if there is no such file.

    Raises:
        LearnedTorquesError: as `load_torques`.
    """
    if path:
        return load_torques(path)
    path = path_for_library(library)
    return load_torques(path) if path.exists() else zero_torques()


def load_torques(path: str | Path) -> LearnedTorques:
    """Read learned torques.

    Raises:
        LearnedTorquesError: if the file is missing, no regular file, too large, damaged, of another
            schema or for another robot; one line with the file's name and the reason.
    """
    try:
        return _parse(read_json(Path(path)))
    except CassieError as error:
        raise LearnedTorquesError(f"learned torques {path}: {error}") from None


def save_torques(learned: LearnedTorques, path: str | Path) -> None:
    """Write learned torques; a reader sees the old file or the whole new one.

    Raises:
        LearnedTorquesError: if the file cannot be written.
    """
    path = Path(path)
    origin = learned.provenance
    document = {
        "schema_version": SCHEMA_VERSION,
        "robot": "cassie",
        "model_hash": model_hash(),
        "provenance": {
            "tool": origin.tool if origin else "unknown",
            "version": origin.version if origin else "unknown",
            "date": origin.date if origin else "unknown",
            "settings": dict(origin.settings) if origin else {},
        },
        "joints": list(JOINTS),
        "speeds": learned.speeds.tolist(),
        "torques": np.round(learned.torques, _DECIMALS).tolist(),
    }
    part_path = path.with_name(f".{path.name}.part")
    try:
        part_path.write_text(json.dumps(document, allow_nan=False) + "\n", encoding="utf-8")
        part_path.replace(path)
    except (OSError, TypeError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise LearnedTorquesError(f"learned torques {path}: {reason}") from error


def _parse(document: object) -> LearnedTorques:
    top = _object(document, "the file")
    version = top.get("schema_version")
    if isinstance(version, bool) or version != SCHEMA_VERSION:
        raise LearnedTorquesError(
            f"schema_version is {reprlib.repr(version)}, expected {SCHEMA_VERSION}"
        )
    if set(top) != _KEYS:
        wrong = reprlib.repr(sorted(set(top) ^ _KEYS))
        raise LearnedTorquesError(f"the file lacks or has too much: {wrong}")
    if top["joints"] != list(JOINTS):
        raise LearnedTorquesError(f"joints are {reprlib.repr(top['joints'])}, expected {JOINTS}")
    if top["model_hash"] != model_hash():
        raise LearnedTorquesError(
            f"it is for model {reprlib.repr(top['model_hash'])}, this robot is {model_hash()}"
        )
    origin = _object(top["provenance"], "provenance")
    settings = _object(origin.get("settings", {}), "provenance.settings")
    check_free(settings, "provenance.settings")
    tool, version, date = (origin.get(key) for key in ("tool", "version", "date"))
    if not (isinstance(tool, str) and isinstance(version, str) and isinstance(date, str)):
        raise LearnedTorquesError("provenance lacks tool, version or date")
    return LearnedTorques(
        _numbers(top["speeds"], "speeds", 1),
        _numbers(top["torques"], "torques", 3),
        Provenance(tool, version, date, settings),
    )


def _object(value: object, name: str) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise LearnedTorquesError(f"{name} is no JSON object")
    return value


def _numbers(value: object, name: str, depth: int) -> FloatArray:
    """Nested lists of numbers, all of the same lengths."""
    problem = f"{name} are no lists of numbers of equal lengths"

    def check(entry: object, level: int) -> None:
        if level == 0:
            if type(entry) not in (int, float):
                raise LearnedTorquesError(problem)
            return
        if not isinstance(entry, list):
            raise LearnedTorquesError(problem)
        for part in entry:
            check(part, level - 1)

    check(value, depth)
    try:
        array = np.array(value, dtype=np.float64)
    except (ValueError, OverflowError):
        raise LearnedTorquesError(problem) from None
    if array.ndim != depth:
        raise LearnedTorquesError(problem)
    return array
