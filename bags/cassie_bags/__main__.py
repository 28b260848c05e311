"""All commands of the package under one name: `ros2 run cassie_bags cassie_bags --help`."""

from __future__ import annotations

import argparse
import difflib
import sys
from collections.abc import Sequence
from importlib import import_module

from cassie_bags.cli.frame import OK, WRONG_INPUT

COMMANDS = {
    "Run": {
        "robot": "start the nodes of a robot, and end all by one Ctrl-C",
        "experiment": "run experiment files, and evaluate them",
    },
    "Record and replay": {
        "record": "record topics into a bag",
        "replay": "publish a bag's messages, or verify them to the last bit",
        "recover": "make an indexed bag of a damaged one",
    },
    "Look at bags": {
        "info": "summary of a bag",
        "report": "a page about recorded runs",
        "plot": "draw fields over time",
        "compare": "where two bags differ",
        "export": "topics as CSV, Parquet or npz",
    },
    "Measure": {
        "sweep": "what the robot can do, row by row",
        "faults": "let sensors fail, and measure the reaction",
        "failsafes": "test every fail-safe",
        "fingerprint": "whether every trajectory is unchanged",
        "return_map": "the step-to-step map, by gentle pushes",
    },
    "Tune": {
        "tune": "search for parameters by CMA-ES",
        "learn_torques": "learn torques over steps",
    },
}
"""Purpose of each command, by group. Each is a module of `cli`, and an executable, too."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command that is named first."""
    words = list(sys.argv[1:] if argv is None else argv)
    known = [name for group in COMMANDS.values() for name in group]
    if not words or words[0].startswith("-"):
        _parser().parse_args(words or ["--help"])
        return OK
    if words[0] not in known:
        near = difflib.get_close_matches(words[0], known, 1)
        hint = f": did you mean {near[0]}?" if near else f", expected one of {', '.join(known)}"
        print(f"cassie_bags: error: there is no command {words[0]}{hint}", file=sys.stderr)
        return WRONG_INPUT
    sys.argv = words  # where commands and nodes read their arguments
    code: int | None = import_module(f"cassie_bags.cli.{words[0]}").main()
    return code or OK


def _parser() -> argparse.ArgumentParser:
    lines = [
        line
        for title, group in COMMANDS.items()
        for line in (f"\n{title}:", *(f"  {name:<14}{text}" for name, text in group.items()))
    ]
    return argparse.ArgumentParser(
        prog="cassie_bags",
        usage="cassie_bags COMMAND …",
        description="Experiments with the robot, and bags of them.\n" + "\n".join(lines),
        epilog="`cassie_bags COMMAND --help` says more; each is `ros2 run cassie_bags COMMAND`.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )


if __name__ == "__main__":
    sys.exit(main())
