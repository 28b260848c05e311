"""The numbers of a FROST-style library in a MATLAB file, read in a process of its own.

The reader of scipy is compiled code, which a damaged file can make crash or allocate without end.
Here that ends a child process of bounded memory and time.
"""

from __future__ import annotations

import concurrent.futures
import contextlib
import faulthandler
import io
import os
import resource
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cassie_gaits.errors import GaitLibraryError
from cassie_gaits.json_file import read_bounded
from cassie_gaits.processes import local_processes
from cassie_gaits.records import FloatArray

MOST_MEMORY = 2**30
"""Memory that the child process may allocate. In bytes."""

MOST_TIME = 30.0
"""Time within which the child process must read the file. In s."""

USED = frozenset({"HAlpha", "ct", "Velocity"})
"""Names of fields, of the library or of a stance, whose numbers are read."""

_RIGHT = "RightStance"


@dataclass(frozen=True, eq=False)
class MatContent:
    """Content of a library in a MATLAB file.

    Attributes:
        names: Names of all fields; a field of a struct has the struct's name and a dot before it.
        numbers: Finite numbers of the fields in `USED`, by the names above.
        flaws: What is wrong with the fields in `USED` that are not in `numbers`.
    """

    names: tuple[str, ...]
    numbers: dict[str, FloatArray]
    flaws: dict[str, str]


def read_mat(path: Path) -> MatContent:
    """Read the library in a MATLAB file, which is at the top level or in a struct of any name.

    Raises:
        GaitLibraryError: if the file cannot be read, is damaged, or has no library; the reason
            alone.
    """
    try:
        raw = read_bounded(path)
    except OSError as error:
        raise GaitLibraryError(error.strerror or str(error)) from None
    with local_processes(1) as pool:
        try:
            return pool.submit(_read, raw).result(MOST_TIME)
        except BrokenProcessPool:
            raise GaitLibraryError("it is damaged: the reader of MATLAB files crashed") from None
        except concurrent.futures.TimeoutError:
            reason = f"it is damaged: it was not read within {MOST_TIME:g} s"
            raise GaitLibraryError(reason) from None


def _read(raw: bytes) -> MatContent:
    """The library in the content of a file; runs in the child process."""
    _bound_process()
    try:
        found = _load(raw)
    except NotImplementedError:
        raise GaitLibraryError("it is a MATLAB 7.3 file; save it with -v7") from None
    except MemoryError:
        raise GaitLibraryError("it is damaged, or does not fit into memory") from None
    except Exception as error:  # scipy's reader raises many kinds of errors on damaged files
        reason = " ".join(str(error).split()) or type(error).__name__
        raise GaitLibraryError(f"it is no MATLAB file, or damaged: {reason}") from None
    top = {name: value for name, value in found.items() if not name.startswith("__")}
    for candidate in (top, *(_struct(value) for value in top.values())):
        if _RIGHT in candidate:
            return _content(candidate)
    raise GaitLibraryError(f"it has no {_RIGHT}; it has {', '.join(sorted(top)) or 'nothing'}")


def _load(raw: bytes) -> dict[str, Any]:
    from scipy.io import loadmat

    found: dict[str, Any] = loadmat(io.BytesIO(raw), squeeze_me=False, struct_as_record=True)
    return found


def _bound_process() -> None:
    """Bound the memory of this process, and keep it silent and without a core file if it crashes.

    The bound is above the memory that a forked process has from its parent.
    """
    faulthandler.disable()
    with Path(os.devnull).open("wb") as nothing:
        os.dup2(nothing.fileno(), 2)
    with contextlib.suppress(OSError, ValueError):
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        most = pages * resource.getpagesize() + MOST_MEMORY
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _content(library: dict[str, Any]) -> MatContent:
    fields = dict(library)
    for name, value in library.items():
        fields |= {f"{name}.{key}": part for key, part in _struct(value).items()}
    numbers, flaws = {}, {}
    for name, value in fields.items():
        if name.rpartition(".")[2] not in USED:
            continue
        if not isinstance(value, np.ndarray) or value.dtype.kind not in "iuf":
            flaws[name] = "holds something that is not a number"
        elif not np.isfinite(value).all():
            flaws[name] = "holds a number that is not finite"
        else:
            numbers[name] = np.array(value, dtype=np.float64)
    return MatContent(tuple(sorted(fields)), numbers, flaws)


def _struct(value: Any) -> dict[str, Any]:
    """Fields of a MATLAB struct; empty for anything else."""
    if not isinstance(value, np.ndarray) or value.dtype.names is None or value.size != 1:
        return {}
    return {name: value.ravel()[0][name] for name in value.dtype.names}
