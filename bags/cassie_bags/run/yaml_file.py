"""YAML of experiments, and changes to it from a command line."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from cassie_bags.errors import ExperimentError
from cassie_msgs.strict_yaml import YamlError, parse_yaml, read_yaml
from cassie_msgs.tunables import ParameterError, flatten


def read_mapping(path: Path) -> dict[str, Any]:
    """A YAML file that holds a mapping.

    Raises:
        ExperimentError: if it cannot be read, is no strict YAML or is no mapping.
    """
    return _mapping(_in_words(read_yaml, path), str(path))


def parse_mapping(text: str, name: str) -> dict[str, Any]:
    """Like `read_mapping`, from text; `name` stands for the file in messages."""
    return _mapping(_in_words(parse_yaml, text, name), name)


def apply_changes(content: dict[str, Any], changes: Iterable[str]) -> None:
    """Apply changes in place; dots in a key lead into mappings, numbers into lists.

    Args:
        content: Mapping as from `read_mapping`.
        changes: Words such as `controller.kp_knee=300` or `operator.3.vx=0.6`; or `@file.yaml`,
            which applies the values of a file. The last of several changes to one key holds.

    Raises:
        ExperimentError: if a change has no `=`, or leads nowhere; if a file cannot be read.
    """
    for change in changes:
        for name, value in _values(change).items():
            _set(content, name.split("."), value, change)


def consistent(changes: Iterable[str]) -> tuple[str, ...]:
    """The changes of one command line, after a check that they give no key two values.

    A `key=value` may replace a value from a file before it.

    Raises:
        ExperimentError: naming the key and both changes; and as `apply_changes`.
    """
    given: dict[str, tuple[Any, str]] = {}
    words = tuple(changes)
    for change in words:
        values = _values(change)
        named = flat(values, f"--set {change}")
        for known, (before, earlier) in given.items():
            replaced = any(f"{known}.".startswith(f"{key}.") for key in values)
            may_replace = earlier.startswith("@") and not change.startswith("@")
            if replaced and not may_replace and (known not in named or named[known] != before):
                raise ExperimentError(f"{known} is given twice: {earlier} and {change}")
        given |= {name: (value, change) for name, value in named.items()}
    return words


def spelled_out(changes: Iterable[str]) -> tuple[str, ...]:
    """Changes as `key=value` words without files, for workers that do not have those files.

    Raises:
        ExperimentError: if a file cannot be read; and as `consistent`.
    """
    words: list[str] = []
    for change in consistent(changes):
        if change.startswith("@"):
            words += [f"{name}={json.dumps(entry)}" for name, entry in _values(change).items()]
        else:
            words.append(change)
    return tuple(words)


def flat(content: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Nested mappings as one mapping with dotted names.

    Raises:
        ExperimentError: if two spellings of one name are given; `name` stands for the file there.
    """
    try:
        return flatten(content)
    except ParameterError as error:
        raise ExperimentError(f"{name}: {error}") from None


def _values(change: str) -> dict[str, Any]:
    """Dotted names and values of a change."""
    if change.startswith("@"):
        return flat(read_mapping(Path(change[1:])), change)
    key, equals, value = change.partition("=")
    if not equals or not key:
        raise ExperimentError(f"{change}: expected key=value")
    return {key: _in_words(parse_yaml, value, f"--set {change}")}


def _in_words(read: Callable[..., Any], *arguments: Any) -> Any:
    try:
        return read(*arguments)
    except YamlError as error:
        raise ExperimentError(str(error)) from None


def _mapping(content: Any, name: str) -> dict[str, Any]:
    if not isinstance(content, dict):
        raise ExperimentError(f"{name} holds no mapping of keys to values")
    return content


def _set(content: dict[str, Any], path: list[str], value: Any, change: str) -> None:
    place: Any = content
    depth = 0
    while True:
        words = _spelling(place, path[depth:])
        key = _key(place, ".".join(path[depth : depth + words]), ".".join(path[:depth]), change)
        depth += words
        if depth == len(path):
            break
        if isinstance(place, dict) and place.get(key) is None:
            place[key] = {}
        place = place[key]
    if isinstance(place, dict):  # the replaced value may also be spelled with dots
        for name in [name for name in place if str(name).startswith(f"{key}.")]:
            del place[name]
    place[key] = value


def _spelling(place: Any, path: list[str]) -> int:
    """Number of words of a path that are one key here: `walk.law: x` means `walk: {law: x}`."""
    if isinstance(place, dict):
        for words in range(len(path), 1, -1):
            if ".".join(path[:words]) in place:
                return words
    return 1


def _key(place: Any, word: str, where: str, change: str) -> Any:
    if isinstance(place, dict):
        return word
    if not isinstance(place, list):
        raise ExperimentError(f"--set {change}: {where} is a value, nothing lies in it")
    if not word.isdecimal():
        raise ExperimentError(f"--set {change}: {where} is a list, {word} is no index into it")
    if int(word) >= len(place):
        known = f"0 .. {len(place) - 1}" if place else "none, it is empty"
        raise ExperimentError(f"--set {change}: index {word} of {where} is not one of {known}")
    return int(word)
