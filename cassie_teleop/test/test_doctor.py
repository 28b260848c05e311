"""The doctor: which facts make which finding, in which order; and the program beside real nodes."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace

import pytest
import rclpy
from std_msgs.msg import Empty

from cassie_msgs.layout import Sensors
from cassie_msgs.ros.fast_lane import LanePublisher
from cassie_teleop.doctor import (
    ERROR,
    LANE,
    NOTE,
    WARNING,
    End,
    Facts,
    as_json,
    exit_code,
    findings,
    report,
)
from cassie_teleop.ros.doctor import Doctor, joysticks

DRIVEN = (*LANE.items(), ("/cassie/operator_command", "web_console"))
HEALTHY = Facts(
    domain=0,
    nodes=tuple(f"/{node}" for _, node in DRIVEN),
    ends=tuple(End(topic=topic, node=f"/{node}", type="t", writes=True) for topic, node in DRIVEN),
    rates=dict.fromkeys(("/cassie/sensors", "/cassie/state", "/cassie/motor_command"), 500.0),
    real_time_factor=1.0,
    mode="stand",
    disk={"/": 1e11},
)


def without(topic):
    return replace(HEALTHY, ends=tuple(end for end in HEALTHY.ends if end.topic != topic))


def beside(topic, **changes):
    end = End(**{"topic": topic, "node": "/other", "type": "t", "writes": True} | changes)
    return replace(HEALTHY, ends=(*HEALTHY.ends, end))


def test_a_healthy_robot_has_no_findings():
    assert findings(HEALTHY) == []
    assert exit_code([]) == 0
    assert report(HEALTHY, []).endswith("nothing is wrong")


@pytest.mark.parametrize(
    ("facts", "level", "words"),
    [
        (Facts(domain=3), ERROR, "no node of the robot runs in domain 3"),
        (Facts(domain=3, other_domains=(7,)), ERROR, "export ROS_DOMAIN_ID=7"),
        (without("/cassie/sensors"), ERROR, "ros2 run cassie_sim simulator"),
        (without("/cassie/mode"), ERROR, "ros2 run cassie_control mode_supervisor"),
        (
            replace(without("/cassie/mode"), held=("mode_supervisor",)),
            ERROR,
            "it runs, but hangs or was stopped: pkill -KILL -f /mode_supervisor, then start it",
        ),
        (without("/cassie/operator_command"), NOTE, "nobody drives"),
        (
            replace(
                without("/cassie/operator_command"),
                faults=("operator lost: stopping and standing",),
                diagnostics=(
                    (2, "mode_supervisor: o", "operator lost: stopping and standing"),
                    (2, "mode_supervisor: operator", "no operator commands any more"),
                ),
            ),
            NOTE,
            "nobody drives",
        ),
        (beside("/cassie/motor_command"), ERROR, "/gait_controller, /other write"),
        (
            replace(beside("/joy"), ends=2 * beside("/joy").ends[-1:] + HEALTHY.ends),
            WARNING,
            "/joy",
        ),
        (beside("/joy", writes=False), WARNING, "nobody writes /joy"),
        (beside("/cassie/mode", writes=False, latched=True), WARNING, "volatile offered"),
        (beside("/cassie/mode", writes=False, type="u"), WARNING, "t is written, u read"),
        (replace(HEALTHY, nodes=(*HEALTHY.nodes, "/simulator")), WARNING, "2 nodes are called"),
        (replace(HEALTHY, rates={}), ERROR, "/cassie/sensors: is silent"),
        (replace(HEALTHY, rates={}, paused=True), NOTE, "is paused"),
        (
            replace(HEALTHY, rates=HEALTHY.rates | {"/cassie/state": 300.0}),
            ERROR,
            "/cassie/state: 300/s where the sensors have 500/s",
        ),
        (replace(HEALTHY, missed_share=0.02), ERROR, "missed ticks: 2.0 %"),
        (replace(HEALTHY, real_time_factor=0.6), WARNING, "robot time goes at 0.60"),
        (replace(HEALTHY, clock_differences={"pad-1": -3.0}), WARNING, "pad-1 are -3.0 s off"),
        (replace(HEALTHY, discovery="OFF"), ERROR, "discovery: is off"),
        (replace(HEALTHY, discovery="SUBNET"), NOTE, "other computers see and command"),
        (replace(HEALTHY, domain=150), WARNING, "domain: 150 uses ports"),
        (replace(HEALTHY, faults=("fallen",)), ERROR, "cut the power, hang it up"),
        (replace(HEALTHY, faults=("no power: stopped by x",)), ERROR, "switches power off and on"),
        (
            replace(HEALTHY, diagnostics=((2, "m: operator", "no operator commands any more"),)),
            ERROR,
            "drive again: Drive on the page",
        ),
        (replace(HEALTHY, diagnostics=((1, "radio: x", "silent"),)), WARNING, "radio: x: silent"),
        (replace(HEALTHY, diagnostics=((2, "radio: x", "broken"),)), ERROR, "the log of radio"),
        (
            replace(HEALTHY, diagnostics=((1, "c: g", "no answer: is gait_optimizer running?"),)),
            WARNING,
            "start it: ros2 run cassie_gaits gait_optimizer",
        ),
        (replace(HEALTHY, readiness="hold still"), NOTE, "not entered: hold still"),
        (replace(HEALTHY, changed=(("simulator", "seed", 3, 0),)), NOTE, "seed = 3, default 0"),
        (
            replace(HEALTHY, files=(("gait library", "/x.json", False),)),
            ERROR,
            "/x.json is missing",
        ),
        (replace(HEALTHY, joysticks=(("/dev/input/js0", False),)), WARNING, "usermod -aG input"),
        (replace(HEALTHY, disk={"/": 5e7}), ERROR, "disk: / has 50 MB left"),
        (replace(HEALTHY, disk={"/": 1e9}), WARNING, "disk: / has 1000 MB left"),
    ],
)
def test_each_wrong_fact_is_one_finding_with_what_to_do(facts, level, words):
    found = findings(facts)
    assert [each.level for each in found] == [level]
    assert words in report(facts, found).replace("\n", " ").replace("        ", " ")
    assert found[0].advice
    assert exit_code(found) == (level != NOTE)


def test_a_reliable_reader_of_a_best_effort_writer_gets_nothing():
    reader = End(topic="/joy", node="/rc_teleop", type="t", writes=False)
    writer = End(topic="/joy", node="/pad", type="t", writes=True, reliable=False)
    (finding,) = findings(replace(HEALTHY, ends=(*HEALTHY.ends, reader, writer)))
    assert "/rc_teleop gets nothing from /pad: reliable is asked for" in finding.problem


def test_the_heaviest_comes_first_and_a_fault_is_not_told_twice():
    facts = replace(
        HEALTHY,
        changed=(("simulator", "seed", 3, 0),),
        real_time_factor=0.5,
        faults=("fallen",),
        diagnostics=((2, "mode_supervisor: posture", "fallen"),),
    )
    found = findings(facts)
    assert [each.level for each in found] == [ERROR, WARNING, NOTE]
    text = report(facts, found)
    assert text.index("ERROR") < text.index("WARNING") < text.index("NOTE")
    assert text.endswith("1 error, 1 warning, 1 note")
    told = json.loads(json.dumps(as_json(facts, found)))
    assert told["exit_code"] == 1 and told["findings"][0]["subject"] == "fault"
    assert told["facts"]["real_time_factor"] == 0.5


def test_the_device_that_the_joystick_node_opens_is_examined(tmp_path):
    """SDL opens event devices. Everyone may read the js device of the same pad."""
    (tmp_path / "class" / "js0" / "device" / "event7").mkdir(parents=True)
    (tmp_path / "class" / "js1" / "device" / "event8").mkdir(parents=True)  # of another container
    device = tmp_path / "event7"
    device.touch(mode=0)
    (name, readable), *others = joysticks(tmp_path / "class", tmp_path)
    assert (name, others) == (str(device), [])
    assert readable == os.access(device, os.R_OK)


def doctor(*words):
    code = "from cassie_teleop.ros.doctor import main; main()"
    return subprocess.run(
        [sys.executable, "-c", code, *words], capture_output=True, text=True, timeout=90
    )


def test_without_a_robot_it_says_so_and_ends_with_1():
    done = doctor("--seconds", "0.5")
    assert (done.returncode, done.stderr) == (1, "")
    assert done.stdout.startswith("ERROR   nodes: no node of the robot runs in domain ")


@pytest.mark.parametrize("words", [("--nonsense",), ("--seconds", "0"), ("--seconds", "nan")])
def test_a_wrong_command_line_ends_with_2(words):
    done = doctor(*words)
    assert done.returncode == 2 and "Traceback" not in done.stderr


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, -15)])
def test_it_ends_by_a_signal_without_a_word(node, number, status):
    code = "from cassie_teleop.ros.doctor import main; main()"
    looking = subprocess.Popen(
        [sys.executable, "-c", code, "--seconds", "60"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 60.0
    while "doctor" not in node.get_node_names():
        assert time.monotonic() < deadline
        time.sleep(0.05)
    looking.send_signal(number)
    assert looking.communicate(timeout=90) == ("", "")
    assert looking.returncode == status


def test_it_sees_writers_rates_and_a_silent_controller(node):
    sensors, sample = LanePublisher(node, Sensors), Sensors()
    other = node.create_publisher(Empty, "/joy", 10)  # of another type than rc_teleop wants
    rc = [sys.executable, "-c", "from cassie_teleop.ros.rc_teleop import main; main()"]
    radio = subprocess.Popen([*rc, "--ros-args", "-p", "rate:=60.0"])
    begin = time.monotonic()
    while not node.count_subscribers("/joy") and time.monotonic() < begin + 60.0:
        time.sleep(0.05)
    code = "from cassie_teleop.ros.doctor import main; main()"
    looking = subprocess.Popen(
        [sys.executable, "-c", code, "--json", "--seconds", "2"],
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"},
    )
    try:
        seq = 0
        while looking.poll() is None:
            seq += 1
            sample.seq[...], sample.stamp_ns = seq, seq * 10_000_000
            sensors.publish(sample)
            with pytest.raises(subprocess.TimeoutExpired):
                looking.wait(0.01)
                raise subprocess.TimeoutExpired("it has ended", 0)
        told = json.loads(looking.stdout.read())
    finally:
        looking.kill()
        radio.kill()
        node.destroy_publisher(other)
    assert told["exit_code"] == looking.returncode == 1
    assert 20.0 < told["facts"]["rates"].get("/cassie/sensors", 0.0) < 110.0, told
    subjects = {each["subject"] for each in told["findings"]}
    assert {"state_estimator", "gait_controller", "QoS of /joy"} <= subjects
    assert "simulator" not in subjects


def test_rates_are_those_at_which_messages_were_written_not_read(node):
    sensors, sample = LanePublisher(node, Sensors), Sensors()
    rclpy.init()
    doctor = Doctor()
    try:
        begin = time.monotonic()
        while not (doctor.count_publishers("/cassie/sensors") and sensors.matched):
            assert time.monotonic() < begin + 60.0
            time.sleep(0.05)
        written = []
        for seq, waits in ((1, 0.0), (51, 1.0)):  # the second waits in the reader
            sample.seq[...], sample.stamp_ns = seq, seq * 10_000_000
            sensors.publish(sample)
            written.append(time.monotonic())
            time.sleep(waits)
            while len(doctor._heads["/cassie/sensors"]) < len(written):
                rclpy.spin_once(doctor, timeout_sec=0.1)
            time.sleep(0.5)
        rate = doctor.facts().rates["/cassie/sensors"]
        assert rate == pytest.approx(50.0 / (written[1] - written[0]), rel=0.05)
    finally:
        doctor.destroy_node()
        rclpy.shutdown()


def test_a_writer_that_is_found_late_is_waited_for(node):
    sensors, sample = LanePublisher(node, Sensors), Sensors()
    heard = threading.Event()

    def write():
        time.sleep(1.0)
        while not heard.wait(0.01):
            sample.seq[...], sample.stamp_ns = sample.seq + 1, sample.stamp_ns + 10_000_000
            sensors.publish(sample)

    rclpy.init()
    writer, doctor = threading.Thread(target=write), Doctor()
    writer.start()
    try:
        doctor.listen(0.5)
        assert doctor.facts().rates["/cassie/sensors"] > 0.0
    finally:
        heard.set()
        writer.join()
        doctor.destroy_node()
        rclpy.shutdown()
