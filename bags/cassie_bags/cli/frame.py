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
