"""When the loopback profile is used, and that Fast DDS accepts it."""

from __future__ import annotations

import os
import subprocess
import sys
from itertools import chain, repeat

import pytest

from cassie_msgs.ros import transport
from cassie_msgs.ros.transport import ALONE, PROFILE, QUIET, use_loopback, wait_for_discovery

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


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Time that passes by sleeping alone. In s."""
    now = [0.0]
    monkeypatch.setattr(transport.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(transport.time, "sleep", lambda s: now.append(now.pop() + s))
    return now


def test_who_answers_late_on_a_busy_machine_is_waited_for(clock: list[float]) -> None:
    """The small ros2 and the doctor had seen nobody, as the first answer took 0.6 s."""
    late = chain(repeat((), 30), [("a",)], repeat(("a", "b")))
    wait_for_discovery(lambda: next(late))
    assert clock[0] == pytest.approx(31 * 0.05 + QUIET, abs=0.1)


def test_discovery_ends_where_nobody_is_and_where_it_never_rests(clock: list[float]) -> None:
    wait_for_discovery(tuple)
    assert clock[0] == pytest.approx(ALONE, abs=0.1)
    wait_for_discovery(lambda: (clock[0],))
    assert clock[0] == pytest.approx(ALONE + transport.LONGEST, abs=0.2)


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
            _, errors = talk.communicate(timeout=90.0)
            assert talk.returncode == 0, errors
            assert "XMLPARSER" not in errors
    finally:
        for talk in talks:
            talk.kill()
