"""The nodes as processes: what they send, how they stop, what they refuse."""

import contextlib
import os
import pty
import re
import signal
import subprocess
import sys
import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Joy

from cassie_msgs.layout import OperatorCommand, RobotMode, RobotState
from cassie_msgs.ros.fast_lane import EVERY, LanePublisher, LaneSubscription, LaneWaiter
from cassie_msgs.srv import Reset

GOOD = [0.0] * 8 + [1.0, 0.0, -1.0] + [0.0] * 5


STARTED = []


def start(name, *arguments, **kwargs):
    code = f"from cassie_teleop.ros.{name} import main; main()"
    STARTED.append(subprocess.Popen([sys.executable, "-c", code, *arguments], **kwargs))
    return STARTED[-1]


@pytest.fixture(autouse=True)
def no_process_left():
    """A test that fails leaves nothing running."""
    yield
    while STARTED:
        process = STARTED.pop()
        process.kill()
        process.wait()


class Commands:
    """Reader of /cassie/operator_command that keeps everything it got."""

    def __init__(self, node):
        self.subscription = LaneSubscription(node, OperatorCommand, qos=EVERY)
        self.waiter = LaneWaiter(node, [self.subscription])
        self.all = []

    def until(self, condition, timeout=90.0, meanwhile=lambda: None):
        """Take commands until one meets a condition; returns it."""
        deadline = time.monotonic() + timeout
        while time.monotonic() < deadline:
            meanwhile()
            self.waiter.wait(0.02)
            command = OperatorCommand()
            while self.subscription.take_next(command):
                self.all.append(command)
                if condition(command):
                    return command
                command = OperatorCommand()
        raise AssertionError(f"no such command among {len(self.all)}")


def end(process, number=signal.SIGINT):
    process.send_signal(number)
    assert process.wait(timeout=90) == 0


def test_rc_teleop_sends_what_the_radio_says_and_loses_the_link_without_it(node):
    commands = Commands(node)
    joy = node.create_publisher(Joy, "/joy", 10)
    radio = start("rc_teleop")
    try:
        walking = GOOD.copy()
        walking[2] = 1.0
        seen = commands.until(
            lambda c: c.vx == 1.0, meanwhile=lambda: joy.publish(Joy(axes=walking, buttons=[1, 1]))
        )
        assert seen.mode == RobotMode.WALK and seen.power and seen.link and not seen.scripted
        assert (seen.seq, seen.episode) == (0, 0) and seen.stamp_ns > 1e18
        lost = commands.until(lambda c: not c.link)
        assert lost.power and lost.vx == 0.0
        commands.until(
            lambda c: not c.power,
            meanwhile=lambda: joy.publish(Joy(axes=[0.0] * 16, buttons=[1, 1])),
        )
    finally:
        end(radio)


def test_a_stick_is_sent_on_as_it_moves_and_a_released_button_stops_once(node):
    """Each message has a speed of its own, by which its command is known."""
    commands = Commands(node)
    joy = node.create_publisher(Joy, "/joy", 10)
    start("rc_teleop", "--ros-args", "-p", "device:=xbox", "-p", "rate:=10.0")

    def send(vx, *pressed):
        joy.publish(Joy(axes=[0.0, vx, *6 * [0.0]], buttons=[int(i in pressed) for i in range(11)]))

    commands.until(lambda c: c.power, meanwhile=lambda: send(0.0, 7))
    commands.until(lambda c: c.mode == RobotMode.WALK, meanwhile=lambda: send(0.0, 3))
    delays = []
    for index in range(300):
        time.sleep(0.006 + 0.001 * (index % 15))
        vx = 0.2 + 0.8 * index / 300
        begin = time.monotonic()
        send(vx, 4)
        wanted = (vx - 0.1) / 0.9 * 0.8
        commands.until(lambda c, wanted=wanted: abs(c.vx - wanted) < 1e-4)
        delays.append(time.monotonic() - begin)
    delays.sort()
    print(f"stick to command: p50 {1e3 * delays[150]:.1f} ms, p99 {1e3 * delays[-4]:.1f} ms")
    assert delays[150] < 0.04  # waiting for the next tick would take 50 ms
    count = len(commands.all)
    send(1.0)
    commands.until(lambda c: c.vx == 0.0, timeout=1.0)
    with pytest.raises(AssertionError):
        commands.until(lambda c: c.vx != 0.0, timeout=0.2)
    assert all(c.link and c.power for c in commands.all[count:])


def test_bytes_that_are_no_joy_are_as_good_as_silence(node):
    commands = Commands(node)
    joy = node.create_publisher(Joy, "/joy", 10)
    radio = start("rc_teleop", stderr=subprocess.PIPE)
    walking = GOOD.copy()
    walking[2] = 1.0
    good = Joy(axes=walking, buttons=[1, 1])
    raw = serialize_message(good)
    try:
        commands.until(lambda c: c.vx == 1.0, meanwhile=lambda: joy.publish(good))
        for length in range(4, len(raw), 3):
            joy.publish(raw[:length])
            time.sleep(0.005)
        commands.until(lambda c: not c.link)
        commands.until(lambda c: c.vx == 1.0, meanwhile=lambda: joy.publish(good))
    finally:
        end(radio)
    assert b"Traceback" not in radio.stderr.read()


@pytest.mark.parametrize("run", range(5))
def test_ctrl_c_of_rc_teleop_leaves_exactly_one_stop_while_the_radio_goes_on(node, run):
    commands = Commands(node)
    joy = node.create_publisher(Joy, "/joy", 10)
    walking = GOOD.copy()
    walking[2] = 1.0
    radio = start("rc_teleop", "--ros-args", "-p", "rate:=200.0")

    def publish():
        joy.publish(Joy(axes=walking, buttons=[1, 1]))

    commands.until(lambda c: c.vx == 1.0, meanwhile=publish)
    time.sleep(0.003 * run)
    radio.send_signal(signal.SIGINT)
    deadline = time.monotonic() + 90.0
    while radio.poll() is None and time.monotonic() < deadline:
        publish()
        time.sleep(0.001)
    assert radio.wait(timeout=1.0) == 0
    commands.until(lambda c: not c.link)
    with pytest.raises(AssertionError):  # it was the last thing that left
        commands.until(lambda c: True, timeout=0.3)
    assert [bool(c.link) for c in commands.all].count(False) == 1
    assert commands.all[-1].vx == 0.0 and commands.all[-1].power


def test_rc_teleop_refuses_nan_and_says_so_once(node):
    commands, seen = Commands(node), []
    joy = node.create_publisher(Joy, "/joy", 10)
    node.create_subscription(
        DiagnosticArray, "/diagnostics", lambda m: seen.extend(s.message for s in m.status), 10
    )
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    radio = start("rc_teleop", stderr=subprocess.PIPE, text=True)

    def publish(axes):
        joy.publish(Joy(axes=axes, buttons=[1, 1]))
        executor.spin_once(timeout_sec=0)

    commands.until(lambda c: c.link, meanwhile=lambda: publish(GOOD))
    bad = [float("nan"), *GOOD[1:]]
    commands.until(lambda c: not c.link, meanwhile=lambda: publish(bad))
    deadline = time.monotonic() + 10
    while "refused: /joy axis 0 = nan is outside -1 .. 1" not in seen:
        assert time.monotonic() < deadline, seen
        publish(bad)
    executor.shutdown()
    end(radio)
    assert radio.stderr.read().count("axis 0 = nan") == 1


def test_scripted_operator_answers_every_tenth_state_and_repeats_from_the_cache(node, tmp_path):
    script = tmp_path / "script.yaml"
    script.write_text("operator:\n- {t: 0, power: true}\n- {t: 0.04, mode: walk, vx: 0.5}\n")
    commands, states, state = Commands(node), LanePublisher(node, RobotState), RobotState()
    operator = start("scripted_operator", "--ros-args", "-p", f"script:={script}")

    def publish(episode, seq):
        state.episode[...], state.seq[...], state.stamp_ns = episode, seq, seq * 2_000_000
        states.publish(state)

    first = commands.until(lambda c: c.seq == 10, meanwhile=lambda: publish(1, 10))
    assert first.scripted and first.effective_seq == 20 and first.vx == 0.0 and first.power
    second = commands.until(lambda c: c.seq == 20, meanwhile=lambda: publish(1, 20))
    assert second.vx == 0.5 and second.mode == RobotMode.WALK and second.stamp_ns == 40_000_000
    again = commands.until(lambda c: c.seq == 20, meanwhile=lambda: publish(1, 20))
    assert again.to_bytes() == second.to_bytes()
    for seq in range(21, 30):
        publish(1, seq)
    fresh = commands.until(lambda c: c.episode == 2, meanwhile=lambda: publish(2, 0))
    assert fresh.vx == 0.0 and fresh.power
    assert {int(c.seq) % 10 for c in commands.all} == {0}
    end(operator, signal.SIGTERM)


def test_keyboard_drives_and_leaves_exactly_one_stop(node):
    commands = Commands(node)
    master, slave = pty.openpty()
    keyboard = start("keyboard_teleop", stdin=slave, stdout=slave)
    shown = b""
    while b"Ctrl-C" not in shown:  # what is typed before the node listens is dropped
        shown += os.read(master, 4096)
    os.write(master, b"p2www")
    moving = commands.until(lambda c: abs(c.vx - 0.3) < 1e-9)
    assert moving.mode == RobotMode.WALK and moving.power
    vehicle = node.create_publisher(Odometry, "/segway/ground_truth", 10)
    for length in range(4, 400, 9):  # bytes that are no message change nothing
        vehicle.publish(serialize_message(Odometry())[:length])
        time.sleep(0.005)
    commands.until(lambda c: abs(c.vx - 0.3) < 1e-9)
    os.write(master, b"x")
    assert keyboard.wait(timeout=90) == 0
    commands.until(lambda c: not c.link)
    assert [bool(c.link) for c in commands.all[-2:]] == [True, False]
    os.close(master)
    os.close(slave)


def test_answers_of_the_simulator_break_between_words(node):
    def answer(_, response):
        response.message = "the Segway rolls " * 9
        return response

    node.create_service(Reset, "/cassie/reset", answer)
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    master, slave = pty.openpty()
    environment = {**os.environ, "COLUMNS": "60"}
    keyboard = start("keyboard_teleop", stdin=slave, stdout=slave, env=environment)
    os.set_blocking(master, False)
    shown = b""
    deadline = time.monotonic() + 90.0
    while shown.count(b"rolls") < 9:  # the key is repeated until the service has been found
        assert time.monotonic() < deadline
        with contextlib.suppress(BlockingIOError):
            shown += os.read(master, 4096)
        os.write(master, b"z")
        executor.spin_once(timeout_sec=0.2)
    lines = re.sub(r"\x1b\[\d*[A-Z]", "", shown.decode()).splitlines()
    lines = [line.strip() for line in lines if "rolls" in line]
    assert len(lines) > 1 and max(map(len, lines)) < 60
    end(keyboard)
    executor.shutdown()
    os.close(master)
    os.close(slave)


def test_a_closed_terminal_is_a_stop_and_the_end(node):
    commands = Commands(node)
    master, slave = pty.openpty()
    keyboard = start("keyboard_teleop", stdin=slave, stdout=slave, stderr=subprocess.PIPE)
    os.close(slave)
    shown = b""
    while b"Ctrl-C" not in shown:
        shown += os.read(master, 4096)
    os.write(master, b"p2w")
    commands.until(lambda c: abs(c.vx - 0.1) < 1e-9)
    os.close(master)
    _, err = keyboard.communicate(timeout=90)
    assert keyboard.returncode == 1 and b"terminal is gone" in err and b"Traceback" not in err
    commands.until(lambda c: not c.link)


@pytest.mark.parametrize(
    ("name", "arguments", "message"),
    [
        ("scripted_operator", [], "script must be given"),
        ("scripted_operator", ["script:=/nowhere.yaml"], "/nowhere.yaml"),
        ("rc_teleop", ["device:=wheel"], "known by name: gamepad, ps4, ps5, taranis_qx7, xbox"),
        ("rc_teleop", ["device:=/etc/passwd"], "neither a .yaml file that is there, nor known by"),
        ("rc_teleop", ["device:=xbox", "enable_button:=11"], "enable_button = 11: no such button"),
        ("rc_teleop", ["rate:=9000.0"], "rate = 9000 Hz is outside 10 .. 200 Hz"),
        ("keyboard_teleop", [], "the input is no terminal"),
        ("joystick", ["device:=no_such_device"], "joystick"),
    ],
)
def test_a_wrong_start_is_one_line_and_status_2(name, arguments, message):
    ros = [part for argument in arguments for part in ("-p", argument)]
    process = start(
        name, "--ros-args", *ros, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    _, err = process.communicate(timeout=90)
    assert process.returncode == 2, err
    assert err.startswith(f"{name}: error: ") and message in err and len(err.splitlines()) == 1
