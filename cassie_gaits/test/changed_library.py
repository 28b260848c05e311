"""Drawn changes of a gait library's document, for tests of what is refused."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

Document = dict[str, Any]
Place = tuple[Any, Any]
"""A list or object, and the index or key in it."""


def places(value: Any, kinds: tuple[type, ...]) -> Iterator[Place]:
    """Where values of some kinds stand, true and false never counted as numbers."""
    entries = value.items() if isinstance(value, dict) else enumerate(value)
    for key, entry in entries:
        if isinstance(entry, kinds) and not isinstance(entry, bool):
            yield value, key
        if isinstance(entry, dict | list):
            yield from places(entry, kinds)


def one_number(original: Document, rng: np.random.Generator) -> Document:
    """One number changed, by a factor that is near 1 as often as far from it."""
    document = copy.deepcopy(original)
    gait = pick(document["gaits"], rng)
    parts = [*(gait[name] for name in ("coefficients", "torques", "passive")), gait["solver"]]
    parts += [gait["certificate"], gait, document["provenance"]]
    holder, key = pick(list(places(pick(parts, rng), (int, float))), rng)
    factor = 1.0 + rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-9.0, 1.0)
    holder[key] = holder[key] * factor if holder[key] else 10.0 ** rng.uniform(-9.0, 1.0)
    return document


def wild(original: Document, rng: np.random.Generator) -> Document:
    """One to three changes of any kind."""
    document = copy.deepcopy(original)
    for _ in range(rng.integers(1, 4)):
        pick(CHANGES, rng)(document, rng)
    return document


def pick(choices: Any, rng: np.random.Generator) -> Any:
    """One of a list."""
    return choices[int(rng.integers(len(choices)))]


def _wild_number(document: Document, rng: np.random.Generator) -> None:
    gait = pick(document["gaits"], rng)
    holder, key = pick(list(places(gait, (int, float))), rng)
    wild = (0.0, -1.0, 0.05, 100.0, 9329.0, 1e-9, 1e6, 1e300, -0.0, -1e12, 3, 10**30)
    holder[key] = pick(wild, rng)


def _swing_yaw(document: Document, rng: np.random.Generator) -> None:
    rows = pick(document["gaits"], rng)["coefficients"][pick(("right_stance", "left_stance"), rng)]
    rows[5] = [float(rng.uniform(1.0, 100.0))] * 6


def _step_time(document: Document, rng: np.random.Generator) -> None:
    pick(document["gaits"], rng)["step_time"] = float(rng.uniform(0.05, 2.0))


def _torque(document: Document, rng: np.random.Generator) -> None:
    rows = pick(document["gaits"], rng)["torques"]["right_stance"]
    pick(rows, rng)[int(rng.integers(len(rows[0])))] = float(rng.uniform(-1e4, 1e4))


def _exchange_rows(document: Document, rng: np.random.Generator) -> None:
    rows = pick(document["gaits"], rng)[pick(("coefficients", "torques"), rng)]["left_stance"]
    i, j = rng.choice(len(rows), 2, replace=False)
    rows[i], rows[j] = rows[j], rows[i]


def _exchange_stances(document: Document, rng: np.random.Generator) -> None:
    part = pick(document["gaits"], rng)[pick(("coefficients", "torques", "passive"), rng)]
    part["right_stance"], part["left_stance"] = part["left_stance"], part["right_stance"]


def _exchange_gaits(document: Document, rng: np.random.Generator) -> None:
    one, other = rng.choice(len(document["gaits"]), 2, replace=False)
    for name in ("coefficients", "torques"):
        gaits = document["gaits"]
        gaits[one][name], gaits[other][name] = gaits[other][name], gaits[one][name]


def _drop_gait(document: Document, rng: np.random.Generator) -> None:
    if len(document["gaits"]) > 2:
        del document["gaits"][int(rng.integers(len(document["gaits"])))]


def _repeat_gait(document: Document, rng: np.random.Generator) -> None:
    gait = copy.deepcopy(pick(document["gaits"], rng))
    gait["vx"] = document["gaits"][-1]["vx"] + 0.25
    document["gaits"].append(gait)


def _certificate_of_another(document: Document, rng: np.random.Generator) -> None:
    one, other = rng.choice(len(document["gaits"]), 2, replace=False)
    document["gaits"][one]["certificate"] = document["gaits"][other]["certificate"]


def _drop_key(document: Document, rng: np.random.Generator) -> None:
    holder = pick(list(_objects(document)), rng)
    if holder:
        del holder[pick(sorted(holder), rng)]


def _rename_key(document: Document, rng: np.random.Generator) -> None:
    holder = pick(list(_objects(document)), rng)
    if holder:
        key = pick(sorted(holder), rng)
        holder[key + "_"] = holder.pop(key)


def _name(document: Document, rng: np.random.Generator) -> None:
    holder, key = pick(list(places(document, (str,))), rng)
    holder[key] = holder[key][:-1] + pick("abcdef0123456789", rng) + "x"


def _another_kind(document: Document, rng: np.random.Generator) -> None:
    holder, key = pick(list(places(document, (int, float, str, dict, list))), rng)
    holder[key] = pick((None, True, "x", [], {}, [[0.0]], [[[[[[[[[[[]]]]]]]]]]], "\n" * 9), rng)


def _objects(value: Any) -> Iterator[dict[str, Any]]:
    if isinstance(value, dict):
        yield value
        yield from (part for entry in value.values() for part in _objects(entry))
    elif isinstance(value, list):
        yield from (part for entry in value for part in _objects(entry))


CHANGES: tuple[Callable[[Document, np.random.Generator], None], ...] = (
    _wild_number,
    _swing_yaw,
    _step_time,
    _torque,
    _exchange_rows,
    _exchange_stances,
    _exchange_gaits,
    _drop_gait,
    _repeat_gait,
    _certificate_of_another,
    _drop_key,
    _rename_key,
    _name,
    _another_kind,
)
