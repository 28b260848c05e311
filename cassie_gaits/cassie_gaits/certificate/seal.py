"""The seal of a certificate: hashes that tie it to the gait, the model and the checker.

A certificate holds `model_hash`, `checker` and `sha256`, the gait's SHA-256. A library's file
holds `sha256` of its whole content. A library with any difference is refused when it is loaded for
walking. A hash is no signature: it detects changes, but anyone can write a new hash on purpose.

Canonical form of a gait, of which SHA-256 is taken:

1. The gait's entry in the file as JSON, without `certificate.sha256`: instead of `coefficients`,
   `torques` and `passive` their shapes (or null), keys sorted, no white space, ASCII only, numbers
   as the shortest decimal that gives the same float64 (Python's repr); then a newline.
2. The numbers of `coefficients`, `torques` and `passive` in this order as float64, little-endian;
   right stance before left stance, row by row.

Canonical form of a library: the file as the same kind of JSON and a newline, without its own
`sha256`, and with the hash of each gait instead of the gait.
"""

from __future__ import annotations

import hashlib
import json
import reprlib
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from cassie_gaits.gait_library import Gait
from cassie_gaits.model_hash import model_hash

CHECKER_VERSION = "1"
"""Version of the checker: raised at each change that can alter the result for the same gait.

A test compares a hash of the checker's sources with the one noted for this version.
"""

_RENEW = "check_gaits FILE --certify renews it"
_ARRAYS = ("coefficients", "torques", "passive")


def gait_sha256(gait: Gait) -> str:
    """SHA-256 of a gait in its canonical form. 64 hexadecimal digits.

    Raises:
        ValueError, TypeError: if `solver` or `certificate` hold values that JSON cannot express.
    """
    certificate = gait.certificate
    arrays = [getattr(gait, name) for name in _ARRAYS]
    entry: dict[str, Any] = {
        "vx": float(gait.vx),
        "vy": float(gait.vy),
        "yaw_rate": float(gait.yaw_rate),
        "step_time": float(gait.step_time),
        "cost": None if gait.cost is None else float(gait.cost),
        "solver": dict(gait.solver),
        "certificate": None
        if certificate is None
        else {key: value for key, value in certificate.items() if key != "sha256"},
    }
    for name, array in zip(_ARRAYS, arrays, strict=True):
        entry[name] = None if array is None else array.shape
    digest = hashlib.sha256(_canonical(entry))
    for array in arrays:
        if array is not None:
            digest.update(np.ascontiguousarray(array, dtype="<f8").data)
    return digest.hexdigest()


def library_sha256(head: Mapping[str, Any], gaits: list[str]) -> str:
    """SHA-256 of a library. 64 hexadecimal digits.

    Args:
        head: The file without `gaits` and `sha256`.
        gaits: SHA-256 of each gait.
    """
    return hashlib.sha256(_canonical({**head, "gaits": gaits})).hexdigest()


def sealed(gait: Gait, found: Mapping[str, Any]) -> Gait:
    """The gait with a certificate for this model and checker.

    Args:
        gait: The gait that was checked.
        found: Result of the check, as `Certificate.as_document` gives it.
    """
    tied = {**found, "model_hash": model_hash(), "checker": CHECKER_VERSION}
    unsealed = replace(gait, certificate=tied)
    return replace(gait, certificate={**tied, "sha256": gait_sha256(unsealed)})


def flaw(gait: Gait, sha256: str) -> str:
    """Why a gait does not count as certified, as the end of a sentence; empty if it does.

    Args:
        gait: The gait, with its certificate.
        sha256: `gait_sha256` of the gait.
    """
    certificate = gait.certificate
    if certificate is None or certificate.get("met") is not True:
        return "is not certified"
    if not {"model_hash", "checker", "sha256"} <= set(certificate):
        return f"has a certificate without hash: {_RENEW}"
    model, version = (reprlib.repr(certificate[key]) for key in ("model_hash", "checker"))
    if certificate["model_hash"] != model_hash():
        return f"was certified for model {model}, this robot is {model_hash()!r}"
    if certificate["checker"] != CHECKER_VERSION:
        return f"was certified by checker {version}, this is {CHECKER_VERSION!r}: {_RENEW}"
    return "" if certificate["sha256"] == sha256 else "differs from what was certified"


def _canonical(value: object) -> bytes:
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return text.encode("ascii") + b"\n"
