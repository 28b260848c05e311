"""What the nodes said of themselves in a bag."""

from __future__ import annotations

from pathlib import Path

from rosbags.highlevel import AnyReader, AnyReaderError

from cassie_bags.errors import BagError

_OK = 0


def problems(path: Path) -> list[str]:
    """Conditions on /diagnostics that were not in order, each once, in the order they came.

    Args:
        path: The bag.

    Returns:
        "node: subject: message" of each.

    Raises:
        BagError: if the file cannot be read.
    """
    found: dict[str, None] = {}
    try:
        with AnyReader([path]) as reader:
            connections = [c for c in reader.connections if c.topic == "/diagnostics"]
            for connection, _, raw in reader.messages(connections):
                for status in reader.deserialize(raw, connection.msgtype).status:
                    level = status.level if isinstance(status.level, int) else status.level[0]
                    if level != _OK:
                        found[f"{status.name}: {status.message}"] = None
    except (AnyReaderError, OSError) as error:
        raise BagError(f"cannot read bag {path}: {error}") from None
    return list(found)


def lockstep_broken(found: list[str]) -> bool:
    """Whether lock-step was given up in the run, from what `problems` found."""
    return any("lockstep_broken" in line for line in found)
