"""All nodes: they start in any order, run without a gap, end cleanly, and refuse what is wrong."""

from __future__ import annotations

import signal
import subprocess
import time
from pathlib import Path

import pytest
from bringup import PACKAGES, TIMEOUT, Robot, took
from rclpy.qos import QoSProfile, ReliabilityPolicy

from cassie_bags.errors import RunError
from cassie_bags.ros.processes import environment, executable, own_domain
from cassie_msgs.layout import ControllerStatus, Mode, MotorCommand, OperatorCommand, RobotState
from cassie_msgs.ros.fast_lane import LaneSubscription

END_LIMIT = 2.0
"""Wall time in which a node ends after Ctrl-C. In s."""


def test_a_run_has_no_gap_on_any_topic_of_the_lane(tmp_path: Path) -> None:
    ticks = 400
    with Robot(tmp_path, simulator={"duration": ticks / 500, "paused": True}) as robot:
        node = robot.eyes.node
        every = {RobotState: 1, MotorCommand: 1, Mode: 10, OperatorCommand: 10, ControllerStatus: 5}
        deep = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
        topics = {kind: LaneSubscription(node, kind, qos=deep) for kind in every}
        seqs: dict[type, set[int]] = {kind: set() for kind in every}
        robot.start()

        def heard_all() -> bool:
            for kind, topic in topics.items():
                sample = kind()
                while topic.take_next(sample):
                    seqs[kind].add(int(sample.seq))
            return all(seqs.values())

        robot.eyes.wait_for(heard_all, "a first message on every topic")
        assert robot.call("pause", data=False).success
        robot.eyes.wait_for(
            lambda: heard_all() and not robot.processes.running("simulator"), "the end"
        )
        robot.eyes.wait_for(heard_all, "the last messages")
        robot.processes.check("simulator")
        for kind, period in every.items():
            assert seqs[kind] == set(range(0, ticks, period)), kind.__name__


def test_nodes_that_start_last_to_first_find_each_other(tmp_path: Path) -> None:
    with Robot(tmp_path) as robot:
        for name in reversed(PACKAGES):
            robot.start(name)
        eyes = robot.eyes
        eyes.wait_for(lambda: eyes.mode == "stand" and not eyes.faults, "standing")
        eyes.wait_for(lambda: eyes.tick > 500, "a second of robot time")
        assert robot.stands()
        assert eyes.is_well("simulator: lockstep")


def test_ctrl_c_ends_every_node_soon_and_without_words(tmp_path: Path) -> None:
    with Robot(tmp_path, simulator={"max_rate": 1.0}) as robot:
        robot.start()
        robot.eyes.wait_for(lambda: robot.eyes.tick > 100, "the loop to run")
        for name in PACKAGES:
            started = time.monotonic()
            robot.processes.signal(name, signal.SIGINT)
            robot.eyes.wait_for(lambda name=name: not robot.processes.running(name), name)
            assert took(started, time.monotonic()) < END_LIMIT, name
        robot.processes.check(*PACKAGES)
        for name in PACKAGES:
            log = robot.processes.log(name).read_text()
            assert "Traceback" not in log, log
            assert "rror:" not in log, log


WRONG = [
    ("simulator", {"control_rate": 300}, ["control_rate = 300", "2000 Hz"]),
    ("simulator", {"control_rate": 9000}, ["control_rate = 9000", "50 .. 4000 Hz"]),
    ("simulator", {"scene": "moon"}, ["moon", "flat"]),
    ("simulator", {"pacing": "slow"}, ["pacing = 'slow'", "lockstep, realtime"]),
    ("simulator", {"sedd": 3}, ["sedd", "seed"]),
    ("simulator", {"scenario": "/nowhere.yaml"}, ["/nowhere.yaml"]),
    ("simulator", {"video": "film.txt"}, ["film.txt", ".mp4"]),
    ("simulator", {"headless": False}, ["headless = false", "DISPLAY"]),
    ("state_estimator", {"load_span": -1.0}, ["load_span = -1 N", "1 .. 400 N"]),
    ("gait_controller", {"gait_library": "/nowhere.json"}, ["/nowhere.json"]),
    ("gait_controller", {"walk.joints.kp_knee": 9e3}, ["kp_knee = 9000 Nm/rad", "0 .. 2000"]),
    ("mode_supervisor", {"vx_forward": "fast"}, ["vx_forward", "fast"]),
    ("scripted_operator", {"script": "/nowhere.yaml"}, ["/nowhere.yaml"]),
]


@pytest.mark.parametrize("batch", [WRONG[:7], WRONG[7:]], ids=["first half", "second half"])
def test_a_wrong_parameter_ends_a_node_with_one_line(
    batch: list[tuple[str, dict[str, object], list[str]]],
) -> None:
    with own_domain() as domain:
        runs = []
        for name, parameters, words in batch:
            command = [str(executable(PACKAGES[name], name)), "--ros-args"]
            for key, value in parameters.items():
                command += ["-p", f"{key}:={value}"]
            process = subprocess.Popen(
                command,
                env=environment(domain) | {"DISPLAY": "", "WAYLAND_DISPLAY": ""},
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
            )
            runs.append((process, command, words))
        try:
            for process, command, words in runs:
                _, errors = process.communicate(timeout=TIMEOUT)
                assert process.returncode not in (0, None), command
                assert len(errors.strip().splitlines()) == 1, errors
                for word in words:
                    assert word in errors, command
        finally:
            for process, _, _ in runs:
                process.kill()


def test_a_node_made_for_another_rate_says_so_and_ends(tmp_path: Path) -> None:
    parameters = {"simulator": {"scripted_operator": False}, "state_estimator": {}}
    with Robot(tmp_path, **parameters) as robot:
        robot.start("simulator", command_timeout=0.1, start_timeout=0.5)
        robot.start("state_estimator", control_rate=1000)
        running = robot.processes.running
        robot.eyes.wait_for(lambda: not running("state_estimator"), "its end")
        with pytest.raises(RunError, match=r"exit code 2: .*control_rate = 1000 Hz.* 500 Hz"):
            robot.processes.check()
