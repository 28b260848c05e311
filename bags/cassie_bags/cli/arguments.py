"""Parser of the commands: arguments in few words, and those that several commands share."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from cassie_bags.errors import BagError
from cassie_bags.studies.trial import SEEDS
from cassie_msgs.tunables import unknown_name


def whole(least: int) -> Callable[[str], int]:
    """A reader of whole numbers; it refuses a word that is no whole number of `least` or more."""

    def read(word: str) -> int:
        if not word.isdecimal() or int(word) < least:
            raise argparse.ArgumentTypeError(f"{word} is not a whole number of {least} or more")
        return int(word)

    return read


count, positive = whole(0), whole(1)
"""Readers of whole numbers from 0 and from 1."""


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


class _Formatter(argparse.HelpFormatter):
    """Usage as it is typed, while errors have the command's name alone."""

    def add_usage(
        self,
        usage: str | None,
        actions: Iterable[argparse.Action],
        groups: Iterable[argparse._MutuallyExclusiveGroup],
        prefix: str | None = None,
    ) -> None:
        super().add_usage(usage, actions, groups, prefix or "usage: ros2 run cassie_bags ")


class CommandParser(argparse.ArgumentParser):
    """Parser of a command of this package, whose usage is `ros2 run cassie_bags PROG …`.

    In its methods `names` are an option's names, or an argument's; `words` stand in the help.
    """

    def __init__(self, prog: str, description: str, epilog: str) -> None:
        super().__init__(prog, description=description, epilog=epilog, formatter_class=_Formatter)

    def flag(self, names: str, words: str) -> None:
        """Add an option without a value."""
        self.add_argument(*names.split(), action="store_true", help=words)

    def value(
        self,
        names: str,
        metavar: str,
        words: str,
        kind: Callable[[str], Any] = str,
        **more: Any,
    ) -> None:
        """Add an argument, or an option with a value.

        Args:
            names, words: See the class.
            metavar: The value in the help.
            kind: Reads the value, and refuses wrong ones.
            more: As for `argparse.ArgumentParser.add_argument`.
        """
        self.add_argument(*names.split(), metavar=metavar, help=words, type=kind, **more)

    def number(
        self,
        name: str,
        kind: Callable[[str], float],
        default: float,
        words: str,
        metavar: str = "N",
    ) -> None:
        """Add an option with a number, whose help ends with its default."""
        self.value(name, metavar, f"{words} (default {default:g})", kind, default=default)

    def bag(self, name: str, metavar: str = "BAG", nargs: str | None = None) -> None:
        """Add a bag, or several; a wrong one is refused before slow modules are loaded."""
        self.value(name, metavar, "MCAP file, or folder of ros2 bag", _bag, nargs=nargs)

    def jobs(self, *, elsewhere: bool = False) -> None:
        """Add `--jobs`, and where other computers may do the work, `--scheduler`."""
        self.value("--jobs", "N", "processes (default: one for each core)", positive)
        if elsewhere:
            words = "address of a Dask cluster that computes instead of these processes"
            self.value("--scheduler", "ADDRESS", words)

    def seed(self, default: int) -> None:
        """Add `--seed`: the seed of the robot."""
        words = "seed of robot and noise, 0 for the nominal robot"
        self.number("--seed", count, default, words)

    def seeds(self, use: str) -> None:
        """Add `--seeds`: the number of drawn robots; their seeds begin at 1."""
        self.number("--seeds", positive, SEEDS, f"robots {use}, drawn by seeds 1 to N")

    def set(self, words: str) -> None:
        """Add `--set`: values that replace those of the experiments."""
        words = f"{words}; or the values of a file: @FILE"
        self.value("--set", "KEY=VALUE", words, action="append", default=[])

    def out(self, command: str) -> None:
        """Add `--out`: the folder for results."""
        default = Path("build", command)
        self.value(
            "--out", "FOLDER", f"folder to write to (default {default})", Path, default=default
        )

    def output(
        self,
        metavar: str,
        words: str,
        kind: Callable[[str], Path] = Path,
        default: Path | None = None,
    ) -> None:
        """Add `-o`: the file or folder for the output."""
        self.value("-o --output", metavar, words, kind, default=default)

    def results(self, what: str) -> None:
        """Add `--results`: a Markdown file of results that gets the table of some rows."""
        words = f"also write the table into this file of results: {what}"
        self.value("--results", "FILE.md", words, Path)


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
