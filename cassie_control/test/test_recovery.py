"""When steps that it took by itself may end."""

from __future__ import annotations

import pytest
from robot_states import leg_joints, readings_of, state_of

from cassie_control.config import TransitionConfig
from cassie_control.control.recovery import rests


def rested(vertical=0.0, ahead=0.0, aside=0.0, **state):
    still = state_of(leg_joints(hip_roll=0.03), leg_joints(hip_roll=-0.03), **state)
    still.v[2] = vertical
    still.com_velocity[:2] = ahead, aside
    return rests(readings_of(still), TransitionConfig())


def test_at_rest_on_both_feet_they_end():
    assert rested()
    assert rested(vertical=-0.1, ahead=0.1, aside=-0.1)


@pytest.mark.parametrize(
    "state",
    [{"vertical": 0.3}, {"vertical": -0.3}, {"ahead": 0.25}, {"aside": 0.5}, {"roll": 0.2}],
)
def test_who_bounces_runs_or_leans_steps_on(state):
    """Taken over while it rises, a foot leaves the ground and it tips over the other."""
    assert not rested(**state)
