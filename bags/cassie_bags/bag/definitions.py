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
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

import cassie_msgs
from cassie_bags.errors import BagError

SEPARATOR = "=" * 80

_FIELD = re.compile(r"^\s*(?P<type>[A-Za-z][\w/]*)\s*(?:<=\d+)?(?:\[[^\]]*\])?\s+[a-z]\w*")
_PRIMITIVES = frozenset(
    ["bool", "byte", "char", "float32", "float64", "string", "wstring"]
    + [f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)]
)
_OCTETS = {"byte": "uint8", "char": "uint8"}
_RULE = re.compile(r"^={80}\s*$", re.MULTILINE)
_MEMBER = re.compile(
    r"(?P<type>[A-Za-z][\w/]*)(?:<=\d+)?(?P<array>\[[^\]]*\])?\s+(?P<name>\w+)\s*(?P<constant>=)?"
)
_DEEPEST = 32  # messages within each other; more are messages that contain themselves


class Member(NamedTuple):
    """One field of a message type.

    Attributes:
        type: A primitive type, or another message type as package/Name.
        array: Brackets of an array, as `[3]` or `[]`; empty for a single value.
        name: Name of the field.
    """

    type: str
    array: str
    name: str


Members = Mapping[str, tuple[Member, ...]]
"""Fields of message types by package/Name."""


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


def parse_definition(type_name: str, text: str) -> Members:
    """Fields of a message type and of all types in it, without comments, blanks and constants.

    Two texts with the same fields define the same messages.

    Args:
        type_name: Message type, package/msg/Name or package/Name.
        text: Its definition, as from `definition`.

    Raises:
        BagError: if a line of the text is no field; the message has the line.
    """
    first, *others = _RULE.split(text)
    parts = [(type_name, first)]
    for other in others:
        head, _, body = other.lstrip().partition("\n")
        parts.append((head.removeprefix("MSG:").strip(), body))
    return {_short(name): tuple(_members(_short(name), body)) for name, body in parts}


def _members(type_name: str, text: str) -> Iterator[Member]:
    for line in text.splitlines():
        words = line.split("#", 1)[0].strip()
        match = _MEMBER.match(words)
        if words and match is None:
            raise BagError(f"the definition of {type_name} has the line {words[:80]!r}")
        if match is None or match["constant"]:
            continue
        kind = _OCTETS.get(match["type"], match["type"])
        if kind == "Header":
            kind = "std_msgs/Header"
        elif kind not in _PRIMITIVES:
            kind = _short(kind) if "/" in kind else f"{type_name.partition('/')[0]}/{kind}"
        yield Member(kind, match["array"] or "", match["name"])


def _short(type_name: str) -> str:
    """A message type as package/Name."""
    return type_name.replace("/msg/", "/")


def primitives(members: Members, type_name: str, path: str = "") -> Iterator[str]:
    """Every field of a primitive type in order, such as `float64[36] pose.covariance`.

    Args:
        members: Fields of `type_name` and of all types in it.
        type_name: Message type, package/msg/Name or package/Name.
        path: What comes before the names of the fields.
    """
    own = members.get(_short(type_name), ())
    if not own or path.count(".") > _DEEPEST:
        yield f"{type_name} {path}"  # of no field that is known
    for kind, array, name in own if path.count(".") <= _DEEPEST else ():
        if kind in _PRIMITIVES:
            yield f"{kind}{array} {path}{name}"
        else:
            yield from primitives(members, kind, f"{path}{name}{array}.")


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
