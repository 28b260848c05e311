"""Placeholders in rows that are data: `$name`, and sums of products of numbers and names.

$level                    the value of a name, of any kind
5.0 + 7.5*$seconds        a number: + - * / of numbers and names, without brackets
{in_turn: [0.2, -0.2]}    the first value for the first trial, the second for the next, ...
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any

from cassie_msgs.structured import path_of, shown
from cassie_msgs.tunables import ParameterError, unknown_name

Names = Mapping[str, Any | Callable[[], float]]
"""Value of each name; a function gives a value that is costly."""

_FACTOR = r"(?:\$[a-z_]+|\d+(?:\.\d*)?(?:e-?\d+)?)"
_PRODUCT = rf"{_FACTOR}(?:\s*[*/]\s*{_FACTOR})*"
_SUM = re.compile(rf"\s*-?\s*{_PRODUCT}(?:\s*[+-]\s*{_PRODUCT})*\s*")
_TERMS = re.compile(rf"([+-]?)\s*({_PRODUCT})")
_FACTORS = re.compile(rf"([*/]?)\s*({_FACTOR})")
_IN_TEXT = re.compile(r"\$(\+?)([a-z_]+)")


def resolved(value: Any, names: Names, where: str = "") -> Any:
    """A value from YAML in which every placeholder is replaced.

    Args:
        value: Word, number, list or mapping.
        names: Value of each name; `index` is the number of the trial, from 0.
        where: Path of the value's key, for messages.

    Raises:
        ParameterError: naming the key, and the nearest known name if one is unknown.
    """
    if isinstance(value, str):
        return _formula(value, names, where) if "$" in value else value
    if isinstance(value, Mapping):
        if set(value) == {"in_turn"}:
            return _in_turn(value["in_turn"], names, path_of(where, "in_turn"))
        return {key: resolved(each, names, path_of(where, str(key))) for key, each in value.items()}
    if isinstance(value, list):
        return [resolved(each, names, f"{where}.{index}") for index, each in enumerate(value)]
    return value


def filled(text: str, names: Names, where: str, gap: str = "_") -> str:
    """A text with values for its placeholders; `$+name` gives a number a sign.

    Args:
        text: Text with placeholders.
        names: Value of each name.
        where: Path of the text's key, for messages.
        gap: What stands for each underscore of a value.

    Raises:
        ParameterError: if a name is unknown; the message names key and nearest name.
    """

    def word(match: re.Match[str]) -> str:
        found = _value(match[2], names, where)
        if isinstance(found, str):
            return found.replace("_", gap)
        if not isinstance(found, (int, float)):
            raise ParameterError(f"{where}: ${match[2]} = {shown(found)} is no word or number")
        return f"{found:{match[1]}g}"

    return _IN_TEXT.sub(word, text)


def _formula(text: str, names: Names, where: str) -> Any:
    if not _SUM.fullmatch(text):
        expected = "numbers and $names, joined by + - * /"
        raise ParameterError(f"{where} = {shown(text)} is not a formula: expected {expected}")
    if text[1:].isidentifier():
        return _value(text[1:], names, where)
    total: float | None = None
    for sign, product in _TERMS.findall(text):
        term = _product(product, names, where)
        term = -term if sign == "-" else term
        total = term if total is None else total + term
    return total


def _product(text: str, names: Names, where: str) -> float:
    result = 1.0
    for operator, factor in _FACTORS.findall(text):
        number = _number(factor, names, where)
        if operator == "/" and not number:
            raise ZeroDivisionError(f"{where}: {text} divides by 0")
        result = result / number if operator == "/" else result * number
    return result


def _number(factor: str, names: Names, where: str) -> float:
    if not factor.startswith("$"):
        return float(factor)
    number = _value(factor[1:], names, where)
    if isinstance(number, bool) or not isinstance(number, (int, float)):
        raise ParameterError(f"{where}: {factor} = {shown(number)} is not a number")
    return number


def _value(name: str, names: Names, where: str) -> Any:
    if name not in names:
        raise ParameterError(f"{where}: {unknown_name(name, names, 'name')}")
    found = names[name]
    others = {other: names[other] for other in names if other != name}
    return found() if callable(found) else resolved(found, others, where)


def _in_turn(values: Any, names: Names, where: str) -> Any:
    if not isinstance(values, list) or not values:
        raise ParameterError(f"{where} = {shown(values)} is not a list of at least one value")
    return resolved(values[_value("index", names, where) % len(values)], names, where)
