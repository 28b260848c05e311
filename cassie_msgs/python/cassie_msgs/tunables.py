"""Tunable parameters: fields of frozen dataclasses with unit, range and description.

A parameter is declared once, as a field of a frozen dataclass:

    @dataclass(frozen=True, kw_only=True)
    class WalkGains:
        kp_knee: float = tunable(200.0, "Nm/rad", 0, 2000, "Stiffness of the knee drives")

The ROS parameters, their descriptors and the checks of YAML files come from this declaration.
A field that is itself such a dataclass gives dotted names (`gains.kp_knee`).
"""

from __future__ import annotations

import dataclasses
import difflib
import math
import reprlib
import typing
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from typing import Any, TypeVar

_MOST_NAMES = 30  # most names that an error message lists
_KEY = "tunable"
ConfigT = TypeVar("ConfigT")


class ParameterError(ValueError):
    """A parameter is unknown, missing, of the wrong type or out of its range."""


@dataclasses.dataclass(frozen=True)
class Tunable:
    """Metadata of one tunable field: everything besides its value."""

    unit: str
    low: float | None
    high: float | None
    description: str
    live: bool
    choices: tuple[str, ...]

    @property
    def range_text(self) -> str:
        """Text of the permitted values, with the unit."""
        if self.choices:
            return "one of " + ", ".join(self.choices)
        if self.low is None and self.high is None:
            return f"any value in {self.unit}" if self.unit else "any value"
        low = "-inf" if self.low is None else f"{self.low:g}"
        high = "inf" if self.high is None else f"{self.high:g}"
        return f"{low} .. {high} {self.unit}".rstrip()


@dataclasses.dataclass(frozen=True)
class Entry:
    """One tunable field of an instance: dotted name, type, value and description.

    `kind` is bool, int, float, str or tuple. A tuple holds `length` floats (None: any number).
    """

    name: str
    kind: type
    length: int | None
    value: Any
    spec: Tunable


def tunable(
    default: Any,
    unit: str = "",
    low: float | None = None,
    high: float | None = None,
    description: str = "",
    live: bool = True,
    choices: Iterable[str] = (),
) -> Any:
    """A dataclass field that can be tuned.

    Args:
        default: Default value; `dataclasses.MISSING` if a value must be given.
        unit: SI unit, empty for a dimensionless number, a bool or a string.
        low: Least permitted value, of each element for a tuple; None for no bound.
        high: Greatest permitted value; None for no bound.
        description: One line for people.
        live: Whether the value may change while the node runs.
        choices: Permitted values of a string.
    """
    spec = Tunable(unit, low, high, description, live, tuple(choices))
    return dataclasses.field(default=default, metadata={_KEY: spec})


def entries(instance: Any, prefix: str = "") -> Iterator[Entry]:
    """Every tunable field of a dataclass instance; a nested field has a dotted name."""
    cls: Any = type(instance)
    for field, hint in fields_of(cls):
        value = getattr(instance, field.name)
        if dataclasses.is_dataclass(hint):
            yield from entries(value, f"{prefix}{field.name}.")
        elif _KEY in field.metadata:
            kind, length = _kind(hint)
            yield Entry(prefix + field.name, kind, length, value, field.metadata[_KEY])


def names(cls: Any) -> list[str]:
    """Dotted names of the tunable fields of a dataclass."""
    found = []
    for field, hint in fields_of(cls):
        if dataclasses.is_dataclass(hint):
            found += [f"{field.name}.{name}" for name in names(hint)]
        elif _KEY in field.metadata:
            found.append(field.name)
    return found


def as_mapping(instance: Any) -> dict[str, Any]:
    """Value of every tunable field by dotted name; tuples become lists."""
    return {
        entry.name: list(entry.value) if entry.kind is tuple else entry.value
        for entry in entries(instance)
    }


def check(instance: Any) -> None:
    """Check every tunable field of `instance` against its type and range.

    Raises:
        ParameterError: naming the field, its value and the permitted values.
    """
    for entry in entries(instance):
        _check_value(entry)


def replace_checked(instance: ConfigT, **changes: Any) -> ConfigT:
    """A copy of `instance` with `changes`, checked.

    Args:
        instance: Dataclass instance.
        **changes: Values by name; dotted names are passed as `**{"gains.kp": 3.0}`.

    Raises:
        ParameterError: if a name is unknown (the message names the nearest known one),
            or a value does not fit.
    """
    for name in changes:
        if name not in (known := names(type(instance))):
            raise ParameterError(unknown_name(name, known, "parameter"))
    changed: ConfigT = _replace(instance, changes)
    check(changed)
    return changed


def from_mapping(cls: type[ConfigT], mapping: Mapping[str, Any]) -> ConfigT:
    """An instance of `cls` from a mapping as YAML gives it, nested or with dotted names.

    Raises:
        ParameterError: if a name is unknown, a field without default is missing, or a
            value does not fit.
    """
    flat = flatten(mapping)
    known = names(cls)
    for name in flat:
        if name not in known:
            raise ParameterError(unknown_name(name, known, "parameter"))
    for name in _empty(mapping):
        if name in known:
            raise ParameterError(f"{name} = {{}} is a mapping, expected a value")
    config = typing.cast(ConfigT, _build(cls, flat, ""))
    check(config)
    return config


def check_value(name: str, hint: Any, value: Any, spec: Tunable | None) -> Any:
    """A value from YAML, checked and converted to the type of its field.

    Args:
        name: Name of the value, for messages.
        hint: bool, int, float, str, or a tuple of floats.
        value: Value that was given.
        spec: Permitted values; None if every value of the type is permitted.

    Raises:
        ParameterError: naming the value and the permitted values.
    """
    kind, length = _kind(hint)
    converted = _converted(hint, value)
    free = Tunable("", None, None, "", True, ())
    _check_value(Entry(name, kind, length, converted, spec or free))
    return converted


def flatten(mapping: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested mappings as one mapping with dotted names.

    Raises:
        ParameterError: if a name is given twice, nested and with dots.
    """
    flat: dict[str, Any] = {}
    for name, value in mapping.items():
        nested = isinstance(value, Mapping)
        part = flatten(value, f"{prefix}{name}.") if nested else {f"{prefix}{name}": value}
        for twice in flat.keys() & part.keys():
            raise ParameterError(f"{twice} is given twice: {flat[twice]!r} and {part[twice]!r}")
        flat |= part
    return flat


def _empty(mapping: Mapping[str, Any], prefix: str = "") -> Iterator[str]:
    """Dotted names of empty mappings, of which `flatten` leaves nothing."""
    for name, value in mapping.items():
        if isinstance(value, Mapping):
            yield from _empty(value, f"{prefix}{name}.") if value else [f"{prefix}{name}"]


def unknown_name(name: str, known: Iterable[str], what: str) -> str:
    """Error message for an unknown name: the nearest known name, or all names or their groups."""
    choices = sorted(known)
    if near := difflib.get_close_matches(name, choices, n=1, cutoff=0.5):
        return f"unknown {what} {name}: did you mean {near[0]}?"
    if len(choices) > _MOST_NAMES:
        groups = sorted({choice.partition(".")[0] for choice in choices})
        return f"unknown {what} {name}: known groups: {', '.join(groups)}"
    return f"unknown {what} {name}: known: {', '.join(choices)}"


@cache
def fields_of(cls: Any) -> tuple[tuple[dataclasses.Field[Any], Any], ...]:
    """Each field of a dataclass, with its resolved annotation."""
    hints = typing.get_type_hints(cls)
    return tuple((field, hints[field.name]) for field in dataclasses.fields(cls))


def _kind(hint: Any) -> tuple[type, int | None]:
    if hint in (bool, int, float, str):
        return hint, None
    if typing.get_origin(hint) is tuple:
        args = typing.get_args(hint)
        return tuple, None if Ellipsis in args else len(args)
    raise TypeError(f"{hint} is no type of a tunable: bool, int, float, str, tuple of floats")


def _check_value(entry: Entry) -> None:
    value, spec = entry.value, entry.spec
    if entry.kind is tuple:
        if not isinstance(value, tuple) or entry.length not in (None, len(value)):
            count = "numbers" if entry.length is None else f"{entry.length} numbers"
            raise ParameterError(f"{entry.name} = {value!r} is not a list of {count}")
        for index, element in enumerate(value):
            _check_number(f"{entry.name}[{index}]", element, float, spec)
    elif entry.kind in (bool, str):
        if not isinstance(value, entry.kind):
            what = "true or false" if entry.kind is bool else "a word"
            raise ParameterError(f"{entry.name} = {value!r} is not {what}")
        if spec.choices and value not in spec.choices:
            raise ParameterError(f"{entry.name} = {value!r} is not {spec.range_text}")
    else:
        _check_number(entry.name, value, entry.kind, spec)


def _check_number(name: str, value: Any, kind: type, spec: Tunable) -> None:
    permitted: Any = int if kind is int else (int, float)
    if isinstance(value, bool) or not isinstance(value, permitted):
        what = "a whole number" if kind is int else "a number"
        raise ParameterError(f"{name} = {value!r} is not {what}")
    finite = isinstance(value, int) or math.isfinite(value)  # NaN compares false with every bound
    outside = not finite
    outside = outside or (spec.low is not None and value < spec.low)
    outside = outside or (spec.high is not None and value > spec.high)
    if outside:
        number = reprlib.repr(value) if isinstance(value, int) else f"{value:g}"
        given = f"{number} {spec.unit}".rstrip()
        reason = "" if finite or None not in (spec.low, spec.high) else ": it is not finite"
        raise ParameterError(f"{name} = {given} is outside {spec.range_text}{reason}")


def _replace(instance: Any, changes: Mapping[str, Any], prefix: str = "") -> Any:
    """A copy with changes by dotted name; each is checked before a class compares its fields."""
    own: dict[str, Any] = {}
    cls: Any = type(instance)
    for field, hint in fields_of(cls):
        name = prefix + field.name
        if dataclasses.is_dataclass(hint):
            if any(key.startswith(f"{name}.") for key in changes):
                own[field.name] = _replace(getattr(instance, field.name), changes, f"{name}.")
        elif name in changes:
            own[field.name] = _fitting(field, hint, name, changes[name])
    return dataclasses.replace(instance, **own)


def _build(cls: Any, flat: Mapping[str, Any], prefix: str) -> Any:
    values: dict[str, Any] = {}
    for field, hint in fields_of(cls):
        name = prefix + field.name
        if dataclasses.is_dataclass(hint):
            values[field.name] = _build_nested(field, hint, flat, f"{name}.")
        elif name in flat:
            values[field.name] = _fitting(field, hint, name, flat[name])
        elif _is_required(field):
            spec = field.metadata.get(_KEY)
            text = f" ({spec.range_text}): {spec.description}" if spec else ""
            raise ParameterError(f"{name} must be given{text}")
    return cls(**values)


def _build_nested(field: Any, hint: Any, flat: Mapping[str, Any], prefix: str) -> Any:
    if _is_required(field):
        return _build(hint, flat, prefix)
    default = field.default if field.default is not dataclasses.MISSING else field.default_factory()
    return _replace(default, flat, prefix)


def _fitting(field: Any, hint: Any, name: str, value: Any) -> Any:
    """A value in the type of its field, within its range."""
    return check_value(name, hint, value, field.metadata.get(_KEY))


def _is_required(field: Any) -> bool:
    missing = dataclasses.MISSING
    return field.default is missing and field.default_factory is missing


def _converted(hint: Any, value: Any) -> Any:
    """A YAML or ROS value in the type of its field; one beyond all floats is infinite."""
    if hint is float and isinstance(value, int) and not isinstance(value, bool):
        try:
            return float(value)
        except OverflowError:
            return math.inf if value > 0 else -math.inf
    if typing.get_origin(hint) is tuple and not isinstance(value, (str, bytes)):
        try:
            return tuple(_converted(float, element) for element in value)
        except TypeError:
            return value
    return value
