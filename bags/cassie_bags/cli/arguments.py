"""What several commands read from their command lines."""

from __future__ import annotations

import argparse


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


def number(word: str) -> float:
    """A number; NaN if it is none, so that it is in no range."""
    try:
        return float(word)
    except ValueError:
        return float("nan")
