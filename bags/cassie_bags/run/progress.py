"""The progress bar of every command."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from tqdm import tqdm


def progress_bar(unit: str, total: float | None = None, items: Iterable[Any] | None = None) -> tqdm:
    """A bar on stderr that vanishes at its end; nothing is shown if stderr is no terminal.

    Args:
        unit: Unit of the progress.
        total: Progress at the end; None if it is not known, or follows from the items.
        items: Items that the bar passes on, and counts.
    """
    return tqdm(items, total=total, unit=unit, disable=None, leave=False)
