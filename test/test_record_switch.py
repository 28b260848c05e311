"""A recorder that runs records while a switch of the radio is up."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import pytest
import rclpy
from bringup import TIMEOUT
from mcap.reader import make_reader
from rclpy.context import Context
from rclpy.node import Node
from sensor_msgs.msg import Joy

from cassie_bags.ros.processes import Processes, environment, executable, own_domain

SF = 13
RADIO = [0.0] * 8 + [1.0, -1.0, -1.0] + [0.0] * 2 + [-1.0] + [0.0] * 2


@pytest.mark.timeout(300)
def test_the_radio_begins_and_ends_recordings(tmp_path: Path) -> None:
    bags = tmp_path / "drive.mcap", tmp_path / "drive_2.mcap"
    with own_domain() as domain, Processes(environment(domain), tmp_path) as processes:
        recorder = [executable("cassie_bags", "record"), "--start-paused", "-o", bags[0]]
        context = Context()
        rclpy.init(context=context, domain_id=domain)
        node = Node("radio", context=context)
        joy = node.create_publisher(Joy, "/joy", 10)

        def hold(switch: float, until: Callable[[], bool]) -> None:
            axes, deadline = RADIO.copy(), time.monotonic() + TIMEOUT
            axes[SF] = switch
            while not until():
                assert time.monotonic() < deadline, processes.log("rc_teleop").read_text()
                joy.publish(Joy(axes=axes, buttons=[1, 1]))
                time.sleep(0.02)

        def told(words: str) -> Callable[[], bool]:
            return lambda: words in processes.log("rc_teleop").read_text()

        def soon() -> Callable[[], bool]:
            end = time.monotonic() + 1.0
            return lambda: time.monotonic() > end

        try:
            processes.start("rc_teleop", [executable("cassie_teleop", "rc_teleop")])
            hold(-1.0, lambda: node.count_subscribers("/joy") > 0)
            hold(-1.0, soon())
            hold(1.0, told("record --start-paused"))
            processes.start("record", recorder)
            hold(-1.0, lambda: bool(node.count_services("/recorder/record")))
            hold(-1.0, soon())
            for bag in bags:
                hold(1.0, bag.exists)
                hold(1.0, soon())
                ended = processes.log("rc_teleop").read_text().count("recorded")
                hold(
                    -1.0,
                    lambda n=ended: processes.log("rc_teleop").read_text().count("recorded") > n,
                )
            hold(-1.0, soon())
            processes.check()
        finally:
            node.destroy_node()
            rclpy.shutdown(context=context)
    for bag in bags:
        with bag.open("rb") as stream:
            messages = make_reader(stream).iter_messages(topics=["/cassie/operator_command"])
            assert len([*messages]) > 10
