"""What several commands read from their command lines."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable
from pathlib import Path

from cassie_msgs.tunables import unknown_name


def positive(word: str) -> int:
    """A whole number of 1 or more.

    Raises:
        argparse.ArgumentTypeError: if it is not one.
    """
    value = int(word) if word.isdecimal() else 0
    if value < 1:
        raise argparse.ArgumentTypeError(f"{word} is not a whole number of 1 or more")
    return value


def count(word: str) -> int:
    """A whole number of 0 or more.

    Raises:
        argparse.ArgumentTypeError: if it is not one.
    """
    if not word.isdecimal():
        raise argparse.ArgumentTypeError(f"{word} is not a whole number of 0 or more")
    return int(word)


def seconds(word: str) -> float:
    """The length of a run, 2 .. 600 s.

    Raises:
        argparse.ArgumentTypeError: if it is not one.
    """
    value = number(word)
    if not 2.0 <= value <= 600.0:
        raise argparse.ArgumentTypeError(f"{word} is not 2 .. 600 s")
    return value


def one_of(known: Iterable[str], what: str) -> Callable[[str], str]:
    """One of some words; another one is refused with the nearest of them.

    Args:
        known: The words.
        what: What they name.
    """

    def read(word: str) -> str:
        if word not in known:
            raise argparse.ArgumentTypeError(unknown_name(word, known, what))
        return word

    return read


def number(word: str) -> float:
    """A number; NaN if it is none, so that it is in no range."""
    try:
        return float(word)
    except ValueError:
        return float("nan")


def add_jobs(parser: argparse.ArgumentParser, *, elsewhere: bool = False) -> None:
    """Option `--jobs`: on how many processes it is computed.

    Args:
        parser: Of the command.
        elsewhere: With `--scheduler`, for those that other computers may help.
    """
    parser.add_argument(
        "--jobs", type=positive, metavar="N", help="processes (default: one for each core)"
    )
    if elsewhere:
        parser.add_argument(
            "--scheduler", metavar="ADDRESS", help="of a Dask cluster to compute on, in their place"
        )


def add_seeds(parser: argparse.ArgumentParser, default: int, use: str) -> None:
    """Option `--seeds`: how many drawn robots, from 1 on."""
    words = f"robots {use}, drawn by seeds 1 to N (default {default})"
    parser.add_argument("--seeds", type=positive, default=default, metavar="N", help=words)


def add_out(parser: argparse.ArgumentParser, command: str) -> None:
    """Option `--out`: the folder of results."""
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("build", command),
        metavar="FOLDER",
        help=f"folder to write to (default build/{command})",
    )


def add_results(parser: argparse.ArgumentParser, what: str) -> None:
    """Option `--results`: a Markdown file of results to put a table into.

    Args:
        parser: Of the command.
        what: Which rows it takes, for the help.
    """
    words = f"put the table into this file of results, too: {what}"
    parser.add_argument("--results", type=Path, metavar="FILE.md", help=words)
