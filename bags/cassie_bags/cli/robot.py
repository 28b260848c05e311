"""Command `robot`: options of the simulated robot and its nodes."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from cassie_bags.cli.arguments import CommandParser, one_of


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of `ros2 run cassie_bags robot`."""
    arguments = _parser().parse_args(argv)
    arguments.scene = arguments.scene or "flat"
    from cassie_bags.ros.robot import run_robot  # loading ROS takes half a second

    return run_robot(arguments)


def _scene(word: str) -> str:
    from cassie_sim.scenes import SCENES  # loading MuJoCo takes half a second

    return str(one_of(SCENES, "scene")(word))


def _parser() -> CommandParser:
    parser = CommandParser(
        prog="robot",
        description="Start simulator, state_estimator, gait_controller and mode_supervisor, say "
        "when the robot can be driven, and end them all on Ctrl-C, or when one of them ends. "
        "Their output goes into files.",
        epilog="Each node's --help lists its topics and parameters, such as `ros2 run cassie_sim "
        "simulator --help`. Exit codes: 0 ended by Ctrl-C, 1 a node ended by itself, 2 wrong "
        "arguments.",
    )
    scene = "scene of the simulator, such as grass, slope or segway (default flat)"
    parser.value("--scene", "NAME", scene, _scene)
    parser.flag("--view", "show the simulator's window")
    parser.flag("--console", "start the browser page web_console")
    parser.value(
        "--pad",
        "NAME",
        "start joystick and rc_teleop for a pad of this computer, by its device file: xbox, "
        "ps4, ps5, gamepad, taranis_qx7 or a path",
    )
    pace = "pace by the wall clock, as on a robot; otherwise robot time waits for every node"
    parser.flag("--realtime", pace)
    parser.flag("--stack", "run estimator and controller in one process, faster")
    parameter = "parameter of a node, such as simulator:max_rate:=1.0"
    parser.value("-p", "NODE:NAME:=VALUE", parameter, dest="parameter", action="append", default=[])
    parser.value("--logs", "FOLDER", "folder for the nodes' output (~/.ros/log/...)", Path)
    return parser


if __name__ == "__main__":
    sys.exit(main())
