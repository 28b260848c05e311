"""A person's drive on the wall clock, recorded, gives the same bits again."""

from __future__ import annotations

import math
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from bringup import Eyes, Robot
from test_command_lane import Stranger

from cassie_bags.bag.node_events import IN_FORCE_TOPIC
from cassie_bags.bag.reader import read_messages
from cassie_bags.ros.processes import environment
from cassie_bags.run.verify import verify
from cassie_msgs.layout import OperatorCommand, RobotMode, Sample

CHANGES = {
    "state_estimator": ("filter.stance_noise", "0.05"),
    "gait_controller": ("walk.joints.kp_knee", "500.0"),
    "mode_supervisor": ("yaw_rate_limit", "0.1"),
}
"""A parameter of each node that is changed while the robot walks."""


def driver(eyes: Eyes) -> Callable[[Sample, int], None]:
    """Stand, then walk with speeds that never rest; it begins once the robot is seen to stand.

    Who asks for walking while power comes on is refused, so no clock may decide on it.
    """
    begun: list[int] = []

    def drive(command: Sample, number: int) -> None:
        assert isinstance(command, OperatorCommand)
        if not begun and eyes.mode == "stand":
            begun.append(number)
        since = number - begun[0] if begun else 0
        command.power[...] = command.link[...] = True
        command.height[...] = 0.9 + 0.05 * math.sin(0.01 * number)
        command.mode[...] = int(RobotMode.STAND if since < 200 else RobotMode.WALK)
        if since > 250:
            command.vx[...] = 0.3 * math.sin(0.01 * since)
            command.yaw_rate[...] = 0.2 * math.cos(0.03 * since)

    return drive


@pytest.mark.parametrize("pacing", ["realtime", "lockstep"])
def test_a_drive_by_hand_with_changes_of_parameters_gives_the_same_bits(
    tmp_path: Path, pacing: str
) -> None:
    """Whatever the robot does: on the wall clock a busy machine may throw it down.

    No node waits for the supervisor, so that there it may also miss samples.
    """
    rate = {"realtime": 0.4, "lockstep": 1.0}[pacing]
    simulator = {"pacing": pacing, "max_rate": rate, "paused": True, "scripted_operator": False}
    simulator["start"] = "gantry"
    with Robot(
        tmp_path, simulator=simulator, mode_supervisor={"scripted_operator": False}
    ) as robot:
        eyes = robot.eyes
        bag = robot.record()
        robot.start("state_estimator", "gait_controller", "mode_supervisor", "simulator")
        with Stranger(robot.domain, (OperatorCommand,), driver(eyes)):
            robot.go()
            eyes.wait_for(lambda: eyes.mode == "stand", "standing in the gantry")
            assert robot.call("gantry", action="lower", height=0.8).success
            for node, (name, value) in CHANGES.items():
                words = ["ros2", "param", "set", f"/{node}", name, value]
                subprocess.run(words, env=environment(robot.domain), check=True, timeout=90)
            if pacing == "lockstep":
                eyes.wait_for(lambda: eyes.mode == "walk", "walking")
            end = eyes.tick + 2500
            eyes.wait_for(lambda: eyes.tick >= end, "five seconds of robot time")
        robot.processes.stop("record")
    found = verify(bag)
    assert all(gap.startswith("mode_supervisor: no message for") for gap in found.gaps)
    assert found.differences == []
    states, modes, commands = found.replayed.values()
    assert min(len(states.recorded), len(commands.recorded)) > 2000
    assert len(modes.recorded) > 100
    assert pacing == "realtime" or np.ptp(modes.recorded["vx"]) > 0.1
    told = sum(topic == IN_FORCE_TOPIC for topic, *_ in read_messages(bag))
    assert told >= len(modes.recorded)
