"""Arguments that several commands share."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterable
from pathlib import Path

from cassie_bags.errors import BagError
from cassie_bags.studies.trial import SEEDS
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


def in_range(low: float, high: float, expected: str) -> Callable[[str], float]:
    """A reader of numbers; it refuses a word that is no number from `low` to `high`.

    Args:
        low, high: Smallest and largest number.
        expected: The range in words.
    """

    def read(word: str) -> float:
        try:
            value = float(word)
        except ValueError:
            value = math.nan  # in no range
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{word} is not {expected}")
        return value

    return read


seconds = in_range(2.0, 600.0, "2 .. 600 s")
"""Reader of the length of a run."""


def one_of(known: Iterable[str], what: str) -> Callable[[str], str]:
    """A reader of one of several words; it refuses other words and names the nearest known one.

    Args:
        known: The known words.
        what: Kind of thing that the words name.
    """

    def read(word: str) -> str:
        if word not in known:
            raise argparse.ArgumentTypeError(unknown_name(word, known, what))
        return word

    return read


def add_jobs(parser: argparse.ArgumentParser, *, elsewhere: bool = False) -> None:
    """Option `--jobs`: the number of processes.

    Args:
        parser: Parser of the command.
        elsewhere: Whether to add `--scheduler`, for work that other computers may do.
    """
    parser.add_argument(
        "--jobs", type=positive, metavar="N", help="processes (default: one for each core)"
    )
    if elsewhere:
        parser.add_argument(
            "--scheduler",
            metavar="ADDRESS",
            help="address of a Dask cluster that computes instead of these processes",
        )


def add_number(
    parser: argparse.ArgumentParser,
    option: str,
    kind: Callable[[str], float],
    default: float,
    words: str,
    metavar: str = "N",
) -> None:
    """An option with a number, whose help ends with its default.

    Args:
        parser: Parser of the command.
        option: Name of the option.
        kind: Reads the word, and refuses wrong ones.
        default: Number without this option.
        words: Meaning of the number, for the help.
        metavar: The number in the help.
    """
    words = f"{words} (default {default:g})"
    parser.add_argument(option, type=kind, default=default, metavar=metavar, help=words)


def add_seed(parser: argparse.ArgumentParser, default: int) -> None:
    """Option `--seed`: the seed of the robot."""
    add_number(parser, "--seed", count, default, "seed of robot and noise, 0 for the nominal robot")


def add_set(parser: argparse.ArgumentParser, words: str) -> None:
    """Option `--set`: values that replace those of the experiments.

    Args:
        parser: Parser of the command.
        words: Use of the values, for the help.
    """
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help=f"{words}; or the values of a file: @FILE",
    )


def add_seeds(parser: argparse.ArgumentParser, use: str) -> None:
    """Option `--seeds`: the number of drawn robots; their seeds begin at 1."""
    add_number(parser, "--seeds", positive, SEEDS, f"robots {use}, drawn by seeds 1 to N")


def add_out(parser: argparse.ArgumentParser, command: str) -> None:
    """Option `--out`: the folder for results."""
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("build", command),
        metavar="FOLDER",
        help=f"folder to write to (default build/{command})",
    )


def add_output(
    parser: argparse.ArgumentParser,
    metavar: str,
    words: str,
    kind: Callable[[str], Path] = Path,
    default: Path | None = None,
) -> None:
    """Option `-o`: the file or folder for the output.

    Args:
        parser: Parser of the command.
        metavar: What the output is, for the help.
        words: Use of the output, for the help.
        kind: Reads the word, and refuses wrong ones.
        default: Output without this option.
    """
    parser.add_argument("-o", "--output", type=kind, default=default, metavar=metavar, help=words)


def add_results(parser: argparse.ArgumentParser, what: str) -> None:
    """Option `--results`: a Markdown file of results that gets the table.

    Args:
        parser: Parser of the command.
        what: Rows that the file gets, for the help.
    """
    words = f"also write the table into this file of results: {what}"
    parser.add_argument("--results", type=Path, metavar="FILE.md", help=words)


def add_bag(
    parser: argparse.ArgumentParser, name: str, metavar: str = "BAG", nargs: str | None = None
) -> None:
    """Add a bag, or several, to the arguments of a command."""
    words = "MCAP file, or folder of ros2 bag"
    parser.add_argument(name, nargs=nargs, metavar=metavar, type=_bag, help=words)


def _bag(word: str) -> Path:
    """A bag from a command line, checked before slow modules are loaded.

    Raises:
        argparse.ArgumentTypeError: if there is none; the message names what was found instead.
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
        argparse.ArgumentTypeError: if the name does not end like a picture's.
    """
    if Path(word).suffix not in (".png", ".svg", ".pdf"):
        raise argparse.ArgumentTypeError(f"{word} does not end in .png, .svg or .pdf")
    return Path(word)
