"""Plain text and JSON: aligned columns, and values without NaN."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

WIDTH = 80
"""Width of a terminal. In characters."""


def finite(content: Any) -> Any:
    """Replace NaN and infinity, which JSON lacks, by None (null), also in parts of the content.

    Dataclasses become mappings.
    """
    if isinstance(content, float):
        return content if math.isfinite(content) else None
    if dataclasses.is_dataclass(content):
        content = vars(content)
    if isinstance(content, Mapping):
        return {key: finite(value) for key, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [finite(value) for value in content]
    return content


def aligned(rows: Sequence[Sequence[str]], left: int = 1, heading: int = 1) -> list[str]:
    """Lines of aligned columns with a rule under the heading.

    Args:
        rows: Cells of each row.
        left: Number of columns that are flush left.
        heading: Number of rows above the rule.
    """
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = []
    for row in rows:
        cells = [
            cell.ljust(width) if column < left else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(cells).rstrip())
    lines.insert(heading, "-" * max(map(len, lines)))
    return lines
