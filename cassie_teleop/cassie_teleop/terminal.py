"""A terminal that is read key by key and restored at the end."""

from __future__ import annotations

import contextlib
import os
import re
import select
import shutil
import sys
import termios
import tty
from collections.abc import Sequence
from typing import TextIO

_KEY = re.compile(r"\x1b(?:[\[O][0-9;]*[A-Za-z~]|.)?|[^\x1b]", re.DOTALL)
_ARROWS = {"A": "up", "B": "down", "C": "right", "D": "left"}
_ESCAPE = "\x1b"


class Terminal:
    """Keys without Enter, and status lines that are redrawn in place.

    Raises:
        OSError: at construction, if the input is no terminal.
    """

    def __init__(self, source: TextIO | None = None, sink: TextIO | None = None) -> None:
        """Switch the mode of the terminal; call `close` at the end."""
        self._source, self._sink = source or sys.stdin, sink or sys.stdout
        self._fd = self._source.fileno()
        if not os.isatty(self._fd):
            raise OSError("the input is no terminal: run this in one, not from a pipe")
        self._before = termios.tcgetattr(self._fd)
        self._lines: Sequence[str] = ()
        tty.setcbreak(self._fd)

    def keys(self, timeout: float) -> list[str]:
        """Keys pressed by now, keys without a character by name; waits at most `timeout` s.

        Raises:
            EOFError: if the terminal is gone.
        """
        with contextlib.suppress(termios.error):
            if termios.tcgetattr(self._fd)[3] & termios.ICANON:
                # After Ctrl-Z and fg a shell leaves its own mode. Keys that wait are kept.
                tty.setcbreak(self._fd, termios.TCSADRAIN)
        ready, _, _ = select.select([self._fd], [], [], timeout)
        if not ready:
            return []
        try:
            raw = os.read(self._fd, 64)
        except OSError:  # Linux raises this for a terminal whose window is closed
            raw = b""
        if not raw:
            raise EOFError("the terminal is gone")
        found = _KEY.findall(raw.decode("utf-8", "ignore"))
        return [_name(key) for key in found]

    def show(self, lines: Sequence[str]) -> None:
        """Draw the status lines if they have changed, as far as they fit into the window."""
        columns, rows = self.size
        fitting = [line[: columns - 1] for line in lines[:rows]]
        if fitting != self._lines:
            self._draw(fitting)

    def say(self, text: str) -> None:
        """Print lines above the status lines."""
        self._draw(self._lines, f"{text}\n")

    def _draw(self, lines: Sequence[str], above: str = "") -> None:
        up = f"\x1b[{len(self._lines) - 1}A" if len(self._lines) > 1 else ""
        self._sink.write(f"\r{up}\x1b[J{above}" + "\n".join(lines))
        self._sink.flush()
        self._lines = lines

    @property
    def size(self) -> os.terminal_size:
        """Number of columns and rows of the window."""
        return shutil.get_terminal_size()

    def close(self) -> None:
        """Restore the terminal, if it still exists."""
        with contextlib.suppress(OSError, termios.error):
            termios.tcsetattr(self._fd, termios.TCSADRAIN, self._before)
            self._sink.write("\n")
            self._sink.flush()


def _name(key: str) -> str:
    """A character unchanged, an arrow as its name; other keys share one name."""
    if not key.startswith(_ESCAPE):
        return key
    if len(key) == 1:
        return "Esc"
    return _ARROWS.get(key[2:], "special key")
