"""Nodes as processes: how they end, and how they refuse to start."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from cassie_msgs.ros.process import BESIDE_THE_LOOP

FOLDER = Path(__file__).parent


def start(script, *arguments):
    return subprocess.Popen(
        [sys.executable, str(FOLDER / script), *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_node_cleanly(number):
    process = start("pick_node.py")
    assert process.stdout.readline().startswith("ready")
    began = time.monotonic()
    process.send_signal(number)
    out, err = process.communicate(timeout=10)
    assert time.monotonic() - began < 2.0
    assert (process.returncode, out.strip(), err) == (0, "closed", "")


@pytest.mark.parametrize(
    ("argument", "message"),
    [
        ("kp_knee:=9000.0", "kp_knee = 9000 Nm/rad is outside 0 .. 2000 Nm/rad"),
        ("kp_knee:=soft", "kp_knee = 'soft' is not a number"),
        ("kp_knee:=.nan", "kp_knee = nan Nm/rad is outside"),
        ("grade:=perfect", "grade = 'perfect' is not one of ideal, faithful"),
        ("trims:=[0.0]", "is not a list of 2 numbers"),
        ("control_rate:=300", "control_rate = 300 Hz: must divide 2000"),
        ("kp_nee:=3.0", "unknown parameter kp_nee: did you mean kp_knee?"),
    ],
)
def test_a_wrong_parameter_is_one_line_and_status_2(argument, message):
    process = start("pick_node.py", "--ros-args", "-p", argument)
    _, err = process.communicate(timeout=20)
    assert process.returncode == 2
    assert err.startswith("picked: error: ") and message in err
    assert len(err.splitlines()) == 1


def test_a_command_line_ros_cannot_read_is_refused_without_a_traceback():
    process = start("pick_node.py", "--ros-args", "-p", "kp_knee=3")
    _, err = process.communicate(timeout=20)
    assert process.returncode == 2
    assert "picked: error: " in err and "kp_knee=3" in err and "Traceback" not in err


def test_a_bug_in_a_callback_ends_the_node_with_status_1():
    process = start("pick_node.py", "--break")
    _, err = process.communicate(timeout=20)
    assert process.returncode == 1 and "broken on request" in err


@pytest.mark.skipif(
    not Path("/proc/self/autogroup").is_file(), reason="the kernel does not group sessions"
)
def test_a_node_beside_the_loop_gives_way_as_a_session_too():
    process = subprocess.Popen(
        [sys.executable, str(FOLDER / "pick_node.py"), "--nice"],
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        assert process.stdout.readline().startswith("ready")
        group = Path(f"/proc/{process.pid}/autogroup").read_text(encoding="ascii")
        niceness = min(19, os.nice(0) + BESIDE_THE_LOOP)  # these tests may be nice themselves
        assert group.split()[-2:] == ["nice", str(niceness)]
    finally:
        process.terminate()
        process.wait(timeout=10)


def test_a_node_stops_while_it_publishes_without_a_pause():
    process = start("lane_echo.py")
    time.sleep(0.1)  # whenever it comes, also while the node starts
    process.terminate()
    _, err = process.communicate(timeout=10)
    assert process.returncode in (0, -signal.SIGTERM) and "Traceback" not in err
