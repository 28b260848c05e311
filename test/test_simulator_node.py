"""The simulator as a process: pacing, bad commands, services, standard topics."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from bringup import Robot
from peer import Peer, damping
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from cassie_gaits.names import JOINTS
from cassie_msgs.layout import MotorCommand, OperatorCommand, Sensors
from cassie_msgs.ros.fast_lane import LanePublisher


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[Robot]:
    parameters = {"scripted_operator": False, "max_rate": 0.0}
    with Robot(tmp_path, simulator=parameters) as robot:
        yield robot


def _run_to(robot: Robot, tick: int) -> None:
    robot.eyes.wait_for(lambda: robot.eyes.tick >= tick, f"tick {tick}")


def test_lockstep_answers_every_tick_once(robot: Robot) -> None:
    robot.start("simulator", duration=1.0)
    with Peer(robot.eyes.node) as peer:
        robot.eyes.wait_for(lambda: not robot.processes.running("simulator"), "its end")
        robot.processes.check("simulator")
        assert sorted(set(peer.answered)) == list(range(500))


@pytest.mark.parametrize("rate", [1000, 2000])
def test_other_control_rates_work(robot: Robot, rate: int) -> None:
    robot.start("simulator", duration=0.2, control_rate=rate)
    with Peer(robot.eyes.node) as peer:
        robot.eyes.wait_for(lambda: not robot.processes.running("simulator"), "its end")
        robot.processes.check("simulator")
        assert peer.answered[-1] == round(0.2 * rate) - 1


def test_broken_lockstep_is_told_and_mends(robot: Robot) -> None:
    eyes = robot.eyes
    robot.start("simulator", command_timeout=1.0)
    with Peer(eyes.node) as peer:
        _run_to(robot, 100)
        peer.answer = lambda sensors, command: False
        eyes.wait_for(
            lambda: eyes.report_since(0.0, "simulator: lockstep", "lockstep_broken"), "the report"
        )
        tick = eyes.tick
        eyes.wait_for(lambda: eyes.tick > tick + 100, "robot time to go on without commands")
        assert eyes.sensors.damping > 0.0
        peer.answer = damping
        eyes.wait_for(lambda: eyes.is_well("simulator: lockstep"), "lock-step again")
        tick = eyes.tick
        _run_to(robot, tick + 100)
        assert eyes.sensors.damping == 0.0


def test_a_command_of_nan_is_refused_once_in_words_and_damps(robot: Robot) -> None:
    eyes = robot.eyes

    def spoil(sensors: Sensors, command: MotorCommand) -> bool:
        damping(sensors, command)
        command.position[3] = np.nan if 200 <= sensors.seq < 400 else 0.0
        return True

    robot.start("simulator", max_rate=1.0)
    with Peer(eyes.node, spoil):
        eyes.wait_for(lambda: 210 <= eyes.tick < 400, "the bad commands")
        eyes.wait_for(lambda: eyes.sensors.damping > 0.0, "damping")
        eyes.wait_for(
            lambda: eyes.report_since(0.0, "simulator: motor_command", "position of left_knee"),
            "the report",
        )
        _run_to(robot, 420)
        assert eyes.sensors.damping == 0.0
        eyes.wait_for(lambda: eyes.is_well("simulator: motor_command"), "the end of it")
    log = robot.processes.log("simulator").read_text()
    assert log.count("must be finite") == 1


def test_power_of_a_person_acts_whatever_else_stands_still(robot: Robot) -> None:
    eyes = robot.eyes
    robot.start("simulator", command_timeout=1.0)
    switch = LanePublisher(eyes.node, OperatorCommand)
    command = OperatorCommand()

    def press(on: bool) -> bool:
        command.power[...] = on
        switch.publish(command)
        return bool(eyes.sensors.power > 0.0) == on

    with Peer(eyes.node) as peer:
        eyes.wait_for(lambda: eyes.tick > 0 and press(True), "power")
        peer.answer = lambda sensors, command: False
        eyes.wait_for(lambda: press(False), "no power, with nobody answering")
        assert not eyes.sensors.drive_torque.any()


def test_pause_step_and_reset(robot: Robot) -> None:
    eyes = robot.eyes
    robot.start("simulator", max_rate=1.0)
    with Peer(eyes.node):
        _run_to(robot, 50)
        assert not robot.call("step", ticks=3).success
        assert robot.call("pause", data=True).success
        paused_at = robot.call("step", ticks=1).seq
        assert robot.call("step", ticks=20).seq == paused_at + 20
        answer = robot.call("step", ticks=0)
        assert not answer.success
        assert "outside 1" in answer.message
        episode = eyes.episode
        answer = robot.call("reset", start="gantry", seed=5)
        assert answer.success
        assert answer.episode == episode + 1
        eyes.wait_for(lambda: eyes.episode == episode + 1 and eyes.tick == 0, "tick 0")
        eyes.wait_for(lambda: eyes.height() > 1.1, "the start on the gantry")
        assert robot.call("pause", data=False).success
        _run_to(robot, 50)
        answer = robot.call("reset", start="moon")
        assert not answer.success
        assert "gantry, standing" in answer.message


def test_push_and_gantry(robot: Robot) -> None:
    eyes = robot.eyes
    robot.start("simulator", start="gantry", max_rate=1.0)
    with Peer(eyes.node):
        _run_to(robot, 20)
        assert robot.call("push", force=[0.0, 150.0, 0.0], duration=0.3).success
        eyes.wait_for(lambda: eyes.position()[1] > 0.02, "the pelvis to move to the left")
        answer = robot.call("push", body="wing", force=[1.0, 0.0, 0.0], duration=0.1)
        assert not answer.success
        assert "wing" in answer.message
        assert robot.call("gantry", action="lower", height=1.0, speed=0.5).success
        eyes.wait_for(lambda: eyes.height() < 1.05, "the pelvis to come down")
        assert not robot.call("gantry", action="fly").success
        assert robot.call("gantry", action="release").success
        eyes.wait_for(lambda: eyes.height() < 0.5, "the robot on the ground")


def test_standard_topics(robot: Robot) -> None:
    eyes = robot.eyes
    clocks: list[Clock] = []
    joints: list[JointState] = []
    descriptions: list[String] = []
    eyes.node.create_subscription(Clock, "/clock", clocks.append, 1000)
    eyes.node.create_subscription(JointState, "/joint_states", joints.append, 10)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    eyes.node.create_subscription(String, "/robot_description", descriptions.append, latched)
    robot.start("simulator", max_rate=0.5)
    with Peer(eyes.node):
        eyes.wait_for(lambda: len(clocks) > 20 and len(joints) > 20 and descriptions, "all three")
    assert set(joints[-1].name) == set(JOINTS)
    assert len(joints[-1].position) == len(JOINTS)
    times = [clock.clock.sec * 10**9 + clock.clock.nanosec for clock in clocks]
    # On a busy machine one may get lost on the way here, or be repeated.
    steps = {later - earlier for earlier, later in itertools.pairwise(times)} - {0}
    assert min(steps) == 10**7
    assert {step % 10**7 for step in steps} == {0}
    assert "<robot" in descriptions[0].data
    assert '"package://cassie_sim/meshes/pelvis.stl"' in descriptions[0].data


def test_a_film_is_made_or_the_missing_package_named(robot: Robot, tmp_path: Path) -> None:
    film = tmp_path / "film.gif"
    robot.start("simulator", duration=0.2, video=str(film))
    with Peer(robot.eyes.node):
        robot.eyes.wait_for(lambda: not robot.processes.running("simulator"), "its end")
        robot.processes.check("simulator")
    log = robot.processes.log("simulator").read_text()
    assert film.is_file() or "libegl1" in log
    if film.is_file():
        assert film.read_bytes()[:3] == b"GIF"
