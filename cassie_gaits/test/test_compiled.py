"""Compiled functions keep the rules under which their cached machine code stays right."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator

import numpy as np
import pytest
from numba.core import caching
from numba.core.registry import CPUDispatcher

import cassie_gaits
from cassie_gaits.compiled import compiled


def compiled_functions() -> Iterator[tuple[str, CPUDispatcher]]:
    for module in pkgutil.iter_modules(cassie_gaits.__path__):
        names = vars(importlib.import_module(f"cassie_gaits.{module.name}"))
        for name, value in names.items():
            if isinstance(value, CPUDispatcher):
                yield f"{module.name}.{name}", value


FUNCTIONS = dict(compiled_functions())


def test_there_are_some():
    assert "leg_kernels.leg_kinematics" in FUNCTIONS


@pytest.mark.parametrize("name", FUNCTIONS)
def test_calls_and_reads_only_what_stands_in_its_own_file(name):
    function = FUNCTIONS[name].py_func
    for used in function.__code__.co_names:
        value = function.__globals__.get(used)
        if isinstance(value, CPUDispatcher):
            assert value.py_func.__code__.co_filename == function.__code__.co_filename, used
        assert not isinstance(value, np.ndarray), f"{used}: arrays come in as arguments"


def doubled(value: float) -> float:
    return 2.0 * value


def test_works_without_a_folder_to_write(monkeypatch):
    monkeypatch.setattr(caching.CacheImpl, "_locator_classes", [])
    assert compiled(doubled)(1.5) == 3.0
