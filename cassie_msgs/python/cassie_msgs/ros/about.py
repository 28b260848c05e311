"""Description of a node for `--help`: its topics, services and parameters."""

from __future__ import annotations

import shutil
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from cassie_msgs.tunables import Entry, entries


@dataclass(frozen=True, kw_only=True)
class About:
    """Description of a node.

    Attributes:
        package: Package of the node.
        text: What the node does, in a sentence or two.
        reads: Topics that the node subscribes to.
        writes: Topics that the node publishes.
        services: Services of the node, without those of its parameters.
        parameters: Configuration classes of the node, with their defaults.
    """

    package: str
    text: str
    reads: Sequence[str] = ()
    writes: Sequence[str] = ()
    services: Sequence[str] = ()
    parameters: Sequence[Any] = ()


def help_text(name: str, about: About) -> str:
    """The text that `--help` prints."""
    width = max(60, min(110, shutil.get_terminal_size().columns))
    lines = [
        f"usage: ros2 run {about.package} {name} [--ros-args -p NAME:=VALUE ...]",
        "",
        *textwrap.wrap(" ".join(about.text.split()), width),
    ]
    for title, names in (
        ("reads", about.reads),
        ("writes", about.writes),
        ("services", about.services),
    ):
        if names:
            text = f"{title + ':':10}{', '.join(names)}"
            lines += ["", *textwrap.wrap(text, width, subsequent_indent=" " * 10)]
    found = [entry for config in about.parameters for entry in entries(config)]
    if found:
        lines += ["", "parameters (-p NAME:=VALUE):"]
    for entry in found:
        lines += _parameter(entry, width)
    return "\n".join(lines)


def _parameter(entry: Entry, width: int) -> list[str]:
    spec = entry.spec
    value = f"{entry.value:g}" if isinstance(entry.value, float) else str(entry.value)
    value = str(entry.value).lower() if isinstance(entry.value, bool) else value
    permitted = "true, false" if entry.kind is bool else spec.range_text
    fixed = "" if spec.live else "; fixed while it runs"
    words = f"{spec.description} ({permitted}; default {value or 'empty'}{fixed})"
    text = f"  {entry.name + ' ':26}{words}"
    return textwrap.wrap(text, width, subsequent_indent=" " * 28)
