"""What the commands that look at bags share: exit codes, and errors in one line."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from pathlib import Path

from cassie_bags.errors import BagError

SAME, DIFFERENT, WRONG_INPUT, STOPPED = 0, 1, 2, 130
"""Exit codes, as of `experiment`: 0 all as expected, 1 not, 2 wrong input, 130 after Ctrl-C."""


def answer(name: str, work: Callable[[], int]) -> int:
    """Do the work of a command; an error becomes one line on stderr and an exit code.

    Args:
        name: Of the command.
        work: Gives the exit code.
    """
    try:
        code = work()
        sys.stdout.flush()
        return code
    except KeyboardInterrupt:
        print(f"{name}: stopped", file=sys.stderr)
        return STOPPED
    except BrokenPipeError:  # the reader of our output has gone, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return SAME
    except (ValueError, OSError) as error:
        print(f"{name}: error: {' '.join(str(error).split())}", file=sys.stderr)
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


def new_file(path: Path) -> Path:
    """A path for output that does not exist yet; its folder is made.

    Raises:
        BagError: if it exists.
    """
    if path.exists():
        raise BagError(f"{path} exists: give another file with -o, or remove it")
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


def stem(bag: Path) -> str:
    """Name of a bag without its ending, for names of what is made of it."""
    return bag.stem if bag.suffix == ".mcap" else bag.resolve().name
