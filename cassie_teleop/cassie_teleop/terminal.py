"""A terminal read key by key, put back as it was in the end."""

from __future__ import annotations

import contextlib
import os
import select
import shutil
import sys
import termios
import tty
from typing import TextIO


class Terminal:
    """Keys without Enter, and a status line that is drawn over itself.

    Raises:
        OSError: at construction, if the input is no terminal.
    """

    def __init__(self, source: TextIO | None = None, sink: TextIO | None = None) -> None:
        """Switch the terminal; `close` must follow."""
        self._source, self._sink = source or sys.stdin, sink or sys.stdout
        self._fd = self._source.fileno()
        if not os.isatty(self._fd):
            raise OSError("the input is no terminal: run this in one, not from a pipe")
        self._before = termios.tcgetattr(self._fd)
        self._line = ""
        tty.setcbreak(self._fd)

    def keys(self, timeout: float) -> str:
        """Keys pressed by now; waits for one at most `timeout` s.

        Raises:
            EOFError: if the terminal is gone.
        """
        ready, _, _ = select.select([self._fd], [], [], timeout)
        if not ready:
            return ""
        try:
            raw = os.read(self._fd, 64)
        except OSError:  # what Linux says of a terminal whose window is closed
            raw = b""
        if not raw:
            raise EOFError("the terminal is gone")
        pressed = raw.decode("utf-8", "ignore")
        return "" if pressed.startswith("\x1b") else pressed  # arrows and the like

    def show(self, line: str) -> None:
        """Draw the status line, if it has changed."""
        if line != self._line:
            self._line = line
            self._sink.write(f"\r{line}\x1b[K")
            self._sink.flush()

    def say(self, text: str) -> None:
        """Print lines above the status line."""
        self._sink.write(f"\r\x1b[K{text}\n{self._line}")
        self._sink.flush()

    @property
    def width(self) -> int:
        """Characters in a line."""
        return shutil.get_terminal_size().columns

    def close(self) -> None:
        """Put the terminal back, if there still is one."""
        with contextlib.suppress(OSError, termios.error):
            termios.tcsetattr(self._fd, termios.TCSADRAIN, self._before)
            self._sink.write("\n")
            self._sink.flush()
