"""Keeps processors awake while the loop runs in real time, or as fast as it can.

An idle processor goes to sleep. In a loop over several processes each processor does so several
times per tick, while others compute. To wake up takes tens of microseconds, many more in a virtual
machine, and the code after it runs with cold caches. A Linux process can request no such delay as
long as it holds a file open; idle processors then wait in a loop of the kernel. This needs
permission to write that file.

Source:
    Linux, Documentation/power/pm_qos_interface.rst: `/dev/cpu_dma_latency`.
"""

from __future__ import annotations

import os
import struct
from pathlib import Path

DEVICE = Path("/dev/cpu_dma_latency")

_NO_DELAY = struct.pack("=i", 0)  # longest delay when waking up, in us


class Awake:
    """A request to keep the processors awake, which ends with the process at the latest.

    Args:
        device: File to which such requests are written.

    Attributes:
        refused: Why the last request failed; empty if it did not.
    """

    def __init__(self, device: Path = DEVICE) -> None:
        self._device = device
        self._file: int | None = None
        self.refused = ""

    @property
    def held(self) -> bool:
        """Whether the processors are kept awake."""
        return self._file is not None

    def hold(self, wanted: bool) -> None:
        """Make the request, or withdraw it; cheap while `wanted` does not change."""
        if wanted == self.held:
            return
        if self._file is not None:
            os.close(self._file)
            self._file = None
            return
        try:
            self._file = os.open(self._device, os.O_WRONLY | os.O_CLOEXEC)
            os.write(self._file, _NO_DELAY)
        except OSError as error:
            self.refused = error.strerror or str(error)
            self.hold(False)
        else:
            self.refused = ""
