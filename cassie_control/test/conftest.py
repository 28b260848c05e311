"""Runs that several tests look at."""

from __future__ import annotations

import pytest
from closed_loop import Robot
from supervised import STAND, WALK, Scene

from cassie_msgs.experiment.scenario import Scenario
from cassie_msgs.layout import RobotMode


def stepping(sensors: str, duration: float) -> Robot:
    """Stands, then steps in place for so many seconds; every tick is recorded."""
    robot = Robot(Scenario(start="standing"), sensors, record=True)
    robot.ask(height=0.98)
    robot.run(1.8)
    robot.ask(mode=int(RobotMode.WALK))
    robot.run(0.7 + duration)
    return robot


@pytest.fixture(scope="session")
def walked():
    """Ideal sensors: stands, steps in place for 3 s, stops and stands."""
    robot = stepping("ideal", 3.0)
    robot.ask(mode=int(RobotMode.STAND))
    robot.run(3.0)
    return robot


@pytest.fixture(scope="session")
def walked_faithful():
    """Faithful sensors: stands and steps in place for 1.5 s."""
    return stepping("faithful", 1.5)


@pytest.fixture
def scene():
    return Scene()


@pytest.fixture
def standing(scene):
    scene.run(1.5)
    assert scene.mode is STAND
    return scene


@pytest.fixture
def walking(standing):
    standing.ask(mode=int(WALK))
    standing.run(0.1)
    assert standing.mode is WALK
    return standing
