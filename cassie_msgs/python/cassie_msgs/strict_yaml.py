"""Strict YAML reader with bounded memory, for every file that people write.

It is stricter than YAML itself: a key may be given once. Aliases (`*name`) and merge keys (`<<`)
are refused, as a small file with them can expand to any size; so are tags (`!!int`). Numbers are
decimal as in YAML 1.2: `1e3` and `010` are 1000 and 10, `1:30` and `1_000` are words.
"""

from __future__ import annotations

import errno
import os
import re
import stat
from pathlib import Path
from typing import Any

import yaml

MOST_BYTES = 4 * 2**20
"""Largest size of a file. In bytes."""

MOST_NODES = 100_000
"""Largest number of keys, values, lists and mappings in a file."""


_LONGEST = 200  # most characters of a reason


class YamlError(ValueError):
    """A file cannot be read, or is not strict YAML. The message names file, line and reason."""


class _StrictLoader(yaml.SafeLoader):
    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.nodes = 0

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        event = self.peek_event()  # type: ignore[no-untyped-call]
        mark = event.start_mark
        if self.check_event(yaml.AliasEvent):
            raise _refusal("aliases (*name) are not read: write the value out", mark)
        if event.tag is not None:
            tag = event.tag.replace("tag:yaml.org,2002:", "!!")
            raise _refusal(f"tags ({tag}) are not read: write the value alone", mark)
        self.nodes += 1
        if self.nodes > MOST_NODES:
            raise _refusal(f"it holds more than {MOST_NODES} keys and values", mark)
        node: yaml.Node | None = super().compose_node(parent, index)
        return node


def _mapping(loader: _StrictLoader, node: yaml.MappingNode) -> dict[Any, Any]:
    content: dict[Any, Any] = {}
    for key_node, value_node in node.value:
        if key_node.tag == "tag:yaml.org,2002:merge":
            raise _refusal(
                "merge keys (<<) are not read: write the values out", key_node.start_mark
            )
        if not isinstance(key_node, yaml.ScalarNode):
            raise _refusal("a key is no word", key_node.start_mark)
        key = loader.construct_object(key_node)
        if key in content:
            raise _refusal(f"key {key} is given twice", key_node.start_mark)
        content[key] = loader.construct_object(value_node, deep=True)
    return content


def _refusal(problem: str, mark: Any) -> yaml.MarkedYAMLError:
    return yaml.MarkedYAMLError(problem=problem, problem_mark=mark)


def _whole_number(loader: _StrictLoader, node: yaml.ScalarNode) -> int:
    return int(loader.construct_scalar(node))


_INT, _FLOAT = (f"tag:yaml.org,2002:{kind}" for kind in ("int", "float"))
_NUMBERS = {
    _INT: r"[-+]?\d+",
    _FLOAT: r"[-+]?((\d+\.?\d*|\.\d+)([eE][-+]?\d+)?|\.(inf|Inf|INF))|\.(nan|NaN|NAN)",
}

_StrictLoader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _mapping)
_StrictLoader.add_constructor(_INT, _whole_number)
_StrictLoader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag not in _NUMBERS]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
for _tag, _pattern in _NUMBERS.items():
    _StrictLoader.add_implicit_resolver(_tag, re.compile(f"^({_pattern})$"), list("-+.0123456789"))


def read_yaml(path: Path) -> Any:
    """The content of a YAML file.

    Raises:
        YamlError: if the file cannot be read, is a folder, device, pipe or socket, is larger than
            `MOST_BYTES` or no text; and as `parse_yaml`.
    """
    try:
        text = _bounded(path).decode("utf-8")
    except OSError as error:
        raise YamlError(f"cannot read {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise YamlError(f"{path} is not a text file") from None
    return parse_yaml(text, str(path))


def parse_yaml(text: str, name: str) -> Any:
    """The content of a text in YAML; `name` names the file in messages.

    Raises:
        YamlError: if the text is not YAML, gives a key twice, has an alias, a merge key or a tag,
            has more than `MOST_NODES` nodes, or is nested too deeply.
    """
    try:
        return yaml.load(text, _StrictLoader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        line = f":{mark.line + 1}" if mark is not None else ""
        reason = f"{line}: {error.problem or error.context}"
    except RecursionError:
        reason = ": it is nested too deeply"
    except (yaml.YAMLError, ValueError) as error:
        reason = f": {' '.join(str(error).split())}"
    raise YamlError(f"{name}{reason[:_LONGEST]}")


def _bounded(path: Path) -> bytes:
    mode = path.stat().st_mode
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "it is no regular file")
    with path.open("rb") as file:
        content = file.read(MOST_BYTES + 1)
    if len(content) > MOST_BYTES:
        raise OSError(errno.EFBIG, f"it is larger than {MOST_BYTES / 2**20:g} MiB")
    return content
