"""Problems that the nodes reported in a bag."""

from __future__ import annotations

from pathlib import Path

from cassie_bags.bag.reader import BagIndex, read_messages
from cassie_bags.bag.tables import decode

DIAGNOSTICS = "/diagnostics"
_OK = 0


def problems(path: Path | str) -> list[str]:
    """Conditions on /diagnostics that were not OK, each once, in the order of their appearance.

    Args:
        path: The bag.

    Returns:
        "node: subject: message" of each condition.

    Raises:
        BagError: if the file cannot be read.
    """
    found: dict[str, None] = {}
    index = BagIndex()
    raw = [data for *_, data in read_messages(path, [DIAGNOSTICS], index)]
    kind = index.types.get(DIAGNOSTICS, "")
    for message in decode(kind, index.definitions[kind], raw) if raw else ():
        for status in message.status:
            level = status.level if isinstance(status.level, int) else status.level[0]
            if level != _OK:
                found[f"{status.name}: {status.message}"] = None
    return list(found)


def lockstep_broken(found: list[str]) -> bool:
    """Whether lock-step was given up in the run, according to the result of `problems`."""
    return any("lockstep_broken" in line for line in found)
