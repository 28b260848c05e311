"""Walking finds the grip of the ground where a foot slips."""

from __future__ import annotations

import pytest
from robot_states import mode_of, readings_of
from walkers import swinging, walking

from cassie_control.controller.readings import WEIGHT
from cassie_control.controller.slip_kernels import FIRM
from cassie_control.controller.step_timing import LEFT, RIGHT
from cassie_msgs.layout import MotorCommand

STANCES = pytest.mark.parametrize("stance", [LEFT, RIGHT])
FORCE = 330.0  # N, on the stance foot
GRAVITY = 9.81


def slide(stance, velocity, acceleration):
    """Walk for 0.12 s with joints that stand still while the pelvis moves to the left, in m/s.

    The CoM's velocity changes meanwhile. In m/s^2.
    """
    core, command, state = walking(stance), MotorCommand(), swinging(stance)
    state.v[1] = velocity
    for tick in range(60):
        state.com_velocity[1] = 0.002 * tick * acceleration
        core.step(readings_of(state), mode_of(), command)
    return core


@STANCES
def test_the_grip_is_what_a_foot_that_slips_gives_the_robot(stance):
    held = 2.4  # m/s^2
    core = slide(stance, -0.5, held)
    assert core.grip == pytest.approx(WEIGHT / GRAVITY * held / FORCE, rel=0.08)


@STANCES
def test_ground_on_which_no_foot_slips_is_firm(stance):
    core = slide(stance, 0.08, 2.4)
    assert core.grip == FIRM
