"""Every parameter of every node: a value of another type is refused by the parameter's name."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from cassie_msgs.tunables import Entry, ParameterError, entries, from_mapping, replace_checked

ROOT = Path(__file__).resolve().parent.parent
NODES = sorted(
    f"{path.parent.parent.name}.ros.{path.stem}"
    for path in ROOT.glob("cassie_*/cassie_*/ros/*.py")
    if "parameters=(" in path.read_text(encoding="utf-8")
)
WRONG: dict[type, tuple[Any, ...]] = {
    float: ("heavy", [1.0], True, float("nan")),
    int: ("many", [1], True, float("nan")),
    bool: ("maybe", [True], 1, float("nan")),
    str: ([1.0], True, float("nan")),
    tuple: ("wide", ["wide"], True, [float("nan")]),
}
"""Values that no parameter of the type takes: a word, a list, a bool or a number, NaN."""


def configs(module: str) -> list[Any]:
    return list(import_module(module).ABOUT.parameters)


def test_nodes_with_parameters_are_found() -> None:
    assert {"cassie_gaits.ros.gait_optimizer", "cassie_sim.ros.simulator"} <= set(NODES)
    assert all(configs(module) for module in NODES)


def refused(config: Any, entry: Entry, value: Any) -> bool:
    for change in (
        lambda: replace_checked(config, **{entry.name: value}),
        lambda: from_mapping(type(config), {entry.name: value}),
    ):
        try:
            change()
        except ParameterError as error:
            if not str(error).startswith(entry.name):
                return False
        else:
            return False
    return True


@pytest.mark.parametrize("module", NODES)
def test_a_value_of_another_type_is_refused_by_name(module: str) -> None:
    taken = [
        f"{entry.name} = {value!r}"
        for config in configs(module)
        for entry in entries(config)
        for value in WRONG[entry.kind]
        if not refused(config, entry, value)
    ]
    assert taken == []
