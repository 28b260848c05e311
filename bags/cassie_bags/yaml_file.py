"""YAML read strictly, and changes to it from a command line."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import yaml

from cassie_bags.errors import ExperimentError
from cassie_msgs.tunables import flatten


class _StrictLoader(yaml.SafeLoader):
    """Safe YAML that refuses a key given twice and knows 1e3 as a number."""


def _mapping(loader: _StrictLoader, node: yaml.MappingNode) -> dict[Any, Any]:
    seen: set[Any] = set()
    for key_node, _ in node.value:
        key = loader.construct_object(key_node, deep=True)
        if isinstance(key, (dict, list)):
            raise yaml.MarkedYAMLError(problem="a key is no word", problem_mark=key_node.start_mark)
        if key in seen:
            raise yaml.MarkedYAMLError(
                problem=f"key {key} is given twice", problem_mark=key_node.start_mark
            )
        seen.add(key)
    loader.flatten_mapping(node)
    return dict(loader.construct_pairs(node, deep=True))


_StrictLoader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _mapping)
_StrictLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$"),
    list("-+.0123456789"),
)


def read_yaml(path: Path) -> dict[str, Any]:
    """A YAML file that holds a mapping.

    Raises:
        ExperimentError: if it cannot be read, is not YAML, gives a key twice or is no mapping.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ExperimentError(f"cannot read {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ExperimentError(f"{path} is not a text file") from None
    return parse_yaml(text, str(path))


def parse_yaml(text: str, name: str) -> dict[str, Any]:
    """Like `read_yaml`, from text; `name` stands for the file in messages."""
    content = _load(text, name)
    if not isinstance(content, dict):
        raise ExperimentError(f"{name} holds no mapping of keys to values")
    return content


def apply_changes(content: dict[str, Any], changes: Iterable[str]) -> None:
    """Apply `key=value` words in place; dots lead into mappings, numbers into lists.

    Args:
        content: As `read_yaml` gives it.
        changes: For example `controller.kp_knee=300` or `operator.3.vx=0.6`; or `@file.yaml`,
            whose values are put in the same way.

    Raises:
        ExperimentError: if a change has no `=`, or leads nowhere; if a file cannot be read.
    """
    for change in changes:
        if change.startswith("@"):
            for name, entry in flatten(read_yaml(Path(change[1:]))).items():
                _set(content, name.split("."), entry, change)
            continue
        key, equals, value = change.partition("=")
        if not equals or not key:
            raise ExperimentError(f"--set {change}: expected key=value")
        _set(content, key.split("."), _load(value, f"--set {change}"), change)


def spelled_out(changes: Iterable[str]) -> tuple[str, ...]:
    """Changes without files: their values as `key=value`, for workers that have not those files.

    Raises:
        ExperimentError: if a file cannot be read.
    """
    words: list[str] = []
    for change in changes:
        if change.startswith("@"):
            found = flatten(read_yaml(Path(change[1:])))
            words += [f"{name}={json.dumps(entry)}" for name, entry in found.items()]
        else:
            words.append(change)
    return tuple(words)


def _load(text: str, name: str) -> Any:
    try:
        return yaml.load(text, _StrictLoader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        line = f":{mark.line + 1}" if mark is not None else ""
        raise ExperimentError(f"{name}{line}: {error.problem}") from None
    except (yaml.YAMLError, ValueError) as error:
        raise ExperimentError(f"{name}: {' '.join(str(error).split())}") from None


def _set(content: dict[str, Any], path: list[str], value: Any, change: str) -> None:
    place: Any = content
    for depth, word in enumerate(path[:-1]):
        if isinstance(place, dict) and place.get(word) is None:
            place[word] = {}
        key = _key(place, word, ".".join(path[:depth]), change)
        place = place[key]
    place[_key(place, path[-1], ".".join(path[:-1]), change)] = value


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
