"""Machine code for the functions that run at every control tick or physics step.

Numba makes it at the first call and keeps it beside the source or, where that folder cannot be
written, in the user's cache folder; without either, every process makes it for itself. It is made
anew when the function's own file changes, and only then. Hence two rules: numbers from other
modules come in as arguments, and compiled functions that call each other stand in one file.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

FunctionT = TypeVar("FunctionT", bound=Callable[..., Any])


def compiled(function: FunctionT) -> FunctionT:
    """The function as machine code, with its type as it stands."""
    try:
        return cast(FunctionT, njit(cache=True)(function))
    except RuntimeError:  # numba found no folder to write
        return cast(FunctionT, njit(function))
