"""Common frame of the gait tools: words of ROS, errors in one line, an early end."""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Callable, Sequence
from typing import Protocol

from cassie_gaits.errors import CassieError
from cassie_msgs.processes import run_command

WRONG_INPUT = 2
NO_READER = 128 + signal.SIGPIPE
"""Exit status of a program whose output nobody reads any more, as shells have it."""


class Main(Protocol):
    """Entry point of a tool."""

    def __call__(self, arguments: Sequence[str] | None = None) -> int:
        """Run the tool; returns the exit status.

        Args:
            arguments: Words after the tool's name; those of this process if None.
        """
        ...


def tool(
    name: str,
    parser: Callable[[], argparse.ArgumentParser],
    run: Callable[[argparse.Namespace], int],
    stopped: str = "stopped",
) -> Main:
    """Entry point of a tool. SIGTERM ends the tool as Ctrl-C does.

    Args:
        name: Name of the tool, for messages.
        parser: Makes the parser of the tool.
        run: Gets the options, returns the exit status.
        stopped: Message after Ctrl-C.
    """

    def main(arguments: Sequence[str] | None = None) -> int:
        given = list(sys.argv[1:] if arguments is None else arguments)
        if "--ros-args" in given:
            given = given[: given.index("--ros-args")]
        options = parser().parse_args(given)
        try:
            return run_command(name, lambda: run(options), stopped=stopped, no_reader=NO_READER)
        except (CassieError, OSError) as error:
            print(f"{name}: error: {error}", file=sys.stderr)
            return WRONG_INPUT

    return main
