"""The nine outputs of eq:h0 against forward kinematics and finite differences."""

from __future__ import annotations

import math

import numpy as np
import pytest
from robot_states import leg_joints, random_state, readings_of, state_of

from cassie_control.control.outputs import (
    FOOT_SW,
    LEAST_ACCELERATION,
    LENGTH_ST,
    LENGTH_SW,
    PITCH_SW,
    ROLL_SW,
    Step,
    measure,
)
from cassie_control.control.robot import HIP_X, HIP_Y, HIP_Z
from cassie_gaits import bezier
from cassie_gaits.gait_library import OUTPUTS


def outputs_of(state, stance=1):
    """Outputs and rates, right leg in stance unless told otherwise."""
    step = Step()
    measure(readings_of(state).records, stance, step.records)
    return step.measured, step.measured_rates


def test_lengths_and_swing_angles_are_those_of_forward_kinematics():
    state = state_of(leg_joints(hip_pitch=0.6, knee=-1.3), leg_joints(hip_pitch=0.4, knee=-1.0))
    values, _ = outputs_of(state)
    left, right = readings_of(state).legs
    hip = np.array([HIP_X, HIP_Y, HIP_Z])
    to_toe = left.toe_joint - hip
    assert values[LENGTH_SW] == pytest.approx(np.linalg.norm(to_toe), abs=2e-4)
    assert values[PITCH_SW] == pytest.approx(math.atan2(to_toe[0], -to_toe[2]), abs=3e-4)
    # The rounded figures of eq:IK put the toe joint 0.2 mm off the plane of the hip.
    to_toe = right.toe_joint - hip * (1.0, -1.0, 1.0)
    assert values[LENGTH_ST] == pytest.approx(np.linalg.norm(to_toe), abs=2e-4)


def test_swing_pitch_and_foot_pitch_are_against_the_vertical():
    legs = leg_joints(), leg_joints(hip_pitch=0.55)
    level, _ = outputs_of(state_of(*legs))
    nose_down, _ = outputs_of(state_of(*legs, pitch=0.2))
    assert nose_down[PITCH_SW] - level[PITCH_SW] == pytest.approx(-0.2)
    assert nose_down[FOOT_SW] - level[FOOT_SW] == pytest.approx(-0.2)
    assert level[FOOT_SW] == pytest.approx(0.0, abs=1e-12)


def test_swing_roll_is_positive_with_the_foot_to_the_left():
    values, _ = outputs_of(state_of(leg_joints(hip_roll=0.1), leg_joints(), roll=0.05))
    assert values[ROLL_SW] == pytest.approx(0.15)
    moved = readings_of(state_of(leg_joints(hip_roll=0.1), leg_joints())).legs[0].toe_joint
    still = readings_of(state_of(leg_joints(), leg_joints())).legs[0].toe_joint
    assert moved[1] > still[1] + 0.05


def test_known_answer_of_the_formulas():
    state = state_of(
        leg_joints(0.02, 0.03, 0.5, -1.2, -1.5),
        leg_joints(-0.04, 0.05, 0.6, -1.1),
        pitch=0.1,
        roll=-0.06,
    )
    c = math.cos(-1.2 + 0.035)
    length = math.sqrt(0.5292 * c + 0.53005264)
    expected = (
        -0.06,
        0.05,
        0.1,
        math.sqrt(0.5292 * math.cos(-1.1 + 0.035) + 0.53005264),
        -0.06 + 0.02,
        0.03,
        -0.1 + 0.5 - math.acos((0.5 * c + 0.5292) / length) + 0.1,
        length,
        -0.1 + 0.5 - 1.5 + math.radians(63.0),
    )
    assert outputs_of(state)[0] == pytest.approx(expected, abs=1e-12)
    assert len(OUTPUTS) == len(expected)


@pytest.mark.parametrize("stance", [0, 1])
def test_rates_are_the_derivatives_of_the_outputs(stance):
    dt = 1e-6
    state = random_state(3, roll=0.1, pitch=-0.1)
    before, rates = outputs_of(state, stance)
    state.q[:] += dt * state.v
    after, _ = outputs_of(state, stance)
    assert (after - before) / dt == pytest.approx(rates, abs=1e-5)


def test_least_acceleration_is_the_least_squares_solution():
    """Of the second derivative at 41 phases, for given first and last two coefficients."""
    bends = np.array([bezier.basis(phase)[:, 2] for phase in np.linspace(0.0, 1.0, 41)])
    solution = -np.linalg.lstsq(bends[:, 2:4], bends[:, [0, 1, 4, 5]], rcond=None)[0]
    assert pytest.approx(solution, abs=1e-14) == LEAST_ACCELERATION
