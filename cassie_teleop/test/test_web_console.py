"""The console as a process, with a stand-in for the robot and pages without a browser."""

import math
import os
import re
import signal
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

import pytest
from console_peers import CODE, Page, Robot, WebConsole
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import TransformStamped
from mcap.reader import make_reader
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import serialize_message
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from cassie_msgs.layout import RobotMode
from cassie_msgs.msg import SupervisorStatus
from cassie_msgs.operators import sender_of
from cassie_msgs.ros.scheduling import OPERATOR_PRIORITY

MCAP_END = b"\x89MCAP0\r\n"


@pytest.fixture
def robot(node):
    return Robot(node)


@pytest.fixture
def console():
    with WebConsole() as console:
        yield console


def drive(robot, page, mode="walk"):
    """Have a page drive with power in a mode."""
    robot.until(lambda: page.status.get("heard") and page.status.get("robot"))
    page.press("drive")
    robot.until(lambda: page.status["driver"] == page.hello["page"])
    page.press("power")
    robot.command(lambda c: c.power)
    robot.state.power[...] = 1.0
    robot.until(lambda: page.status["power"])
    page.press(mode)
    robot.command(lambda c: c.mode == RobotMode[mode.upper()])
    robot.until(lambda: page.status["armed"] and page.status["asked"]["mode"] == mode)


def test_a_page_drives_and_its_sticks_are_let_go(robot, console):
    with Page(console.address) as page:
        drive(robot, page)
        page.sticks["forward"] = 1.0
        command = robot.moving()
        assert (float(command.vx), bool(command.link), bool(command.power)) == (0.8, True, True)
        assert sender_of(command) == console.name == page.hello["own"]
        assert (command.seq, command.episode, bool(command.scripted)) == (0, 0, False)
        page.sticks["forward"] = 0.0
        assert robot.command(lambda c: c.vx == 0.0).mode == RobotMode.WALK


@pytest.mark.parametrize("how", ["asleep", "hidden", "closed"])
def test_a_page_that_is_asleep_hidden_or_closed_moves_nothing(robot, console, how):
    with Page(console.address) as page:
        drive(robot, page)
        page.sticks["forward"] = 1.0
        robot.moving()
        if how == "asleep":
            page.awake = False
        elif how == "hidden":
            page.visible = False
        else:
            page.close()
        lost = robot.command(lambda c: not c.link)
        assert (float(lost.vx), bool(lost.power)) == (0.0, True)
        after = robot.commands[robot.commands.index(lost) :]
        assert not any(c.vx for c in after)
        if how == "closed":
            robot.commands.clear()
            with pytest.raises(AssertionError):
                robot.until(lambda: robot.commands, timeout=0.5)


def test_a_second_page_looks_on_can_stop_the_robot_and_takes_over_at_rest(robot, console):
    with Page(console.address) as first, Page(console.address) as second:
        drive(robot, first)
        second.press("stand")
        second.sticks["forward"] = 1.0
        robot.until(lambda: "drives" in second.told)
        assert second.status["driver"] == first.hello["page"]
        robot.commands.clear()
        second.press("stop")
        stop = robot.command(lambda c: c.emergency_stop)
        assert not stop.power and not any(c.vx for c in robot.commands)
        robot.state.power[...] = 0.0
        second.sticks["forward"] = 0.0
        second.press("drive")
        robot.until(lambda: second.status["driver"] == second.hello["page"])


def test_another_operator_with_the_lease_is_asked_and_then_left_alone(robot, console):
    robot.status.holder = "keyboard_teleop-4"
    with Page(console.address) as page:
        robot.until(lambda: (page.status.get("robot") or {}).get("holder"))
        page.press("drive")
        assert robot.command(lambda c: c.take_over)
        robot.until(lambda: page.status["driver"] is None and page.status["notice"])
        assert "keyboard_teleop-4 drives" in page.status["notice"]
        robot.until(lambda: robot.commands)
        robot.commands.clear()
        with pytest.raises(AssertionError):
            robot.until(lambda: robot.commands, timeout=0.5)


def test_ctrl_c_leaves_exactly_one_stop_while_the_page_drives_on(robot, console):
    with Page(console.address) as page:
        drive(robot, page)
        page.sticks["forward"] = 1.0
        robot.moving()
        robot.commands.clear()
        console.process.send_signal(signal.SIGINT)
        robot.until(lambda: console.process.poll() is not None)
        assert console.process.returncode == 0
        robot.until(lambda: robot.commands and not robot.commands[-1].link)
        with pytest.raises(AssertionError):
            robot.until(lambda: False, timeout=0.3)
        assert [bool(c.link) for c in robot.commands].count(False) == 1
        assert not robot.commands[-1].link and robot.commands[-1].power


def test_without_a_page_it_subscribes_to_nothing_and_says_nothing(robot, console, node):
    def subscribed():
        names = node.get_subscriber_names_and_types_by_node("web_console", "/")
        return [topic for topic, _ in names if topic.startswith("/cassie") or topic == "/tf"]

    robot.until(lambda: "web_console" in node.get_node_names())
    assert subscribed() == []
    with Page(console.address):
        robot.until(lambda: len(subscribed()) >= 5)
    robot.until(lambda: subscribed() == [])
    assert not robot.commands


def test_in_wall_time_it_runs_before_browsers_and_its_recorder_once_it_records(
    robot, tmp_path, real_time
):
    if not real_time:
        pytest.skip("needs the permission for real-time scheduling")
    with WebConsole("-p", f"bags:={tmp_path}") as console, Page(console.address) as page:
        main = console.process.pid
        robot.until(lambda: page.status.get("robot"))
        assert os.sched_getscheduler(main) == os.SCHED_OTHER
        robot.state.wall_paced[...] = 1
        robot.until(lambda: os.sched_getparam(main).sched_priority == OPERATOR_PRIORITY)
        assert os.sched_getscheduler(main) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO
        page.press("record")
        robot.until(lambda: page.status["recording"])
        children = f"/proc/{main}/task/{main}/children"
        (recorder,) = map(int, Path(children).read_text(encoding="ascii").split())
        assert os.sched_getscheduler(recorder) == os.SCHED_OTHER  # while it starts
        robot.until(lambda: os.sched_getparam(recorder).sched_priority == OPERATOR_PRIORITY)
        page.press("record")
        robot.until(lambda: page.status["recording"] == "")


def test_a_recording_is_ended_whole_where_the_console_is_killed(robot, tmp_path):
    with WebConsole("-p", f"bags:={tmp_path}") as console, Page(console.address) as page:
        robot.until(lambda: page.status.get("robot"))
        page.press("record")
        robot.until(lambda: page.status["recording"] and robot.readers == 2)
        bag = tmp_path / page.status["recording"]
        console.process.kill()
        robot.until(lambda: bag.exists() and bag.read_bytes()[8:].endswith(MCAP_END))
    with bag.open("rb") as stream:
        assert make_reader(stream).get_summary() is not None


def test_bytes_that_are_no_message_and_wild_ones_change_nothing(robot, node, console):
    wild = SupervisorStatus(longest_delay=math.nan, missed_share=math.inf, mode="<b>")
    kinds = {
        "/diagnostics": DiagnosticArray(status=[DiagnosticStatus(name="x", level=b"\x01")]),
        "/tf": TFMessage(transforms=[TransformStamped()]),
        "/cassie/supervisor_status": wild,
    }
    publishers = {topic: node.create_publisher(type(m), topic, 10) for topic, m in kinds.items()}
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publishers["/robot_description"] = node.create_publisher(String, "/robot_description", latched)
    kinds["/robot_description"] = String(data="<robot>" + "x" * 60)
    with Page(console.address) as page:
        robot.until(lambda: page.status.get("robot"))
        robot.until(lambda: all(each.get_subscription_count() for each in publishers.values()))
        for topic, message in kinds.items():
            raw = serialize_message(message)
            for length in range(4, len(raw), 5):
                publishers[topic].publish(raw[:length])
                time.sleep(0.002)
            publishers[topic].publish(message)
        robot.until(lambda: "x: " in page.status["reports"])
        seen = page.frame["t"]
        robot.until(lambda: page.frame["t"] > seen + 1.0)
        assert page.status["robot"]["mode"] in ("stand", "<b>")
    assert console.process.poll() is None


def test_a_page_is_told_that_nobody_listens(node, console):
    with Page(console.address) as page:
        deadline = time.monotonic() + 20
        while "heard" not in page.status or "achieved" not in page.frame:
            assert time.monotonic() < deadline
            time.sleep(0.02)
        assert page.status["heard"] is False and page.status["orders"] == []
        assert page.status["robot"] is None and page.frame["achieved"] is None


def test_fifty_pages_that_come_and_go_leave_no_memory_behind(robot, console):
    def crowd():
        pages = [Page(console.address) for _ in range(50)]
        for page in pages:
            page.__enter__()
        for page in pages:
            page.press("walk")
            page.sticks["forward"] = 1.0
        robot.until(lambda: all(page.frame for page in pages))
        for page in pages:
            page.close()

    crowd()
    before = console.memory
    for _ in range(3):
        crowd()
    assert console.memory - before < 8.0
    assert not robot.commands and console.process.poll() is None


def test_other_computers_need_the_token_that_it_prints():
    with WebConsole("-p", "host:=0.0.0.0") as console:
        assert "?token=" in console.address
        port = re.search(r":(\d+)/", console.address)[1]
        with pytest.raises(urllib.error.HTTPError):
            urllib.request.urlopen(f"http://127.0.0.1:{port}/")
        token = console.address.partition("?token=")[2]
        with Page(f"http://127.0.0.1:{port}/?token={token}") as page:
            assert page.hello["page"] == 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["-p", "token:=short"], "token has 5 characters"),
        (["-p", "port:=70000"], "port = 70000"),
        (["-p", "host:=300.1.1.1"], "300.1.1.1"),
        (["-p", "reach.forward:=9.0"], "reach.forward"),
    ],
)
def test_wrong_parameters_are_refused_in_one_line(arguments, words):
    command = [sys.executable, "-c", CODE, "--ros-args", *arguments]
    run = subprocess.run(command, capture_output=True, text=True, timeout=90)
    assert run.returncode == 2 and run.stdout == ""
    assert words in run.stderr and run.stderr.count("\n") == 1


def test_a_port_in_use_is_refused_in_one_line(console):
    port = re.search(r":(\d+)/", console.address)[1]
    command = [sys.executable, "-c", CODE, "--ros-args", "-p", f"port:={port}"]
    run = subprocess.run(command, capture_output=True, text=True, timeout=90)
    assert run.returncode == 2
    assert run.stderr == (
        f"web_console: error: cannot listen on 127.0.0.1, port {port}: Address already in use; "
        "-p port:=0 takes a free one (with robot: -p web_console:port:=0)\n"
    )
