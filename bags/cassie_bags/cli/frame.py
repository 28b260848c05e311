"""What every command has in common: exit codes, errors in one line, Ctrl-C.

A command's file holds its options alone and imports what computes when it runs, so that `--help`
and a wrong option are answered at once.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from cassie_bags.errors import BagError, RunError

OK, NOT_AS_EXPECTED, WRONG_INPUT, NO_RUN, STOPPED = 0, 1, 2, 3, 130
"""Exit codes."""


def exit_codes(ok: str, not_as_expected: str = "", *, runs: bool = True) -> str:
    """What the exit codes of a command mean, for the end of its help.

    Args:
        ok: What the first means.
        not_as_expected: What the second means, if there is one.
        runs: Whether it makes runs, which may come to no end.
    """
    words = [f"{OK} {ok}"]
    if not_as_expected:
        words.append(f"{NOT_AS_EXPECTED} {not_as_expected}")
    words += [
        f"{WRONG_INPUT} wrong file or arguments",
        *([f"{NO_RUN} a run did not come to its end"] if runs else []),
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
        code = run(arguments)
        if sys.stdout is not None:  # it is closed
            sys.stdout.flush()
        return code
    except KeyboardInterrupt:
        print(f"{parser.prog}: stopped", file=sys.stderr)
        return STOPPED
    except BrokenPipeError:  # the reader of our output has gone, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return OK
    except RunError as error:
        print(f"{parser.prog}: error: {error}", file=sys.stderr)
        return NO_RUN
    except (ValueError, OSError) as error:
        print(f"{parser.prog}: error: {' '.join(str(error).split())}", file=sys.stderr)
        return WRONG_INPUT


def bag_argument(word: str) -> Path:
    """A bag from a command line, looked for before anything heavy is loaded.

    Raises:
        argparse.ArgumentTypeError: if there is none; the message says what is there instead.
    """
    from cassie_bags.bag.location import bag_files

    try:
        bag_files(word)
    except BagError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return Path(word)


def picture(word: str) -> Path:
    """A picture's file name from a command line.

    Raises:
        argparse.ArgumentTypeError: if it has no ending of a picture.
    """
    if Path(word).suffix not in (".png", ".svg", ".pdf"):
        raise argparse.ArgumentTypeError(f"{word} does not end in .png, .svg or .pdf")
    return Path(word)


def new_file(path: Path) -> Path:
    """A path for output that does not exist yet, in a folder that does.

    Raises:
        BagError: if it exists, or its folder does not.
    """
    if path.exists():
        raise BagError(f"{path} exists: give another file with -o, or remove it")
    if not path.parent.is_dir():
        raise BagError(f"{path}: there is no folder {path.parent}")
    return path


def stem(bag: Path) -> str:
    """Name of a bag without its ending, for names of what is made of it."""
    if bag.name == "bag.mcap":  # as every experiment's folder has one
        return bag.resolve().parent.name
    return bag.stem if bag.suffix == ".mcap" else bag.resolve().name
