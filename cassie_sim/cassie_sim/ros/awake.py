"""Processors that stay awake while a loop is in a hurry: in real time, or as fast as it goes.

A processor with nothing to do goes to sleep. In a loop over several processes each one does so
several times a tick, while the others compute, and waking up takes its time: tens of
microseconds, many more in a virtual machine, and what follows runs with cold caches. Linux lets
a process ask for no such delay for as long as it holds a file open; processors without work then
wait in a loop of the kernel. It takes permission to write that file.

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
        device: Where the kernel takes such requests.

    Attributes:
        refused: Why the last request could not be made; empty when it could.
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
        """Make the request, or take it back; cheap while that stays as it is."""
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
