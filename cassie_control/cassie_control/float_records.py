"""Messages as compiled functions read them: the numbers of one as a C structure."""

from __future__ import annotations

from typing import Any

import numpy as np

from cassie_msgs.layout import Sample


def floats_type(kind: type[Sample]) -> np.dtype[Any]:
    """`Sample.floats` of a message as a structure with the message's names."""
    fields = [(name, float, n) for name, of, n in kind.LAYOUT if of is np.float64]
    return np.dtype([(name, of, n) if n > 1 else (name, of) for name, of, n in fields])
