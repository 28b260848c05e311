"""Command `robot`: options of the simulated robot and its nodes."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from cassie_bags.cli.arguments import one_of
from cassie_bags.cli.frame import CommandParser


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of `ros2 run cassie_bags robot`."""
    arguments = _parser().parse_args(argv)
    arguments.scene = arguments.scene or "flat"
    from cassie_bags.ros.robot import run_robot  # loading ROS takes half a second

    return run_robot(arguments)


def _scene(word: str) -> str:
    from cassie_sim.scenes import SCENES  # loading MuJoCo takes half a second

    return str(one_of(SCENES, "scene")(word))


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(
        prog="robot",
        description="Start simulator, state_estimator, gait_controller and mode_supervisor, say "
        "when the robot can be driven, and end them all on Ctrl-C, or when one of them ends. "
        "Their output goes into files.",
        epilog="Each node's --help lists its topics and parameters, such as `ros2 run cassie_sim "
        "simulator --help`. Exit codes: 0 ended by Ctrl-C, 1 a node ended by itself, 2 wrong "
        "arguments.",
    )
    parser.add_argument(
        "--scene",
        type=_scene,
        metavar="NAME",
        help="scene of the simulator, such as grass, slope or segway (default flat)",
    )
    parser.add_argument("--view", action="store_true", help="show the simulator's window")
    parser.add_argument("--console", action="store_true", help="start the browser page web_console")
    parser.add_argument(
        "--pad",
        metavar="NAME",
        help="start joystick and rc_teleop for a pad of this computer, by its device file: xbox, "
        "ps4, ps5, gamepad, taranis_qx7 or a path",
    )
    parser.add_argument(
        "--realtime",
        action="store_true",
        help="pace by the wall clock, as on a robot; otherwise robot time waits for every node",
    )
    parser.add_argument(
        "--stack", action="store_true", help="run estimator and controller in one process, faster"
    )
    parser.add_argument(
        "-p",
        dest="parameter",
        action="append",
        default=[],
        metavar="NODE:NAME:=VALUE",
        help="parameter of a node, such as simulator:max_rate:=1.0",
    )
    parser.add_argument(
        "--logs", type=Path, metavar="FOLDER", help="folder for the nodes' output (~/.ros/log/...)"
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
