"""Compiled functions keep the rules under which their cached machine code stays right."""

from __future__ import annotations

import importlib
import os
import pkgutil
import subprocess
import sys
from collections.abc import Iterator

import numpy as np
import pytest
from numba.core import caching
from numba.core.registry import CPUDispatcher

import cassie_gaits
from cassie_gaits.compiled import compiled
from cassie_gaits.leg import LegPair, both_legs


def compiled_functions() -> Iterator[tuple[str, CPUDispatcher]]:
    for module in pkgutil.iter_modules(cassie_gaits.__path__):
        names = vars(importlib.import_module(f"cassie_gaits.{module.name}"))
        for name, value in names.items():
            if isinstance(value, CPUDispatcher):
                yield f"{module.name}.{name}", value


FUNCTIONS = dict(compiled_functions())


def test_there_are_some():
    assert "leg.leg_kinematics" in FUNCTIONS


@pytest.mark.parametrize("name", FUNCTIONS)
def test_reads_no_arrays_from_outside(name):
    function = FUNCTIONS[name].py_func
    for used in function.__code__.co_names:
        value = function.__globals__.get(used)
        assert not isinstance(value, np.ndarray), f"{used}: arrays come in as arguments"


def test_is_compiled_anew_when_what_it_calls_in_another_file_has_changed(tmp_path):
    caller = "from cassie_gaits.compiled import compiled\nfrom inner import {0}\n\n"
    caller += "@compiled\ndef {1}(value):\n    return 3 * {0}(value)\n"
    (tmp_path / "middle.py").write_text(caller.format("inner", "middle"))
    (tmp_path / "outer.py").write_text(
        caller.replace("inner", "middle", 1).format("middle", "outer")
    )
    run = [sys.executable, "-c", "from outer import outer; print(outer(1))"]
    for factor, expected in ((2, "18"), (5, "45")):
        source = "from cassie_gaits.compiled import compiled\n\n"
        source += f"@compiled\ndef inner(value):\n    return {factor} * value\n"
        (tmp_path / "inner.py").write_text(source)
        paths = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
        found = subprocess.run(
            run, env={**os.environ, "PYTHONPATH": paths}, capture_output=True, text=True, check=True
        )
        assert found.stdout.strip() == expected


def doubled(value: float) -> float:
    return 2.0 * value


def test_works_without_a_folder_to_write(monkeypatch):
    monkeypatch.setattr(caching.CacheImpl, "_locator_classes", [])
    assert compiled(doubled)(1.5) == 3.0


def test_kept_machine_code_is_loaded_before_the_first_call():
    """In a process of its own, where nothing has called the function yet."""
    code = (
        "from cassie_gaits.compiled import load_kept\n"
        "from cassie_gaits.leg import both_legs\n"
        "assert not both_legs.signatures\n"
        "load_kept('cassie_gaits.linkage')\n"
        "assert not both_legs.signatures\n"
        "load_kept('cassie_gaits.leg')\n"
        "assert both_legs.signatures\n"
        "assert not both_legs.stats.cache_misses\n"
    )
    joints, up = np.zeros((2, 7)), np.array([0.0, 0.0, 1.0])
    both_legs(joints, joints, np.zeros(2), up, LegPair().records[0])
    subprocess.run([sys.executable, "-c", code], check=True)
