"""`ros2 run cassie_bags robot`, driven with the keys of `keyboard_teleop` as the README says."""

from __future__ import annotations

import os
import pty
import re
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from bringup import Eyes

from cassie_bags.cli.robot import _parser
from cassie_bags.ros.processes import environment, executable, own_domain
from cassie_bags.ros.robot import console_address, node_commands
from cassie_msgs.ros.process import Stop

TIMEOUT = 90.0


class Screen:
    """A program in a terminal of 80 columns: what it has shown, and its keys."""

    def __init__(self, program: Path, domain: int) -> None:
        self._master, slave = pty.openpty()
        self.process = subprocess.Popen(
            [program], stdin=slave, stdout=slave, env=environment(domain), start_new_session=True
        )
        os.close(slave)
        self.shown = ""

    def look(self) -> str:
        """The newest status lines."""
        while select.select([self._master], [], [], 0.0)[0]:
            self.shown += os.read(self._master, 4096).decode()
        return self.shown.rpartition("\x1b[J")[2]

    def type(self, keys: str) -> None:
        """Press keys."""
        os.write(self._master, keys.encode())

    def __enter__(self) -> Screen:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.terminate()
        self.process.wait(TIMEOUT)
        os.close(self._master)


class Starter:
    """The command in a domain of its own."""

    def __init__(self, folder: Path, domain: int, *arguments: str) -> None:
        self.logs = folder / "logs"
        self.process = subprocess.Popen(
            [executable("cassie_bags", "robot"), "--logs", self.logs, *arguments],
            env=environment(domain),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            # As a shell starts what it runs in the background.
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN),
        )

    def __enter__(self) -> Starter:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.end()

    def ready(self) -> str:
        """Wait until it says that the robot can be driven, and how it stands there."""
        assert self.process.stdout is not None
        for line in self.process.stdout:
            if "ready" in line:
                return line
        raise AssertionError(f"it is never ready: {self.process.communicate()[1]}")

    def end(self) -> tuple[int, str]:
        """Press Ctrl-C; returns the exit code and what it said as error."""
        self.process.send_signal(signal.SIGINT)
        _, errors = self.process.communicate(timeout=TIMEOUT)
        return self.process.returncode, errors


@pytest.fixture
def domain() -> Iterator[int]:
    with own_domain() as number:
        yield number


def nodes_of(logs: Path) -> list[str]:
    """Processes whose output goes into a folder."""
    found = []
    for entry in Path("/proc").glob("[0-9]*/fd/1"):
        try:
            if entry.resolve().parent == logs.resolve():
                found.append((entry.parents[1] / "comm").read_text().strip())
        except OSError:
            continue
    return found


def process_of(logs: Path, name: str) -> int:
    """Number of the process whose output goes into the log of a name."""
    for entry in Path("/proc").glob("[0-9]*/fd/1"):
        try:
            if entry.resolve() == (logs / f"{name}.log").resolve():
                return int(entry.parents[1].name)
        except OSError:
            continue
    raise AssertionError(f"{name} does not run")


def test_it_starts_the_robot_and_one_ctrl_c_ends_all(tmp_path: Path, domain: int) -> None:
    with Starter(tmp_path, domain) as starter:
        assert "hangs in the gantry" in starter.ready()
        assert len(nodes_of(starter.logs)) == 4
        assert starter.end() == (0, "")
    assert nodes_of(starter.logs) == []
    assert {log.stem for log in starter.logs.glob("*.log")} == {
        *("simulator", "state_estimator", "gait_controller", "mode_supervisor")
    }


CTRL_C_AS_IT_BEGINS_TO_WAIT = """
import signal, sys, threading
from cassie_bags.cli.robot import main
from cassie_bags.ros import robot

def trace(frame, event, _):
    if frame.f_code is threading.Condition.wait.__code__ and said and said.pop():
        signal.raise_signal(signal.SIGINT)

said, say = [], robot._say
def said_and_traced(text):
    say(text)
    if "ready" in text:
        said.append(text)
        sys.settrace(trace)
robot._say = said_and_traced
sys.exit(main())
"""


class SlowConsole:
    """Processes of which the console is the last one to come up."""

    def __init__(self, folder: Path) -> None:
        self._log, self._checks = folder / "web_console.log", 0
        self._log.write_text("")

    def log(self, name: str) -> Path:
        """File of a process's output."""
        assert name == "web_console"
        return self._log

    def check(self) -> None:
        """Go on by one check, at the third of which the console listens."""
        self._checks += 1
        if self._checks == 3:
            self._log.write_text("web_console: open http://127.0.0.1:8080/?token=abc\n")


def test_it_waits_for_the_address_of_a_console_that_comes_up_last(tmp_path: Path) -> None:
    """It printed "web_console starts" in place of the address."""
    processes: Any = SlowConsole(tmp_path)
    assert console_address(processes, Stop()) == "http://127.0.0.1:8080/?token=abc"


def test_ctrl_c_as_it_begins_to_wait_ends_it(tmp_path: Path, domain: int) -> None:
    """Its handler waited for the lock that the main thread held, and nothing ended it any more."""
    process = subprocess.Popen(
        [sys.executable, "-c", CTRL_C_AS_IT_BEGINS_TO_WAIT, "--logs", tmp_path / "logs"],
        env=environment(domain),
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        said, _ = process.communicate(timeout=TIMEOUT)
    finally:
        process.kill()
    assert process.returncode == 0
    assert "ready" in said and said.endswith("robot: ended\n")
    assert nodes_of(tmp_path / "logs") == []


def test_a_second_one_does_not_take_the_first_one_for_itself(tmp_path: Path, domain: int) -> None:
    """It had heard the first one's supervisor, said that it was ready, and then ended."""
    with Starter(tmp_path / "first", domain) as first:
        first.ready()
        with Starter(tmp_path / "second", domain) as second:
            said, errors = second.process.communicate(timeout=TIMEOUT)
        assert (second.process.returncode, said) == (2, "")
        assert errors.count("allow_second:=true") == 4  # with fewer it is refused again
        nodes = "gait_controller, mode_supervisor, simulator, state_estimator"
        assert f"another {nodes} runs in ROS domain {domain}" in errors
        assert "start this one with ROS_DOMAIN_ID=" in errors
        assert first.process.poll() is None
        assert first.end() == (0, "")


def test_parameters_are_for_the_nodes_alone(tmp_path: Path, domain: int) -> None:
    with Starter(tmp_path, domain, "-p", "simulator:start:=standing") as starter:
        assert "on its feet" in starter.ready()
        assert starter.end() == (0, "")  # ROS took it for a name to be changed, and said so


def test_a_pad_is_two_nodes_more() -> None:
    commands = node_commands(_parser().parse_args(["--scene", "flat", "--pad", "ps5"]))
    assert [*commands][-2:] == ["joystick", "rc_teleop"]
    assert commands["rc_teleop"][1:] == ["--ros-args", "-p", "device:=ps5"]


def test_a_node_that_ends_is_named_with_its_last_words_and_ends_the_others(
    tmp_path: Path, domain: int
) -> None:
    with Starter(tmp_path, domain, "-p", "state_estimator:control_rate:=400") as starter:
        _, errors = starter.process.communicate(timeout=TIMEOUT)
    assert starter.process.returncode == 1
    assert "state_estimator ended with exit code 2" in errors and "control_rate = 400" in errors
    assert nodes_of(starter.logs) == []


def test_a_node_that_hangs_is_named_and_one_that_is_killed_by_its_signal(
    tmp_path: Path, domain: int
) -> None:
    """A supervisor that hung in DDS was missed by nobody; a kill was told by an older line."""
    with Starter(tmp_path, domain) as starter:
        starter.ready()
        pid = process_of(starter.logs, "mode_supervisor")
        assert starter.process.stdout is not None
        os.kill(pid, signal.SIGSTOP)
        lines = (line for line in starter.process.stdout if "mode_supervisor" in line)
        assert "mode_supervisor runs, but nothing has been heard of it for 5 s" in next(lines)
        os.kill(pid, signal.SIGKILL)
        _, errors = starter.process.communicate(timeout=TIMEOUT)
    assert starter.process.returncode == 1
    assert "mode_supervisor was ended by SIGKILL" in errors


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["-p", "radio:rate:=3"], "-p radio:rate:=3: must be NODE:NAME:=VALUE"),
        (["--scene", "moon"], "unknown scene moon"),
        (["--scene", "gras"], "did you mean grass?"),
    ],
)
def test_wrong_arguments_are_one_line(
    tmp_path: Path, domain: int, arguments: list[str], message: str
) -> None:
    with Starter(tmp_path, domain, *arguments) as starter:
        _, errors = starter.process.communicate(timeout=TIMEOUT)
    assert starter.process.returncode == 2 and message in errors


def seeds() -> range:
    """Robots that ride: one, or as many as CASSIE_RIDES says."""
    return range(1, 1 + int(os.environ.get("CASSIE_RIDES", "1")))


@pytest.mark.parametrize("seed", seeds())
def test_the_ride_of_the_readme_by_keyboard(tmp_path: Path, domain: int, seed: int) -> None:
    arguments = ["--scene", "segway", "-p", f"simulator:seed:={seed}"]
    with (
        Starter(tmp_path, domain, *arguments) as starter,
        Screen(executable("cassie_teleop", "keyboard_teleop"), domain) as screen,
        Eyes(domain) as eyes,
    ):
        starter.ready()

        def until(condition: Callable[[], Any], what: str) -> None:
            eyes.wait_for(lambda: screen.look() is not None and condition(), what, TIMEOUT)

        def speed() -> float:
            found = re.search(r"Segway\s+([-+][\d.]+) m/s", screen.look())
            return float(found[1]) if found else 0.0

        def wait(seconds: float) -> None:
            ended = eyes.tick + round(500 * seconds)
            until(lambda: eyes.tick > ended, "time to pass")

        until(lambda: "Ctrl-C" in screen.shown and "off" in screen.look(), "the keyboard")
        screen.type("p" + 13 * "f")
        until(lambda: eyes.mode == "stand", "power")
        wait(2.0)
        screen.type("n")
        until(lambda: "lets go" in screen.shown and eyes.height() < 0.9, "the platform")
        wait(2.0)
        screen.type("3")
        until(lambda: eyes.mode == "segway", "mode segway")
        wait(14.0)  # after the 12 s in which the bar was let go by itself
        assert abs(speed()) < 0.05
        screen.type("b")
        until(lambda: "nobody holds the bar" in screen.shown, "the bar let go of")
        wait(2.0)
        screen.type("iii")
        until(lambda: speed() > 0.5, "0.5 m/s")
        screen.type("kkkkkk")
        until(lambda: speed() < 0.2, "braking")
        screen.type("b")
        until(lambda: "somebody holds the bar" in screen.shown, "the bar held")
        wait(2.0)
        assert eyes.mode == "segway" and robot_is_up(eyes)
        assert starter.end()[0] == 0


def robot_is_up(eyes: Eyes) -> bool:
    """Whether it crouches on the platform."""
    return eyes.height() > 0.6


def test_the_status_lines_fit_80_columns(domain: int) -> None:
    deadline = time.monotonic() + TIMEOUT
    with Screen(executable("cassie_teleop", "keyboard_teleop"), domain) as screen:
        while "no status from the supervisor" not in screen.look():
            assert time.monotonic() < deadline
            time.sleep(0.05)
        screen.type("§")
        while "does nothing" not in screen.shown:
            screen.look()
            assert time.monotonic() < deadline
            time.sleep(0.05)
        lines = re.sub(r"\x1b\[\w+", "", screen.shown).splitlines()
    assert max(map(len, lines)) <= 80
