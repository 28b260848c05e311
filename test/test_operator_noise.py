"""Random input on every way in for operators at once, beside one who drives: only that one counts.

`CASSIE_RANDOM_INPUT=600` makes it last ten minutes instead of seconds.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import rclpy
from bringup import Robot
from geometry_msgs.msg import Twist, TwistStamped, Vector3
from noisy_pages import CLIENTS
from rclpy.context import Context
from rclpy.node import Node
from sensor_msgs.msg import Joy
from test_command_lane import Person, walking
from test_random_input import BACK_WITHIN, memory

from cassie_bags.ros.processes import executable

SECONDS = float(os.environ.get("CASSIE_RANDOM_INPUT", "20"))
SPEED = 0.3
WAYS_IN = ("web_console", "rc_teleop", "cmd_vel")
_WILD = (float("nan"), float("inf"), -1e308, 1e9, -1.0, 0.0, 3.0)


class Topics:
    """Messages of pads and planners that nobody should send."""

    def __init__(self, domain: int, rng: np.random.Generator) -> None:
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        self._node = Node("noise", context=self._context)
        self._rng = rng
        self._joy = self._node.create_publisher(Joy, "/joy", 10)
        self._twist = self._node.create_publisher(Twist, "/cmd_vel", 10)
        self._stamped = self._node.create_publisher(TwistStamped, "/cmd_vel_stamped", 10)
        self.sent = 0

    def step(self) -> None:
        """One message on each."""
        rng = self._rng
        axes = [float("nan"), *rng.choice(_WILD, int(rng.integers(16))).tolist()]
        self._joy.publish(Joy(axes=axes, buttons=[int(rng.integers(3))] * int(rng.integers(20))))
        x, y, z = rng.choice(_WILD, 3).tolist()
        twist = Twist(linear=Vector3(x=x, y=y), angular=Vector3(z=z))
        self._twist.publish(twist)
        self._stamped.publish(TwistStamped(twist=twist))
        self.sent += 3

    def close(self) -> None:
        """Leave."""
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[Robot]:
    """A robot on its feet, paused, whose nodes are still to be started."""
    with Robot(
        tmp_path,
        simulator={"scripted_operator": False, "max_rate": 1.0, "paused": True},
        mode_supervisor={"scripted_operator": False},
    ) as robot:
        yield robot


def open_ways_in(robot: Robot) -> str:
    """Start every way in for operators; returns the address that the console prints."""
    words = {"web_console": ["--ros-args", "-p", "port:=0"]}
    for name in WAYS_IN:
        robot.processes.start(name, [executable("cassie_teleop", name), *words.get(name, [])])
    log = robot.folder / "log" / "web_console.log"
    found: list[str] = []

    def printed() -> bool:
        found[:] = re.findall(r"http://\S+", log.read_text() if log.exists() else "")
        return bool(found)

    robot.eyes.wait_for(printed, "the address")
    return found[0]


@pytest.mark.timeout(SECONDS + 600.0)
def test_noise_on_every_way_in_beside_an_operator_who_drives(robot: Robot) -> None:
    person = Person(robot, "first-1")
    eyes = robot.eyes
    with person:  # who speaks before the first sample, which tells who holds the lease
        robot.start("state_estimator", "gait_controller", "mode_supervisor", "simulator")
        walking(robot, person)
        address = open_ways_in(robot)
        topics = Topics(robot.domain, np.random.default_rng(21))
        # In a process of its own: it must not hold up the operator, who is in this one.
        pages = subprocess.Popen(
            [sys.executable, Path(__file__).with_name("noisy_pages.py"), address, "20"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        episode, before = eyes.episode, dict[str, float]()
        travelled, (last, _) = 0.0, eyes.position()
        end = time.monotonic() + SECONDS
        try:
            while (left := end - time.monotonic()) > 0.0:
                topics.step()
                eyes.look(0.02)
                walks = eyes.mode == "walk"
                stopped = eyes.mode == "stand" and eyes.held_up(BACK_WITHIN)
                assert robot.stands() and (walks or stopped), eyes.summary()
                person.set(vx=SPEED if walks else 0.0)  # a stick let go of, and pushed again
                holder = eyes.statuses[-1][1].holder
                assert not holder.startswith("web_console"), holder
                x, _ = eyes.position()
                travelled, last = travelled + abs(x - last), x
                if not before and left < 0.5 * SECONDS:
                    before = {name: memory(robot, name) for name in WAYS_IN}
        finally:
            told, _ = pages.communicate(timeout=90.0)
            topics.close()
        robot.processes.check()
        assert eyes.episode == episode
        links = json.loads(told)
        assert topics.sent > 100 and links["opened"] > CLIENTS and links["refused"] > 5
        assert travelled > 0.1 * SPEED * SECONDS
        for name in WAYS_IN:
            assert memory(robot, name) < before[name] + 10.0, name
            assert "Traceback" not in robot.processes.log(name).read_text(), name
