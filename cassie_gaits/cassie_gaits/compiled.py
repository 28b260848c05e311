"""Machine code for the functions that run at every control tick or physics step.

Numba compiles a function at its first call and caches the code beside the source or, if that folder
cannot be written, in the user's cache folder. Without either, every process compiles for itself.
Numba alone compiles anew only when the function's own file changes. Here it does so, too, when a
file changes from which the function's module takes compiled functions, or a module of this project
that it imports as a whole. Numbers that it imports by name from other modules are constants in the
machine code: take them as `module.NUMBER`.
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
    """The function as machine code, with the same type.

    Args:
        function: Function to compile.
        nogil: Whether other threads may use Python while the function runs.
    """
    try:
        machine = njit(cache=True, nogil=nogil)(function)
    except RuntimeError:  # numba found no folder that it can write
        return cast(FunctionT, njit(nogil=nogil)(function))
    if isinstance(machine, CPUDispatcher):  # false if compilation is switched off
        machine._cache._cache_file._source_stamp = _stamp(function)
        _kept.append(machine)
    return cast(FunctionT, machine)


def load_kept(package: str) -> None:
    """Load the cached machine code of a package's functions that Python calls.

    A function's first call does so as well, in milliseconds, but may be in the middle of a step.

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
    """Stamp of the sources of a function and its callees, to validate cached machine code."""
    digest = hashlib.sha256()
    for path in sorted(_sources(function, set())):
        digest.update(Path(path).read_bytes())
    return digest.hexdigest()


def _sources(function: Callable[..., Any], known: set[str]) -> set[str]:
    """Files of the function, and of this project's objects in its module by now."""
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
