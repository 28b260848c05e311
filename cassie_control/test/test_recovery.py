"""When steps that it took by itself may end."""

from __future__ import annotations

import numpy as np
import pytest
from robot_states import leg_joints, readings_of, state_of

from cassie_control.config import StandConfig
from cassie_control.control.recovery import ShorteningLimit, comes_to_rest
from cassie_gaits import virtual_leg
from cassie_gaits.robot import GRAVITY
from cassie_msgs.layout import MotorCommand

PERIOD = 0.002


def rested(vertical=0.0, ahead=0.0, aside=0.0, **state):
    still = state_of(leg_joints(hip_roll=0.03), leg_joints(hip_roll=-0.03), **state)
    still.v[2] = vertical
    still.com_velocity[:2] = ahead, aside
    return comes_to_rest(readings_of(still))


def test_at_rest_on_both_feet_they_end():
    assert rested()
    assert rested(vertical=-0.1, ahead=0.1, aside=-0.1)


@pytest.mark.parametrize(
    "state",
    [{"vertical": 0.3}, {"vertical": -0.3}, {"ahead": 0.35}, {"aside": 0.7}, {"roll": 0.2}],
)
def test_who_bounces_runs_or_leans_steps_on(state):
    """Taken over while it rises, a foot leaves the ground and it tips over the other."""
    assert not rested(**state)


@pytest.mark.parametrize(("axis", "name"), [(0, "ahead"), (1, "aside")])
def test_they_end_as_soon_as_the_capture_point_is_over_the_feet(axis, name):
    still = readings_of(state_of(leg_joints(hip_roll=0.03), leg_joints(hip_roll=-0.03)))
    time = np.sqrt(still.com_from_feet[2] / GRAVITY)
    width = still.legs[0].foot[1] - still.legs[1].foot[1]
    edge = (0.06, 0.5 * width)[axis]
    speed = (edge - still.com_from_feet[axis]) / time
    assert rested(**{name: 0.98 * speed})
    assert not rested(**{name: 1.02 * speed})


def limited(wanted):
    """Lengths of the left leg that are commanded where a gait wants these. Shape (n,), in m."""
    core, command, lengths = ShorteningLimit(PERIOD), MotorCommand(), []
    core.start(wanted[0])
    for length in wanted:
        command.position[3] = virtual_leg.knee_angle(length)
        core.apply(0, command, StandConfig())
        lengths.append(virtual_leg.length(float(command.position[3])))
    return np.array(lengths)


def test_the_stance_leg_shortens_with_bounded_rate_and_acceleration():
    config, first, then = StandConfig(), 0.95, 0.8
    lengths = limited(np.r_[first, np.full(400, then)])
    rates = np.diff(lengths) / PERIOD
    assert rates.min() == pytest.approx(-config.height_rate)
    assert -np.diff(rates[rates < 0.0]).min() <= config.height_acceleration * PERIOD * 1.001
    assert lengths[-1] == pytest.approx(then)


def test_the_stance_leg_extends_as_fast_as_the_gait_wants():
    wanted = np.r_[0.8, np.full(10, 0.9)]
    assert limited(wanted) == pytest.approx(wanted)
