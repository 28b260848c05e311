"""Definitions of ROS messages as text, found without ROS's own tools.

A bag carries the definition of each of its types, with all types that it contains, so that a
reader needs no workspace. The text comes from the installed `.msg` files.

Source:
    The schema encoding "ros2msg" of the MCAP well-known encodings. First comes the `.msg` file.
    For each type that it contains follow a line of 80 `=`, a line `MSG: package/Name`, its file.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import cassie_msgs
from cassie_bags.errors import BagError

SEPARATOR = "=" * 80

_FIELD = re.compile(r"^\s*(?P<type>[A-Za-z][\w/]*)\s*(?:<=\d+)?(?:\[[^\]]*\])?\s+[a-z]\w*")
_PRIMITIVES = frozenset(
    ["bool", "byte", "char", "float32", "float64", "string", "wstring"]
    + [f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)]
)


def definition(type_name: str) -> str:
    """Definition of a message type, such as `nav_msgs/msg/Odometry`, and of all types in it.

    Raises:
        BagError: if a `.msg` file is not installed; the message names the file and the searched
            folders.
    """
    text = message_file(type_name).read_text(encoding="utf-8")
    parts = [text.rstrip("\n") + "\n"]
    for name in _all_dependencies(type_name):
        package, _, short = name.split("/")
        body = message_file(name).read_text(encoding="utf-8").rstrip("\n")
        parts.append(f"{SEPARATOR}\nMSG: {package}/{short}\n{body}\n")
    return "".join(parts)


@cache
def message_file(type_name: str) -> Path:
    """The `.msg` file of a type, through the ament index.

    Raises:
        BagError: if it is not found, or `type_name` is not of the form package/msg/Name.
    """
    parts = type_name.split("/")
    if len(parts) != 3 or parts[1] != "msg":
        raise BagError(f"message type {type_name} is not of the form package/msg/Name")
    package, _, name = parts
    looked_at = []
    for folder in _share_folders(package):
        path = folder / "msg" / f"{name}.msg"
        looked_at.append(str(folder))
        if path.is_file():
            return path
    raise BagError(
        f"definition of {type_name} is not installed (looked in {', '.join(looked_at)}): "
        "source env.sh or the workspace's setup file"
    )


def dependencies(text: str, package: str) -> list[str]:
    """Types of other messages that the text of a package's `.msg` file names, in this order."""
    types = []
    for line in text.splitlines():
        match = _FIELD.match(line.split("#", 1)[0])
        if match is None or match["type"] in _PRIMITIVES:
            continue
        *owner, name = match["type"].split("/")
        full = f"{owner[0] if owner else package}/msg/{name}"
        if full not in types:
            types.append(full)
    return types


def _all_dependencies(type_name: str) -> list[str]:
    types: list[str] = []
    waiting = [type_name]
    while waiting:
        current = waiting.pop(0)
        text = message_file(current).read_text(encoding="utf-8")
        for name in dependencies(text, current.split("/")[0]):
            if name not in types and name != type_name:
                types.append(name)
                waiting.append(name)
    return types


def _share_folders(package: str) -> Iterator[Path]:
    """Folders that may hold a package's files: ament's prefixes, this interpreter, our sources."""
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if prefix:
            yield Path(prefix) / "share" / package
    yield Path(sys.prefix) / "share" / package
    if package == "cassie_msgs":
        for folder in cassie_msgs.__path__:
            yield Path(folder).parent.parent  # python/cassie_msgs of a source tree
