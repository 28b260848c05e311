"""Velocity commands to operator commands: the rules, and the node with real messages."""

import math
import signal
import subprocess
import sys
import time

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist, TwistStamped
from rclpy.executors import SingleThreadedExecutor
from std_srvs.srv import SetBool
from test_teleop_nodes import Commands

from cassie_msgs.layout import RobotMode
from cassie_msgs.msg import SupervisorStatus
from cassie_teleop.cmd_vel import AT_REST, VelocityCommands, VelocityError, obstacle


@pytest.fixture
def commands():
    commands = VelocityCommands(timeout=0.5, stand_after=2.0)
    commands.power(True, 0.0)
    return commands


def speeds(request):
    return request.vx, request.vy, request.yaw_rate


def test_nothing_is_said_before_power_is_asked_for_or_cut():
    commands = VelocityCommands(0.5, 2.0)
    commands.receive(0.5, 0.0, 0.0, 0.0)
    assert commands.request(0.1) is None
    commands.power(False, 0.2)
    assert commands.request(0.3).emergency_stop


def test_power_is_asked_for_at_rest_and_a_velocity_asks_for_walking(commands):
    commands.receive(0.5, 0.1, -0.2, 0.1)
    assert commands.request(0.2).mode == "stand" and speeds(commands.request(0.2)) == (
        0.0,
        0.0,
        0.0,
    )
    commands.receive(0.5, 0.1, -0.2, AT_REST)
    request = commands.request(AT_REST)
    assert (request.mode, *speeds(request), request.power) == ("walk", 0.5, 0.1, -0.2, True)


def test_silence_is_stop_and_then_stand(commands):
    commands.receive(0.5, 0.0, 0.0, 2.0)
    assert commands.request(2.4).vx == 0.5
    assert (commands.request(2.6).mode, commands.request(2.6).vx) == ("walk", 0.0)
    assert commands.request(4.6).mode == "stand"


def test_zero_velocities_end_in_standing_too(commands):
    commands.receive(0.5, 0.0, 0.0, 2.0)
    for tenth in range(1, 40):
        commands.receive(0.0, 0.0, 0.0, 2.0 + 0.1 * tenth)
    assert commands.request(5.9).mode == "stand"


@pytest.mark.parametrize("wild", [math.nan, math.inf, -math.inf, 1e300])
@pytest.mark.parametrize("place", range(3))
def test_what_is_not_meant_is_refused_by_name_and_counts_as_stop(commands, wild, place):
    commands.receive(0.5, 0.0, 0.0, 2.0)
    values = [0.3, 0.1, 0.2]
    values[place] = wild
    with pytest.raises(VelocityError, match=r"(linear|angular)\.[xyz] = "):
        commands.receive(*values, 2.1)
    assert speeds(commands.request(2.2)) == (0.0, 0.0, 0.0)


def test_too_fast_is_held_within_the_range_and_the_lease_is_asked_for_at_rest(commands):
    assert commands.receive(0.5, 0.0, 0.0, 1.9) == ""
    assert commands.receive(-9.0, 0.0, 9.0, 2.0) == "linear.x is held within -1.3 .. 4.5 m/s"
    assert speeds(commands.request(2.1)) == (-1.3, 0.0, 1.2)
    commands.take_over(2.1)
    assert commands.request(2.2).take_over and speeds(commands.request(2.2)) == (0.0, 0.0, 0.0)


def start(*arguments):
    code = "from cassie_teleop.ros.cmd_vel import main; main()"
    return subprocess.Popen([sys.executable, "-c", code, "--ros-args", *arguments])


def stamped(vx):
    message = TwistStamped()
    message.twist.linear.x = vx
    return message


def plain(vx):
    message = Twist()
    message.linear.x = vx
    return message


@pytest.mark.parametrize("message", [plain, stamped])
def test_the_node_hears_either_type_and_its_last_word_is_one_stop(node, message):
    commands = Commands(node)
    velocities = node.create_publisher(type(message(0.0)), "/cmd_vel", 10)
    process = start("-p", "power:=true")
    try:

        def walks(command):
            velocities.publish(message(0.4))
            return abs(command.vx - 0.4) < 1e-9

        moving = commands.until(walks)
        assert moving.mode == RobotMode.WALK and moving.power
        commands.until(lambda c: c.vx == 0.0 and c.link)  # nobody speaks any more

        def stops(command):
            velocities.publish(message(math.nan))
            return command.vx == 0.0

        commands.until(walks)
        commands.until(stops)
        commands.until(walks)
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=90) == 0
        commands.until(lambda c: not c.link)
        assert [bool(c.link) for c in commands.all[-2:]] == [True, False]
    finally:
        process.kill()


def test_a_flood_is_thinned_out_and_its_end_in_mid_drive_is_a_stop(node):
    commands = Commands(node)
    velocities = node.create_publisher(Twist, "/cmd_vel", 10)
    process = start("-p", "power:=true")
    try:

        def flood(command):
            for _ in range(100):
                velocities.publish(plain(0.4))
            return abs(command.vx - 0.4) < 1e-9

        commands.until(flood)
        count, begin = len(commands.all), time.monotonic()
        while time.monotonic() < begin + 1.0:
            commands.until(flood)
        assert len(commands.all) - count < 300 * (time.monotonic() - begin)
        node.destroy_publisher(velocities)
        stopped = commands.until(lambda c: c.vx == 0.0)
        assert stopped.power and stopped.link
        assert commands.until(lambda c: c.mode == RobotMode.STAND).power
    finally:
        process.kill()


@pytest.mark.parametrize(
    ("holder", "faults", "armed", "words"),
    [
        ("", [], True, ""),
        ("cmd_vel-1", ["IMU lost"], True, ""),
        ("keyboard_teleop-2", [], True, "keyboard_teleop-2 drives: call /cmd_vel/take_over"),
        ("cmd_vel-1", ["no power: power comes on only with stand"], True, "pause the velocity"),
        ("cmd_vel-1", ["no power: stopped by x: switch the power off and on"], True, "cmd_vel/po"),
        ("cmd_vel-1", [], False, "until the velocity was zero"),
    ],
)
def test_what_keeps_the_robot_from_following_is_said(holder, faults, armed, words):
    found = obstacle("cmd_vel-1", holder, faults, armed)
    assert words in found and bool(words) == bool(found)


def test_a_node_that_starts_before_the_robot_says_so_and_follows_once_it_comes(node):
    commands, told = Commands(node), []
    node.create_subscription(
        DiagnosticArray,
        "/diagnostics",
        lambda m: told.extend(s.message for s in m.status if s.name == "cmd_vel: robot"),
        10,
    )
    statuses = node.create_publisher(SupervisorStatus, "/cassie/supervisor_status", 10)
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)

    def says(words, status=None):
        deadline = time.monotonic() + 30.0
        while words not in told[-1:]:
            assert time.monotonic() < deadline, told
            if status is not None:
                statuses.publish(status)
            executor.spin_once(timeout_sec=0.05)

    process = start("-p", "power:=true")
    try:
        says("no robot answers on /cassie/supervisor_status; its power comes on once it does")
        commands.until(lambda c: bool(c.power))
        says("ok", SupervisorStatus(armed=True))
    finally:
        process.kill()
        executor.shutdown()


def test_two_writers_at_once_are_named(node):
    commands, told = Commands(node), []
    node.create_subscription(
        DiagnosticArray, "/diagnostics", lambda m: told.extend(s.message for s in m.status), 10
    )
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    first = node.create_publisher(Twist, "/cmd_vel", 10)
    second = node.create_publisher(Twist, "/cmd_vel", 10)
    process = start("-p", "power:=true")
    try:
        deadline = time.monotonic() + 30.0
        while not any("put a twist_mux between them" in message for message in told):
            assert time.monotonic() < deadline, told
            first.publish(plain(0.3))
            second.publish(plain(0.2))
            executor.spin_once(timeout_sec=0.05)
        commands.until(lambda c: bool(c.power))
        assert process.poll() is None
    finally:
        process.kill()
        executor.shutdown()


def test_a_writer_of_the_other_type_may_take_over(node):
    commands = Commands(node)
    velocities = node.create_publisher(Twist, "/cmd_vel", 10)
    process = start("-p", "power:=true")
    context = rclpy.Context()
    rclpy.init(context=context)
    other = rclpy.create_node("nav", context=context)
    try:

        def walks(command):
            velocities.publish(plain(0.4))
            return abs(command.vx - 0.4) < 1e-9

        commands.until(walks)
        node.destroy_publisher(velocities)
        velocities = other.create_publisher(TwistStamped, "/cmd_vel", 10)

        def walks_slowly(command):
            velocities.publish(stamped(0.2))
            return abs(command.vx - 0.2) < 1e-9

        commands.until(walks_slowly)
    finally:
        process.kill()
        other.destroy_node()
        rclpy.shutdown(context=context)


def test_the_service_switches_power_and_cuts_it_as_an_emergency_stop(node):
    commands = Commands(node)
    process = start()
    try:
        client = node.create_client(SetBool, "/cmd_vel/power")
        assert client.wait_for_service(20.0)
        client.call_async(SetBool.Request(data=True))
        commands.until(lambda c: bool(c.power))
        client.call_async(SetBool.Request(data=False))
        assert not commands.until(lambda c: bool(c.emergency_stop)).power
    finally:
        process.kill()
