"""What every command has in common: exit codes, errors in one line, Ctrl-C.

A command's file holds its options alone and imports what computes when it runs, so that `--help`
and a wrong option are answered at once.
"""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Callable, Sequence

from cassie_bags.errors import RunError

OK, NOT_AS_EXPECTED, WRONG_INPUT, NO_RUN, STOPPED = 0, 1, 2, 3, 130
"""Exit codes."""


def exit_codes(ok: str, not_as_expected: str = "") -> str:
    """What the exit codes of a command mean, for the end of its help."""
    words = [f"{OK} {ok}"]
    if not_as_expected:
        words.append(f"{NOT_AS_EXPECTED} {not_as_expected}")
    words += [
        f"{WRONG_INPUT} wrong file or arguments",
        f"{NO_RUN} a run did not come to its end",
        f"{STOPPED} stopped",
    ]
    return f"Exit codes: {', '.join(words)}."


def play(
    parser: argparse.ArgumentParser,
    run: Callable[[argparse.Namespace], int],
    argv: Sequence[str] | None,
) -> int:
    """Read a command line and run it; returns the exit code.

    Args:
        parser: Of the command.
        run: Gets the arguments, returns the exit code.
        argv: Words after the command's name; those of this process if None.
    """
    arguments = parser.parse_args(argv)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        return run(arguments)
    except KeyboardInterrupt:
        print(f"{parser.prog}: stopped", file=sys.stderr)
        return STOPPED
    except RunError as error:
        print(f"{parser.prog}: error: {error}", file=sys.stderr)
        return NO_RUN
    except (ValueError, OSError) as error:
        print(f"{parser.prog}: error: {' '.join(str(error).split())}", file=sys.stderr)
        return WRONG_INPUT
