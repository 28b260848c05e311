"""Machine code for the functions that run at every control tick or physics step.

Numba makes it at the first call and keeps it beside the source or, where that folder cannot be
written, in the user's cache folder; without either, every process makes it for itself. Numba alone
makes it anew only when the function's own file changes; here also when one of those changes that
its module takes compiled functions from, and the modules of this project that it imports whole.
Numbers that it imports by name from other modules are frozen into the machine code: take them as
`module.NUMBER`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar, cast

from numba import njit
from numba.core.registry import CPUDispatcher

_kept: list[CPUDispatcher] = []

FunctionT = TypeVar("FunctionT", bound=Callable[..., Any])


def compiled(function: FunctionT, *, nogil: bool = False) -> FunctionT:
    """The function as machine code, with its type as it stands.

    Args:
        function: What to compile.
        nogil: Whether other threads may use Python while it runs.
    """
    try:
        machine = njit(cache=True, nogil=nogil)(function)
    except RuntimeError:  # numba found no folder to write
        return cast(FunctionT, njit(nogil=nogil)(function))
    if isinstance(machine, CPUDispatcher):  # not where compiling is switched off
        machine._cache._cache_file._source_stamp = _stamp(function)
        _kept.append(machine)
    return cast(FunctionT, machine)


def load_kept(package: str) -> None:
    """Load the machine code that is kept of the functions of a package which others call.

    A function's first call does so as well, in milliseconds, and may be in the middle of a step.

    Args:
        package: Name of a package or module.
    """
    for machine in _kept:
        name = machine.py_func.__name__
        if f"{machine.py_func.__module__}.".startswith(f"{package}.") and not name.startswith("_"):
            processor = machine.targetctx.codegen().magic_tuple()
            for signature, made_for, _ in machine._cache._cache_file._load_index():
                if made_for == processor:
                    machine.compile(signature)


def _stamp(function: Callable[..., Any]) -> str:
    """What tells whether kept machine code is that of the function and of all that it calls."""
    digest = hashlib.sha256()
    for path in sorted(_sources(function, set())):
        digest.update(Path(path).read_bytes())
    return digest.hexdigest()


def _sources(function: Callable[..., Any], known: set[str]) -> set[str]:
    """Files of the function, and of what its module has by now of this project's."""
    path = function.__code__.co_filename
    if path not in known:
        known.add(path)
        _add_sources(function.__globals__, known)
    return known


def _add_sources(names: dict[str, Any], known: set[str]) -> None:
    for value in list(names.values()):
        if isinstance(value, CPUDispatcher):
            _sources(value.py_func, known)
        elif isinstance(value, ModuleType) and value.__name__.startswith("cassie_"):
            path = value.__file__
            if path is not None and path not in known:
                known.add(path)
                _add_sources(vars(value), known)
