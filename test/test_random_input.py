"""Random input on all topics and services at once: nobody breaks, falls, obeys or grows.

`CASSIE_RANDOM_INPUT=600` makes it last ten minutes instead of seconds.
"""

from __future__ import annotations

import os
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from bringup import SERVICES, WALK, Robot
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import Joy
from test_command_lane import KINDS, bring_up, writers

from cassie_msgs.layout import OperatorCommand, Sample

SECONDS = float(os.environ.get("CASSIE_RANDOM_INPUT", "20"))
QUIET = 3.0
"""Wall time before it, in which the pace of robot time is taken. In s."""
BACK_WITHIN = 10.0
"""Robot time in which it walks again after a node was late. In s."""
NODES = ("simulator", "state_estimator", "gait_controller", "mode_supervisor")
_WILD = (float("nan"), float("inf"), -1e308, 1e9, -1.0, 0.0, 3.0)


class Noise:
    """A node that writes and calls at random."""

    def __init__(self, domain: int, rng: np.random.Generator) -> None:
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        self.node = Node("noise", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._rng = rng
        self._lane = writers(self.node, KINDS)
        self._joy = self.node.create_publisher(Joy, "/joy", 10)
        self._services = {
            name: self.node.create_client(kind, f"/cassie/{name}")
            for name, kind in SERVICES.items()
        }
        self._parameters = [
            self.node.create_client(SetParameters, f"/{name}/set_parameters") for name in NODES
        ]
        self.sent = self.called = 0

    def close(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)

    def step(self) -> None:
        """One message on every topic, now and then a call of a service."""
        for sample, publisher in self._lane:
            publisher.publish_raw(self._bytes(sample))
        values = self._rng.choice(_WILD, 16).tolist()
        self._joy.publish(Joy(axes=values, buttons=[1] * int(self._rng.integers(20))))
        self.sent += len(self._lane) + 1
        if self._rng.random() < 0.2:
            self._call()
        self._executor.spin_once(timeout_sec=0.0)

    def _bytes(self, sample: Sample) -> bytes:
        """A message: noise, wrong in size or encoding, or with numbers that could be."""
        rng = self._rng
        how = rng.integers(5)
        if how == 0:
            return rng.bytes(int(rng.integers(4, sample.SIZE)))
        raw = np.frombuffer(rng.bytes(sample.SIZE), np.uint8).copy()
        raw[:4] = (0, how == 1 or 1, 0, 0)
        sample.load(raw.tobytes())
        if how >= 3:
            sample.floats[:] = rng.normal(size=sample.floats.size)
            sample.seq[...] = rng.integers(100_000)
            sample.episode[...] = int(time.time()) + rng.integers(-300, 300)
        if isinstance(sample, OperatorCommand):
            sample.sender[:] = 0  # nobody in particular: who says its name may stop the robot
        return sample.to_bytes()

    def _call(self) -> None:
        rng = self._rng
        self.called += 1
        wild = [float(value) for value in rng.choice(_WILD[:4], 3)]
        fields: dict[str, dict[str, Any]] = {
            "reset": {"start": "moon", "seed": 7},
            "step": {"ticks": int(rng.integers(2**32))},
            "push": {"body": "", "force": wild, "duration": 0.1},
            "gantry": {"action": str(rng.choice(["fly", "lower"])), "height": wild[0]},
        }
        name = str(rng.choice([*fields]))
        if self._services[name].service_is_ready():
            self._services[name].call_async(SERVICES[name].Request(**fields[name]))
        value = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=wild[1])
        names = ("control_rate", "walk.map_gain_x", "vx_forward", "no_such_name", "max_rate")
        request = SetParameters.Request(
            parameters=[Parameter(name=str(rng.choice(names)), value=value)]
        )
        client = self._parameters[int(rng.integers(len(NODES)))]
        if client.service_is_ready():
            client.call_async(request)


def memory(robot: Robot, name: str) -> float:
    """Resident memory of a node. In MB."""
    pid = robot.processes.pid(name)
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


@pytest.mark.timeout(SECONDS + 600.0)
def test_random_input_on_all_topics_and_services_at_once(tmp_path: Path) -> None:
    with Robot(tmp_path, [*WALK, {"t": 3.0, "vx": 0.3}], simulator={"paused": True}) as robot:
        bring_up(robot, "walk")
        eyes = robot.eyes
        quiet, began = eyes.tick, time.monotonic()
        eyes.wait_for(lambda: time.monotonic() > began + QUIET, "a rate without noise")
        rate = (eyes.tick - quiet) / QUIET
        noise = Noise(robot.domain, np.random.default_rng(19))
        before: dict[str, float] = {}
        end = time.monotonic() + SECONDS
        ticks = eyes.tick
        try:
            while (left := end - time.monotonic()) > 0.0:
                noise.step()
                eyes.look(0.02)
                assert robot.stands(), eyes.summary()
                stopped = eyes.mode == "stand" and eyes.held_up(BACK_WITHIN)
                assert eyes.mode == "walk" or stopped, eyes.summary()
                if not before and left < 0.5 * SECONDS:
                    before = {name: memory(robot, name) for name in NODES}
        finally:
            noise.close()
        robot.processes.check()
        assert noise.sent > 100 and noise.called > 10
        assert eyes.tick > ticks + 0.1 * rate * SECONDS
        assert eyes.is_well("simulator: lockstep")
        for name in NODES:
            assert memory(robot, name) < before[name] + 5.0, name
            assert "Traceback" not in robot.processes.log(name).read_text(), name


def test_the_robot_walks_beside_noise_that_began_before_the_nodes(tmp_path: Path) -> None:
    with Robot(tmp_path, WALK, simulator={"paused": True}) as robot:
        noise, over = Noise(robot.domain, np.random.default_rng(20)), threading.Event()

        def speak() -> None:
            while not over.wait(0.005):
                noise.step()

        speaker = threading.Thread(target=speak)
        speaker.start()
        try:
            robot.start()
            robot.go()
            robot.eyes.wait_for(lambda: robot.eyes.mode == "walk", "mode walk")
            walking = robot.eyes.tick
            robot.eyes.wait_for(lambda: robot.eyes.tick > walking + 2000, "4 s of walking")
            assert robot.stands() and robot.eyes.mode == "walk", robot.eyes.summary()
            robot.processes.check()
        finally:
            over.set()
            speaker.join()
            noise.close()
        for log in (tmp_path / "log").glob("*.log"):
            assert "Traceback" not in log.read_text(), log.stem
