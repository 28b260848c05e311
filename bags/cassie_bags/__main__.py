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
        "robot": ("cli.robot", "start the nodes of a robot, and end all by one Ctrl-C"),
        "experiment": ("cli.experiment", "run experiment files, and evaluate them"),
    },
    "Record and replay": {
        "record": ("cli.record", "record topics into a bag"),
        "replay": ("cli.replay", "publish a bag's messages, or verify them to the last bit"),
        "recover": ("cli.recover", "make an indexed bag of a damaged one"),
    },
    "Look at bags": {
        "info": ("cli.info", "summary of a bag"),
        "report": ("cli.report", "a page about recorded runs"),
        "plot": ("cli.plot", "draw fields over time"),
        "compare": ("cli.compare", "where two bags differ"),
        "export": ("cli.export", "topics as CSV, Parquet or npz"),
    },
    "Measure": {
        "sweep": ("cli.sweep", "what the robot can do, row by row"),
        "faults": ("cli.faults", "let sensors fail, and measure the reaction"),
        "failsafes": ("cli.failsafes", "test every fail-safe"),
        "fingerprint": ("cli.fingerprint", "whether every trajectory is unchanged"),
        "estimators": ("cli.estimators", "errors of both estimators"),
        "return_map": ("cli.return_map", "the step-to-step map, by gentle pushes"),
    },
    "Tune": {
        "tune": ("cli.tune", "search for parameters by CMA-ES"),
        "learn_torques": ("cli.learn_torques", "learn torques over steps"),
    },
}
"""Commands by group, with module and purpose. Each is an executable of the package, too."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command that is named first."""
    words = list(sys.argv[1:] if argv is None else argv)
    known = {name: module for group in COMMANDS.values() for name, (module, _) in group.items()}
    if not words or words[0].startswith("-"):
        _parser().parse_args(words or ["--help"])
        return OK
    if words[0] not in known:
        near = difflib.get_close_matches(words[0], known, 1)
        hint = f": did you mean {near[0]}?" if near else f", expected one of {', '.join(known)}"
        print(f"cassie_bags: error: there is no command {words[0]}{hint}", file=sys.stderr)
        return WRONG_INPUT
    sys.argv = words  # where commands and nodes read their arguments
    code: int | None = import_module(f"cassie_bags.{known[words[0]]}").main()
    return code or OK


def _parser() -> argparse.ArgumentParser:
    lines = [
        line
        for title, group in COMMANDS.items()
        for line in (f"\n{title}:", *(f"  {name:<14}{text}" for name, (_, text) in group.items()))
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
