"""The gait library's file: JSON, written completely or not at all, and checked when read.

    {"schema_version": 1, "kind": "optimized", "robot": "cassie", "model_hash": "...",
     "sha256": null or "...",
     "provenance": {"tool": "...", "version": "...", "date": "2025-01-31", "settings": {...}},
     "outputs": ["torso_roll", ...],
     "gaits": [{"vx": 0.5, "vy": 0.0, "yaw_rate": 0.0, "step_time": 0.4,
                "coefficients": {"right_stance": 9 rows of 6, "left_stance": 9 rows of 6},
                "torques": null or {"right_stance": 10 rows of n, "left_stance": ...},
                "passive": null or {"right_stance": 2 rows of n, "left_stance": ...},
                "cost": null or a number, "solver": {...}, "certificate": null or {...}}]}

Units are SI. Rows of `coefficients` follow `outputs`, those of `torques` the drives. A file whose
name ends in .gz is compressed.

`load_certified` refuses a library in which any number, key or name differs from the certified ones.
`certificate.seal` describes `sha256` of the file and of each certificate, and the limits of these
hashes. `check_gaits FILE --certify` checks a file and seals it.
"""

from __future__ import annotations

import contextlib
import functools
import json
import os
import reprlib
import tempfile
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cassie_gaits.certificate.seal import flaw, gait_sha256, library_sha256
from cassie_gaits.errors import CassieError, GaitLibraryError
from cassie_gaits.gait_library import OUTPUTS, STANCES, Gait, GaitLibrary, Provenance
from cassie_gaits.json_file import check_free, read_json
from cassie_gaits.model_hash import model_hash

SCHEMA_VERSION = 1
ROBOT = "cassie"

_TOP = {"schema_version", "kind", "robot", "model_hash", "sha256"} | {
    "provenance",
    "outputs",
    "gaits",
}
_PROVENANCE = {"tool", "version", "date", "settings"}
_GAIT = {"vx", "vy", "yaw_rate", "step_time", "coefficients", "torques", "cost"} | {
    "solver",
    "certificate",
    "passive",
}

_NUMBERS = {int, float}
_PERMISSION = "(allow_uncertified is false)"
_LONGEST = 200  # longest name

_GZIP = zlib.MAX_WBITS | 16  # window, with gzip's header, which contains no time

PACKAGED = {"dense": "dense.json.gz", "optimized": "optimized.json"}
"""Libraries that come with this package: a grid of 1424 gaits, and seven straight gaits."""


def default_library_path() -> Path:
    """Default library of the controller."""
    return library_path("dense")


def library_path(name: str) -> Path:
    """The file of a library: one of `PACKAGED` by its name, anything else by its path."""
    if name in PACKAGED:
        return Path(__file__).parent / "libraries" / PACKAGED[name]
    return Path(name)


def load_library(path: str | Path) -> GaitLibrary:
    """Read a gait library, certified or not.

    Raises:
        GaitLibraryError: if the file is missing, no regular file, too large, damaged or of another
            schema; one line with the file's name and the reason.
    """
    path = Path(path)
    with _named(path):
        return _library(read_json(path), path)


def load_certified(path: str | Path, *, allow_uncertified: bool = False) -> GaitLibrary:
    """Read a library for walking: made for this robot, and every gait certified and unchanged.

    Args:
        path: File to read.
        allow_uncertified: Whether gaits without a valid certificate, imported or changed,
            are accepted.

    Raises:
        GaitLibraryError: as `load_library`, and if the library is for another model, or anything
            in it differs from what was certified; one line that says what and in which gait.
    """
    path = Path(path)
    with _named(path):
        return _certified(path, _version(path), allow_uncertified)


def _version(path: Path) -> tuple[int, ...]:
    """What changes with a file's content; empty without a file, which reading then tells."""
    try:
        status = path.stat()
    except OSError:
        return ()
    return status.st_ino, status.st_mtime_ns, status.st_size


@functools.lru_cache(maxsize=4)
def _certified(path: Path, version: tuple[int, ...], allow_uncertified: bool) -> GaitLibrary:
    """As `load_certified`, of one version of the file: `dense` takes more than half a second."""
    document = read_json(path)
    library = _library(document, path)
    hold_robot(library)
    if not allow_uncertified:
        _hold_certified(library, document)
    return library


def hold_robot(library: GaitLibrary) -> None:
    """Check that a library was made for this robot.

    Raises:
        GaitLibraryError: if not; the message names both robots, or both models.
    """
    if library.robot != ROBOT:
        raise GaitLibraryError(f"it is for the robot {library.robot!r}, expected {ROBOT!r}")
    expected = model_hash()
    if library.model_hash != expected:
        raise GaitLibraryError(f"it is for model {library.model_hash}, this robot is {expected}")


def _hold_certified(library: GaitLibrary, document: object) -> None:
    hashes = [gait_sha256(gait) for gait in library.gaits]
    for i, (gait, sha256) in enumerate(zip(library.gaits, hashes, strict=True)):
        if why := flaw(gait, sha256):
            raise GaitLibraryError(
                f"gaits[{i}]: the {library.kind} gait of {gait.speeds} {why} {_PERMISSION}"
            )
    found = document.get("sha256") if isinstance(document, dict) else None
    if found != library_sha256(_head(library), hashes):
        raise GaitLibraryError(
            "its head (kind, robot, provenance, sha256) or its set of gaits differs from what was "
            f"certified {_PERMISSION}"
        )


def _compressed(text: bytes) -> bytes:
    """The text as gzip. It is mostly digits, of which a short match costs more than it saves."""
    packer = zlib.compressobj(9, wbits=_GZIP, strategy=zlib.Z_FILTERED)
    return packer.compress(text) + packer.flush()


def save_library(library: GaitLibrary, path: str | Path) -> None:
    """Write a gait library; a reader sees the old file or the complete new one.

    A link stays; the file to which it leads is written.

    Raises:
        GaitLibraryError: if the file cannot be written, is no regular file, or JSON cannot express
            an entry.
    """
    path = Path(path)
    temporary = ""
    try:
        target = path.resolve()
        if target.exists() and not target.is_file():
            raise ValueError("it is no regular file")
        content = _text(library, indent=None if path.suffix == ".gz" else 1).encode()
        if path.suffix == ".gz":
            content = _compressed(content)
        descriptor, temporary = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.")
        with os.fdopen(descriptor, "wb") as file:
            os.fchmod(file.fileno(), 0o644)
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        Path(temporary).replace(target)
    except (OSError, TypeError, ValueError) as error:
        if temporary:
            with contextlib.suppress(OSError):
                Path(temporary).unlink()
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise GaitLibraryError(f"gait library {path}: {reason}") from error


def _text(library: GaitLibrary, indent: int | None) -> str:
    head = _head(library)
    document = {
        **head,
        "sha256": library_sha256(head, [gait_sha256(gait) for gait in library.gaits]),
        "gaits": [gait_document(gait) for gait in library.gaits],
    }
    tight = (",", ":") if indent is None else None
    return json.dumps(document, indent=indent, separators=tight, allow_nan=False) + "\n"


def _head(library: GaitLibrary) -> dict[str, Any]:
    """Everything in the file except its hash and its gaits."""
    return {
        "schema_version": SCHEMA_VERSION,
        "kind": library.kind,
        "robot": library.robot,
        "model_hash": library.model_hash,
        "provenance": {
            "tool": library.provenance.tool,
            "version": library.provenance.version,
            "date": library.provenance.date,
            "settings": dict(library.provenance.settings),
        },
        "outputs": list(OUTPUTS),
    }


def gait_document(gait: Gait) -> dict[str, Any]:
    """A gait as an entry of the file."""
    return {
        "vx": gait.vx,
        "vy": gait.vy,
        "yaw_rate": gait.yaw_rate,
        "step_time": gait.step_time,
        "coefficients": dict(zip(STANCES, gait.coefficients.tolist(), strict=True)),
        "torques": None
        if gait.torques is None
        else dict(zip(STANCES, gait.torques.tolist(), strict=True)),
        "passive": None
        if gait.passive is None
        else dict(zip(STANCES, gait.passive.tolist(), strict=True)),
        "cost": gait.cost,
        "solver": dict(gait.solver),
        "certificate": None if gait.certificate is None else dict(gait.certificate),
    }


def _library(document: object, path: Path) -> GaitLibrary:
    if isinstance(document, dict) and "schema_version" in document:
        version = document["schema_version"]
        if isinstance(version, bool) or version != SCHEMA_VERSION:
            raise GaitLibraryError(
                f"schema_version is {reprlib.repr(version)}, expected {SCHEMA_VERSION}"
            )
    top = _object({"sha256": None, **_object(document, "the file")}, "the file", _TOP)
    if top["outputs"] != list(OUTPUTS):
        raise GaitLibraryError(
            f"outputs are {reprlib.repr(top['outputs'])}, expected {list(OUTPUTS)}"
        )
    provenance = _object(top["provenance"], "provenance", _PROVENANCE)
    if not isinstance(top["gaits"], list):
        raise GaitLibraryError("gaits is no list")
    return GaitLibrary(
        tuple(gait_of(entry, f"gaits[{i}]") for i, entry in enumerate(top["gaits"])),
        kind=_string(top, "kind"),
        model_hash=_string(top, "model_hash"),
        robot=_string(top, "robot"),
        provenance=Provenance(
            _string(provenance, "tool"),
            _string(provenance, "version"),
            _string(provenance, "date"),
            _free(provenance["settings"], "provenance.settings"),
        ),
        path=path,
    )


def gait_of(document: object, name: str) -> Gait:
    """A gait from its entry in the file.

    Raises:
        GaitLibraryError: with `name` and the problem.
    """
    try:
        entry = _object({"passive": None, **_object(document, "the entry")}, "the entry", _GAIT)
        certificate = entry["certificate"]
        return Gait(
            vx=_number(entry, "vx"),
            vy=_number(entry, "vy"),
            yaw_rate=_number(entry, "yaw_rate"),
            step_time=_number(entry, "step_time"),
            coefficients=_matrices(entry["coefficients"], "coefficients"),
            torques=None if entry["torques"] is None else _matrices(entry["torques"], "torques"),
            cost=None if entry["cost"] is None else _number(entry, "cost"),
            solver=_free(entry["solver"], "solver"),
            certificate=None if certificate is None else _free(certificate, "certificate"),
            passive=None if entry["passive"] is None else _matrices(entry["passive"], "passive"),
        )
    except CassieError as error:
        raise GaitLibraryError(f"{name}: {error}") from None


@contextlib.contextmanager
def _named(path: Path) -> Iterator[None]:
    """Put the file's name into every message."""
    try:
        yield
    except CassieError as error:
        raise GaitLibraryError(f"gait library {path}: {error}") from None


def _object(value: object, name: str, keys: set[str] | None = None) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise GaitLibraryError(f"{name} is no JSON object")
    if keys is not None and set(value) != keys:
        missing, unknown = sorted(keys - set(value)), sorted(set(value) - keys)
        problem = f"lacks {', '.join(missing)}" if missing else f"has unknown {_shown(unknown)}"
        raise GaitLibraryError(f"{name} {problem}")
    return value


def _free(value: object, name: str) -> Mapping[str, Any]:
    """An object with keys of any names."""
    check_free(value, name)
    return _object(value, name)


def _shown(names: list[str]) -> str:
    """Text with the first of some names, which may be any objects."""
    return reprlib.repr(names[0]) + (f" and {len(names) - 1} more" if names[1:] else "")


def _string(entry: Mapping[str, Any], key: str) -> str:
    value = entry[key]
    if not isinstance(value, str) or not value or not value.isprintable():
        raise GaitLibraryError(f"{key} is {reprlib.repr(value)}, expected text")
    if len(value) > _LONGEST:
        raise GaitLibraryError(f"{key} has {len(value)} characters, expected at most {_LONGEST}")
    return value


def _number(entry: Mapping[str, Any], key: str) -> float:
    value = entry[key]
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise GaitLibraryError(f"{key} is {reprlib.repr(value)}, expected a number")
    try:
        return float(value)
    except OverflowError:
        raise GaitLibraryError(f"{key} is too large for a number") from None


def _matrices(value: object, name: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    stances = _object(value, name, set(STANCES))
    for stance in STANCES:
        rows = stances[stance]
        if not isinstance(rows, list) or not {*map(type, rows)} <= {list}:
            raise GaitLibraryError(f"{name}.{stance} is no list of rows")
        if not set().union(*(map(type, row) for row in rows)) <= _NUMBERS:
            raise GaitLibraryError(f"{name}.{stance} holds something that is not a number")
    try:
        return np.array([stances[stance] for stance in STANCES], dtype=np.float64)
    except (ValueError, OverflowError):
        raise GaitLibraryError(f"{name} have rows of unequal length") from None
