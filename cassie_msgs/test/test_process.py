"""Nodes as processes: how they end, and how they refuse to start."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from cassie_msgs.ros.process import LEAVE_TIMEOUT, own_arguments
from cassie_msgs.ros.scheduling import BESIDE_NICENESS, BESIDE_PRIORITY

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
    out, err = process.communicate(timeout=90)
    assert time.monotonic() - began < 2.0
    assert (process.returncode, out.strip(), err) == (0, "closed", "")


def test_a_node_that_middleware_holds_up_at_its_end_ends_all_the_same():
    process = start("pick_node.py", "--stuck")
    assert process.stdout.readline().startswith("ready")
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=LEAVE_TIMEOUT + 5)
    assert (process.returncode, out.strip(), err) == (0, "closed", "")


def test_a_node_that_middleware_holds_up_as_it_is_refused_ends_all_the_same():
    process = start("pick_node.py", "--stuck", "--ros-args", "-p", "kp_knee:=9000.0")
    _, err = process.communicate(timeout=LEAVE_TIMEOUT + 10)
    assert (process.returncode, err.count("\n")) == (2, 1)


@pytest.mark.parametrize(
    ("argument", "message"),
    [
        ("kp_knee:=9000.0", "kp_knee = 9000 Nm/rad is outside 0 .. 2000 Nm/rad"),
        ("kp_knee:=soft", "kp_knee = 'soft' is not a number"),
        ("kp_knee:=.nan", "kp_knee = nan Nm/rad is outside"),
        ("grade:=perfect", "grade = 'perfect' is not one of ideal, faithful"),
        ("grade:=7", """it needs quotes within quotes, -p grade:="'7'\""""),
        ("grade:='7'", "grade = '7' is not one of ideal, faithful"),
        ("trims:=[0.0]", "is not a list of 2 numbers"),
        ("control_rate:=300", "control_rate = 300 Hz: must divide 2000"),
        ("kp_nee:=3.0", "unknown parameter kp_nee: did you mean kp_knee?"),
    ],
)
def test_a_wrong_parameter_is_one_line_and_status_2(argument, message):
    process = start("pick_node.py", "--ros-args", "-p", argument)
    _, err = process.communicate(timeout=90)
    assert process.returncode == 2
    assert err.startswith("picked: error: ") and message in err
    assert len(err.splitlines()) == 1


def test_a_command_line_ros_cannot_read_is_refused_without_a_traceback():
    process = start("pick_node.py", "--ros-args", "-p", "kp_knee=3")
    _, err = process.communicate(timeout=90)
    assert process.returncode == 2
    assert "picked: error: " in err and "kp_knee=3" in err and "Traceback" not in err


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (None, "Error opening YAML file"),
        ("a: [", "Sequences can only be values and not keys in params. Error at line 1"),
        ("a:\n  b: 1\n", "Cannot have a value before ros__parameters at line 2"),
    ],
)
def test_a_parameter_file_that_ros_cannot_read_is_named_with_the_reason(
    tmp_path, text, reason, monkeypatch, capfd
):
    path = tmp_path / "file.yaml"
    if text is not None:
        path.write_text(text)
    monkeypatch.setattr(sys, "argv", ["node", "--ros-args", "--params-file", str(path)])
    with pytest.raises(SystemExit) as ended:
        own_arguments("node")
    assert ended.value.code == 2
    (line,) = (line for line in capfd.readouterr().err.splitlines() if line.startswith("node: "))
    assert str(path) in line and line.endswith(f": {reason}")


def test_a_bug_in_a_callback_ends_the_node_with_status_1():
    process = start("pick_node.py", "--break")
    _, err = process.communicate(timeout=90)
    assert process.returncode == 1 and "broken on request" in err


@pytest.mark.skipif(
    not Path("/proc/self/autogroup").is_file(), reason="the kernel does not group sessions"
)
def test_a_node_beside_the_loop_gives_way_as_a_session_too():
    process = subprocess.Popen(
        [sys.executable, str(FOLDER / "pick_node.py"), "--lockstep"],
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        assert process.stdout.readline().startswith("ready")
        group = Path(f"/proc/{process.pid}/autogroup").read_text(encoding="ascii")
        assert group.split()[-2:] == ["nice", str(BESIDE_NICENESS)]
        assert os.getpriority(os.PRIO_PROCESS, process.pid) == BESIDE_NICENESS
    finally:
        process.terminate()
        process.wait(timeout=90)


def policies(pid):
    threads = [int(entry.name) for entry in Path(f"/proc/{pid}/task").iterdir()]
    return {(os.sched_getscheduler(t), os.sched_getparam(t).sched_priority) for t in threads}


def test_paced_by_the_wall_clock_every_thread_is_real_time_or_the_node_says_what_to_do(real_time):
    process = start("pick_node.py", "--realtime", "--realtime")
    try:
        assert process.stdout.readline().startswith("ready")
        if real_time:
            assert policies(process.pid) == {(os.SCHED_FIFO, BESIDE_PRIORITY)}
    finally:
        process.terminate()
        _, err = process.communicate(timeout=90)
    assert err.count("no real-time scheduling") <= (0 if real_time else 1)


def test_without_permission_the_node_runs_on_and_says_once_what_to_do(real_time):
    if not real_time or shutil.which("setpriv") is None:
        pytest.skip("has no permission to take away")
    process = subprocess.Popen(
        [
            *("setpriv", "--inh-caps=-sys_nice", "--bounding-set=-sys_nice", sys.executable),
            *(str(FOLDER / "pick_node.py"), "--realtime", "--realtime"),
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    ready = process.stdout.readline()
    process.terminate()
    _, err = process.communicate(timeout=90)
    assert ready.startswith("ready"), err
    assert err.count("no real-time scheduling (Operation not permitted)") == 1
    assert "rtprio 60" in err


def test_a_node_stops_while_it_publishes_without_a_pause():
    process = start("lane_echo.py")
    time.sleep(0.1)  # whenever it comes, also while the node starts
    process.terminate()
    _, err = process.communicate(timeout=90)
    assert process.returncode in (0, -signal.SIGTERM) and "Traceback" not in err
