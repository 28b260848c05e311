"""When the loopback profile is used, and that Fast DDS accepts it."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from cassie_msgs.ros.transport import PROFILE, use_loopback

LOCAL = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


def test_this_machine_only_means_loopback() -> None:
    environment = dict(LOCAL)
    assert use_loopback(environment)
    assert environment["FASTRTPS_DEFAULT_PROFILES_FILE"] == str(PROFILE)
    assert environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "SYSTEM_DEFAULT"
    assert PROFILE.is_file()
    assert use_loopback(environment | LOCAL)  # a child that is told the range once more


@pytest.mark.parametrize(
    "asked",
    [
        {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"},
        {**LOCAL, "FASTRTPS_DEFAULT_PROFILES_FILE": "/mine.xml"},
        {**LOCAL, "RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp"},
        {},
    ],
)
def test_another_choice_stays_as_it_is(asked: dict[str, str]) -> None:
    environment = dict(asked)
    assert not use_loopback(environment)
    assert environment == asked


_TALK = """
import sys
from cassie_msgs.ros.transport import use_loopback
if sys.argv[1] == "loopback":
    use_loopback()
import rclpy
from rclpy.node import Node
from std_msgs.msg import String
rclpy.init()
node = Node(sys.argv[1])
heard = []
node.create_subscription(String, "/" + sys.argv[2], heard.append, 10)
publisher = node.create_publisher(String, "/" + sys.argv[1], 10)
while not (heard and publisher.get_subscription_count()):
    publisher.publish(String(data="x"))
    rclpy.spin_once(node, timeout_sec=0.05)
for _ in range(20):
    publisher.publish(String(data="x"))
    rclpy.spin_once(node, timeout_sec=0.05)
"""


@pytest.mark.parametrize("other", ["LOCALHOST", "SUBNET"])
def test_processes_with_and_without_it_hear_each_other(other: str) -> None:
    ours = {**os.environ, **LOCAL, "ROS_DOMAIN_ID": "37"}
    theirs = {**ours, "ROS_AUTOMATIC_DISCOVERY_RANGE": other}
    talks = [
        subprocess.Popen(
            [sys.executable, "-c", _TALK, *names], env=env, stderr=subprocess.PIPE, text=True
        )
        for names, env in ((("loopback", "plain"), ours), (("plain", "loopback"), theirs))
    ]
    try:
        for talk in talks:
            _, errors = talk.communicate(timeout=30.0)
            assert talk.returncode == 0, errors
            assert "XMLPARSER" not in errors
    finally:
        for talk in talks:
            talk.kill()
