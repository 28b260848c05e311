"""A node that is killed: what the others do, who reports it, and how it joins again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bringup import STAND, TIMEOUT, WALK, Robot, took

from cassie_bags.bag.recording import read_recording
from cassie_bags.run.verify import verify
from cassie_msgs.layout import Sensors

REPORT_LIMIT = 1.0
"""Wall time from the end of a node to its report, without stalls of the machine. In s."""

RUNS = [
    pytest.param(pacing, gait, id=f"{gait}-{pacing}")
    for pacing in ("lockstep", "realtime")
    for gait in ("stand", "walk")
]


RATES = {"lockstep": 1.0, "realtime": 0.5}
"""Robot time per wall time: half, where a node that starts on two cores could starve the loop."""


def _robot(folder: Path, pacing: str, gait: str) -> Robot:
    operator = STAND if gait == "stand" else WALK
    simulator: dict[str, object] = {"pacing": pacing, "max_rate": RATES[pacing], "paused": True}
    simulator["command_timeout"] = TIMEOUT  # a node may take its time to start again
    return Robot(folder, operator, simulator=simulator)


def _bring_up(robot: Robot, gait: str) -> None:
    """Wait until Cassie stands or walks, with everybody taking part."""
    eyes = robot.eyes
    eyes.wait_for(lambda: eyes.mode == gait and not eyes.faults, f"mode {gait} without faults")
    ticks = eyes.tick + 100
    eyes.wait_for(lambda: eyes.tick >= ticks, "robot time to go on")
    assert robot.stands()


def _bring_up_again(robot: Robot, gait: str) -> None:
    """The same after a loss that may have cost it the balance: then from the start."""
    eyes = robot.eyes

    def up() -> bool:
        return eyes.mode == gait and not eyes.faults and robot.stands()

    ticks = eyes.tick + 500
    eyes.wait_for(lambda: eyes.tick >= ticks, "a second of robot time")
    eyes.wait_for(lambda: up() or eyes.height() < 0.5, "Cassie to go on or to fall")
    if not up():
        assert robot.call("reset", start="standing").success
    _bring_up(robot, gait)


@pytest.mark.parametrize(("pacing", "gait"), RUNS)
def test_each_node_killed_in_turn(tmp_path: Path, pacing: str, gait: str) -> None:
    with _robot(tmp_path, pacing, gait) as robot:
        bag = robot.record()
        robot.start()
        robot.go()
        _bring_up(robot, gait)
        _lose_operator(robot, gait)
        _lose_supervisor(robot, gait)
        _lose_estimator_or_controller(robot, gait, "state_estimator", pacing)
        _lose_estimator_or_controller(robot, gait, "gait_controller", pacing)
        _lose_simulator(robot)
        robot.processes.stop("record")
        if pacing == "lockstep":
            _check_nothing_is_lost(bag)
        _check_replay(bag)


def _check_nothing_is_lost(bag: Path) -> None:
    """Samples are whole in every episode, whoever died in between."""
    samples = read_recording(bag).lane[Sensors.TOPIC]
    episodes = np.unique(samples["episode"])
    assert len(episodes) > 1
    for episode in episodes:
        seqs = np.unique(samples["seq"][samples["episode"] == episode])
        assert (np.diff(seqs) == 1).all()


def _check_replay(bag: Path) -> None:
    """Each node answers as it did, from each of its starts on; what cannot be followed is named."""
    found = verify(bag)
    assert found.compared > 5000
    assert found.differences == []


def _lose_operator(robot: Robot, gait: str) -> None:
    """It stops and stands; a new operator takes over."""
    eyes = robot.eyes
    killed = robot.kill("scripted_operator")
    reported = eyes.wait_for(
        lambda: eyes.fault_since(killed, "operator lost"), "report of the lost operator"
    )
    assert took(killed, reported) < REPORT_LIMIT
    eyes.wait_for(lambda: eyes.mode == "stand", "Cassie to stand")
    assert robot.stands()
    robot.start("scripted_operator")
    _bring_up(robot, gait)


def _lose_supervisor(robot: Robot, gait: str) -> None:
    """The controller stops and stands by itself; a new supervisor takes over."""
    eyes = robot.eyes
    killed = robot.kill("mode_supervisor")
    name = "gait_controller: supervisor"
    reported = eyes.wait_for(
        lambda: eyes.report_since(killed, name), "report of the lost supervisor"
    )
    assert took(killed, reported) < REPORT_LIMIT
    ticks = eyes.tick + 1200
    eyes.wait_for(lambda: eyes.tick >= ticks, "it to stop, step in place and stand")
    assert robot.stands()
    robot.start("mode_supervisor")
    eyes.wait_for(lambda: eyes.is_well(name), "the controller to hear the new supervisor")
    _bring_up(robot, gait)


def _lose_estimator_or_controller(robot: Robot, gait: str, node: str, pacing: str) -> None:
    """Lock-step waits, so a quick restart is not noticed; on the wall clock the drives damp."""
    eyes = robot.eyes
    killed = robot.kill(node)
    if pacing == "realtime":
        eyes.wait_for(lambda: eyes.sensors.damping > 0.0, "the watchdog to damp", timeout=1.0)
    reported = eyes.wait_for(
        lambda: eyes.fault_since(killed, f"{node} lost"), f"report of the lost {node}"
    )
    assert took(killed, reported) < REPORT_LIMIT
    eyes.wait_for(
        lambda: (
            eyes.report_since(killed, f"mode_supervisor: {node}")
            and eyes.report_since(killed, "simulator: command")
        ),
        "supervisor and simulator to report it on /diagnostics",
        timeout=REPORT_LIMIT,
    )
    tick = eyes.tick
    robot.start(node)
    if pacing == "lockstep":
        eyes.wait_for(lambda: eyes.tick > tick + 20, "lock-step to go on")
        assert robot.stands()
        assert eyes.is_well("simulator: lockstep")
    eyes.wait_for(lambda: not any(node in fault for fault in eyes.faults), "the fault to be over")
    _bring_up_again(robot, gait)


def _lose_simulator(robot: Robot) -> None:
    """The others report it and wait; a new simulator begins a new episode."""
    eyes = robot.eyes
    episode = eyes.episode
    killed = robot.kill("simulator")
    reported = eyes.wait_for(
        lambda: eyes.fault_since(killed, "simulator lost"), "report of the lost simulator"
    )
    assert took(killed, reported) < REPORT_LIMIT
    eyes.wait_for(
        lambda: (
            eyes.report_since(killed, "state_estimator: simulator")
            and eyes.report_since(killed, "gait_controller: state_estimator")
        ),
        "estimator and controller to report it too",
        timeout=REPORT_LIMIT,
    )
    robot.start("simulator")
    eyes.wait_for(lambda: eyes.episode > episode, "a new episode")
    robot.go()
    _bring_up(robot, "stand")
