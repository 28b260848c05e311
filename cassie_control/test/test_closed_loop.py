"""Cassie under control in simulation, ideal sensors, one process."""

from __future__ import annotations

import numpy as np
import pytest
from closed_loop import Robot

from cassie_control.config import ControllerConfig, WalkConfig
from cassie_gaits.gait_library_file import default_library_path, load_library
from cassie_msgs.experiment.scenario import GantryMove, Push, Scenario
from cassie_msgs.layout import RobotMode


def test_steps_in_place_stops_and_stands(walked):
    assert not walked.fallen
    activities = [moment.activity for moment in walked.moments]
    order = [a for a, before in zip(activities, [None, *activities], strict=False) if a != before]
    assert order == ["idle", "standing", "leaning", "walking", "standing"]
    stepping = [moment for moment in walked.moments if moment.activity == "walking"]
    assert stepping[-1].time - stepping[0].time > 3.0
    assert np.hypot(*(stepping[-1].position - stepping[0].position)[:2]) < 0.4
    lifted = np.array([moment.forces for moment in stepping]) < 1.0
    assert lifted[:, 0].mean() > 0.2
    assert lifted[:, 1].mean() > 0.2
    assert np.abs(walked.moments[-1].velocity).max() < 0.15


def test_steps_in_place_by_the_papers_law():
    config = ControllerConfig(walk=WalkConfig(law="paper"))
    gaits = load_library(default_library_path())
    robot = Robot(Scenario(start="standing"), config=config, library=gaits)
    robot.ask(height=0.98)
    robot.run(1.8)
    robot.ask(mode=int(RobotMode.WALK))
    robot.run(10.0)
    assert not robot.fallen
    assert float(robot.controller.status.step_count) > 20
    assert np.hypot(*robot.plant.pelvis_pose[0][:2]) < 0.8


def test_boots_from_the_gantry_and_stands():
    lower = GantryMove(t=0.5, action="lower", height=0.85, speed=0.3)
    robot = Robot(Scenario(start="gantry", gantry=(lower,)))
    robot.run(4.5)
    assert robot.mode is RobotMode.STAND
    assert not robot.plant.gantry.attached
    assert float(robot.plant.pelvis_pose[0][2]) == pytest.approx(0.95, abs=0.02)
    assert np.abs(robot.plant.pelvis_twist).max() < 0.1


@pytest.mark.parametrize("force", [(50.0, 0.0, 0.0), (-50.0, 0.0, 0.0), (0.0, 50.0, 0.0)])
def test_stands_on_after_a_push_of_5_newton_seconds(force):
    robot = Robot(Scenario(start="standing", pushes=(Push(t=1.5, duration=0.1, force=force),)))
    robot.run(3.5)
    assert not robot.fallen
    assert robot.mode is RobotMode.STAND
    assert np.abs(robot.plant.pelvis_twist[:2]).max() < 0.3


def test_rises_slowly_where_damping_let_it_sink():
    robot = Robot(Scenario(start="standing"))
    robot.run(1.5)
    robot.controller_lost = True
    robot.run(0.25)
    assert robot.mode is RobotMode.DAMP
    sunk = float(robot.plant.pelvis_pose[0][2])
    assert sunk < 0.92
    robot.controller_lost = False
    robot.run(0.5)
    assert robot.mode is RobotMode.STAND
    assert not robot.fallen
