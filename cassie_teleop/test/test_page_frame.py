"""Figures for the page out of samples."""

import json
import math

import numpy as np
import pytest

from cassie_msgs.layout import ControllerStatus, OperatorCommand, RobotState
from cassie_teleop.page_frame import SILENCE, Picture, RealTimeFactor, achieved
from cassie_teleop.robot_description import RobotDescription

ROBOT = RobotDescription(
    moving=["base", "toe"], efforts={"left_knee": 200.0, "right_toe": 50.0}, meshes=[], links=[]
)


def state(seconds=1.0, episode=3):
    sample = RobotState()
    sample.stamp_ns = round(seconds * 1e9)
    sample.episode[...] = episode
    return sample


def test_speeds_are_those_of_the_heading_frame():
    sample = state()
    sample.q[3] = math.pi / 2
    sample.v[:4] = (0.0, 0.7, 0.0, 0.2)
    assert achieved(sample) == pytest.approx([0.7, 0.0, 0.2])


def test_the_real_time_factor_is_robot_time_by_wall_time():
    factor = RealTimeFactor()
    assert factor.value is None
    for k in range(100):
        factor.add(10.0 + 0.04 * k, 0.02 * k)
    assert factor.value == pytest.approx(0.5)
    factor.add(14.1, 0.0)  # a new episode
    assert factor.value is None


def test_what_was_never_heard_or_is_old_is_unknown():
    picture = Picture()
    figures = picture.figures(0.0, None)
    assert figures["achieved"] is figures["torque"] is figures["outputs"] is None
    picture.follow_state(state().to_bytes(), 5.0)
    assert picture.figures(5.0, ROBOT)["achieved"] == [0.0, 0.0, 0.0]
    assert picture.figures(5.0 + SILENCE + 0.1, ROBOT)["achieved"] is None


def test_torques_are_ratios_of_their_limits():
    picture, sample = Picture(), state()
    sample.drive_torque[3], sample.drive_torque[9] = -100.0, 25.0
    picture.follow_state(sample.to_bytes(), 1.0)
    torque = picture.figures(1.0, ROBOT)["torque"]
    assert (torque[3], torque[9], torque[0]) == (-0.5, 0.5, 0.0)


def test_a_new_episode_is_told_once():
    picture = Picture()
    told = [picture.follow_state(state(episode=e).to_bytes(), 1.0) for e in (3, 3, 4, 4)]
    assert told == [False, False, True, False]


def test_a_message_that_does_not_fit_changes_nothing():
    picture = Picture()
    picture.follow_state(b"\0" * 7, 1.0)
    assert picture.figures(1.0, ROBOT)["achieved"] is None


def test_what_is_not_finite_is_unknown_and_the_rest_is_json():
    picture, sample, status, command = Picture(), state(), ControllerStatus(), OperatorCommand()
    sample.floats[:] = np.nan
    status.floats[:] = np.inf
    command.vx[...] = np.nan
    picture.follow_state(sample.to_bytes(), 1.0)
    picture.controller.load(status.to_bytes(), 1.0)
    picture.operator.load(command.to_bytes(), 1.0)
    picture.poses["base"] = (math.nan,) * 7
    figures = json.loads(json.dumps(picture.figures(1.0, ROBOT), allow_nan=False))
    assert figures["achieved"] == [None] * 3 and figures["outputs"] == [None] * 9
    assert figures["asked"][0] is None and figures["poses"] == [[], []]
    assert not picture.powered
