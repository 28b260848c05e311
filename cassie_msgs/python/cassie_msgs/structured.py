"""Conversion of YAML content to frozen dataclasses, and back.

The annotations of a class say what a file may contain under the name of each field:

    bool, int, float, str, tuple of floats     a value, within the range of its `tunable`
    a dataclass                                a mapping, with a key for each field
    tuple[dataclass, ...]                      a list of such mappings
    Mapping[str, dataclass]                    such mappings by name
    Mapping[str, Any]                          a mapping that is checked elsewhere
    any of these | None                        that, or null

An error names the path of the key as `--set` takes it (`pushes.0.force[2]`), the value and the
permitted values. Rules about several fields are in `__post_init__` of the class, which raises
`ParameterError`. A class with another form in files has a class method `from_content`.
"""

from __future__ import annotations

import dataclasses
import types
import typing
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

from cassie_msgs.tunables import ParameterError, check_value, fields_of, unknown_name

ModelT = TypeVar("ModelT")


def structure(cls: type[ModelT], content: object, where: str = "") -> ModelT:
    """An instance of a class, from the content of a file.

    Args:
        cls: Frozen dataclass.
        content: Content as YAML gives it; null is an empty mapping.
        where: Path of the content's key, empty for a whole file.

    Raises:
        ParameterError: naming the key's path, its value and the permitted values.
    """
    mapping = as_section(content, where)
    own = getattr(cls, "from_content", None)
    if own is not None:
        made: ModelT = own(mapping, where)
        return made
    return structure_fields(cls, mapping, where)


def structure_fields(cls: type[ModelT], mapping: Mapping[str, Any], where: str) -> ModelT:
    """Like `structure`, but without the class's own `from_content`."""
    fields = fields_of(typing.cast(Any, cls))
    refuse_unknown(mapping, [field.name for field, _ in fields], where)
    values = {}
    for field, hint in fields:
        if field.name in mapping:
            values[field.name] = _value(field, hint, mapping[field.name], where)
        elif field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
            spec = field.metadata.get("tunable")
            what = f" ({spec.range_text}): {spec.description}" if spec else ""
            raise ParameterError(f"{path_of(where, field.name)} must be given{what}")
    try:
        return cls(**values)
    except ParameterError as error:
        raise ParameterError(f"{where}: {error}" if where else str(error)) from None


def structure_entry(cls: type[ModelT], content: object, where: str) -> ModelT:
    """Like `structure`, for one entry of several, which must not be null.

    Raises:
        ParameterError: as `structure`; for an entry that is no mapping, it names the `FORM` of the
            class.
    """
    if not isinstance(content, Mapping):
        form = getattr(cls, "FORM", "a mapping of names to values")
        raise ParameterError(f"{where} = {shown(content)} is not {form}")
    return structure(cls, content, where)


def field_value(cls: type, name: str, given: object, where: str = "") -> Any:
    """The value of one field of a class, checked.

    Raises:
        ParameterError: as `structure`.
    """
    field, hint = next(entry for entry in fields_of(cls) if entry[0].name == name)
    return _value(field, hint, given, where)


def unstructure(model: Any) -> dict[str, Any]:
    """The content from which `structure` makes the same instance, without optional null values.

    Raises:
        TypeError: if `model` is no dataclass.
    """
    own = getattr(model, "to_content", None)
    if own is not None:
        content: dict[str, Any] = own()
        return content
    return {
        field.name: _plain(value)
        for field in dataclasses.fields(model)
        if (value := getattr(model, field.name)) is not None or field.default is not None
    }


def as_section(content: object, where: str) -> Mapping[str, Any]:
    """Content as a mapping; null is an empty mapping.

    Raises:
        ParameterError: if the content is something else.
    """
    if content is None:
        return {}
    if not isinstance(content, Mapping):
        name = f"{where} = " if where else ""
        raise ParameterError(f"{name}{shown(content)} is not a mapping of names to values")
    return content


def refuse_unknown(mapping: Mapping[str, Any], known: Sequence[str], where: str) -> None:
    """Raise a ParameterError that names the nearest known key if a key is unknown."""
    for key in mapping:
        if key not in known:
            message = unknown_name(str(key), known, "key")
            raise ParameterError(f"{where}: {message}" if where else message)


def path_of(where: str, name: str) -> str:
    """Path of a key below another."""
    return f"{where}.{name}" if where else name


_SHOWN = 60  # most characters of a wrong value in an error message


def shown(content: object) -> str:
    """The beginning of a value that may be as long as a file."""
    text = content if isinstance(content, str) else str(content)
    return repr(content) if len(text) <= _SHOWN else f"{text[:_SHOWN]!r}..."


def _value(field: dataclasses.Field[Any], hint: Any, given: Any, where: str) -> Any:
    path = path_of(where, field.name)
    hint, optional = _without_none(hint)
    if given is None and optional:
        return None
    if dataclasses.is_dataclass(hint):
        return structure(typing.cast(type, hint), given, path)
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if origin is tuple and dataclasses.is_dataclass(inner[0]):
        entries = [] if given is None else given
        if not isinstance(entries, (list, tuple)):
            raise ParameterError(f"{path} = {shown(given)} is not a list")
        kind = typing.cast(type, inner[0])
        return tuple(structure_entry(kind, e, f"{path}.{i}") for i, e in enumerate(entries))
    if origin is Mapping:
        section = as_section(given, path)
        if not dataclasses.is_dataclass(inner[1]):
            return dict(section)
        refuse_unknown(section, field.metadata["known"], path)
        kind = typing.cast(type, inner[1])
        return {key: structure_entry(kind, e, path_of(path, key)) for key, e in section.items()}
    return check_value(path, hint, given, field.metadata.get("tunable"))


def _without_none(hint: Any) -> tuple[Any, bool]:
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        (rest,) = (each for each in typing.get_args(hint) if each is not type(None))
        return rest, True
    return hint, False


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value):
        return unstructure(value)
    if isinstance(value, Mapping):
        return {key: _plain(each) for key, each in value.items()}
    return [_plain(each) for each in value] if isinstance(value, (list, tuple)) else value
