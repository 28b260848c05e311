"""Common parts of the commands: exit codes, errors in one line, Ctrl-C.

A command's file has only its options, and imports the slow modules when it runs. So `--help` and a
wrong option are answered at once.
"""

from __future__ import annotations

import argparse
import datetime
import os
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path

from cassie_bags.errors import BagError, RunError
from cassie_msgs.processes import STOPPED, run_command

OK, NOT_AS_EXPECTED, WRONG_INPUT, NO_RUN = 0, 1, 2, 3
"""Exit codes."""


def exit_codes(ok: str, not_as_expected: str = "", *, runs: bool = True, node: bool = False) -> str:
    """Meaning of a command's exit codes, for the end of its help.

    Args:
        ok: Meaning of the first exit code.
        not_as_expected: Meaning of the second exit code, if there is one.
        runs: Whether the command makes runs, which may fail to end.
        node: Whether the command is a node, which Ctrl-C ends as it should.
    """
    words = [f"{OK} {ok}"]
    if not_as_expected:
        words.append(f"{NOT_AS_EXPECTED} {not_as_expected}")
    words += [
        f"{WRONG_INPUT} wrong file or arguments",
        *([f"{NO_RUN} a run did not come to its end"] if runs else []),
        *([] if node else [f"{STOPPED} stopped"]),
    ]
    return f"Exit codes: {', '.join(words)}."


def study(module: str) -> Callable[[argparse.Namespace], int]:
    """The function `run` of a module of `studies`, which is imported when it runs, as that is slow.

    It gets the arguments, with the time of the wall clock as `now`.
    """

    def run(arguments: argparse.Namespace) -> int:
        arguments.now = datetime.datetime.now(datetime.timezone.utc)
        return int(import_module(f"cassie_bags.studies.{module}").run(arguments))

    return run


def command(
    parser: Callable[[], argparse.ArgumentParser], run: Callable[[argparse.Namespace], int]
) -> Callable[..., int]:
    """Entry point of a command, as setup.py names it. SIGTERM ends the command as Ctrl-C does.

    Args:
        parser: Makes the parser of the command.
        run: Gets the arguments, returns the exit code.

    Returns:
        A function of the words after the command's name, by default those of this process, that
        returns the exit code.
    """

    def main(argv: Sequence[str] | None = None) -> int:
        options = parser()
        arguments = options.parse_args(argv)
        try:
            return run_command(
                options.prog, lambda: run(arguments), stopped="stopped", no_reader=OK
            )
        except RunError as error:
            print(f"{options.prog}: error: {error}", file=sys.stderr)
            return NO_RUN
        except (ValueError, OSError) as error:
            print(f"{options.prog}: error: {' '.join(str(error).split())}", file=sys.stderr)
            return WRONG_INPUT

    return main


def node_words(name: str) -> list[str]:
    """Words of a node's command line, without those of ROS; ROS is loaded for these alone."""
    if "--ros-args" not in sys.argv:
        return sys.argv[1:]
    from cassie_bags.ros.processes import words_without_ros

    return words_without_ros(name)


def new_file(path: Path, option: str = "-o") -> Path:
    """A path for output, which must not exist, in a folder that exists.

    Raises:
        BagError: if the path exists, or its folder does not; the message names the option that
            gives another path.
    """
    if os.path.lexists(path):  # also a link to nothing
        raise BagError(f"{path} exists: give another file with {option}, or remove it")
    if not path.parent.is_dir():
        raise BagError(f"{path}: there is no folder {path.parent}")
    return path


def stem(bag: Path) -> str:
    """Name of a bag without its ending, for the names of files made from the bag."""
    if bag.name == "bag.mcap":  # every experiment's folder has a file of this name
        return bag.resolve().parent.name
    return bag.stem if bag.suffix == ".mcap" else bag.resolve().name


def labels(bags: Sequence[Path]) -> list[str]:
    """A name for each bag: its stem, or as much of its path as tells it apart from the others."""
    names = [stem(bag) for bag in bags]
    parts = [bag.absolute().with_suffix("").parts for bag in bags]
    deepest = max(map(len, parts), default=1)
    for depth in range(2, deepest + 1):
        if len(set(names)) == len(set(parts)):
            break
        names = [
            "/".join(part[-depth:]) if names.count(name) > 1 else name
            for name, part in zip(names, parts, strict=True)
        ]
    return names
