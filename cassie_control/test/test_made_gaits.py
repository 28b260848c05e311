"""Gaits made while walking: what is asked, when they are taken up, what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from closed_loop import PERIOD, Robot
from robot_states import leg_joints, mode_of, random_state, readings_of, state_of
from walkers import LIBRARY, walking

from cassie_control.config import ControllerConfig
from cassie_control.control.gait_controller import GaitController
from cassie_control.control.outputs import FOOT_SW
from cassie_control.planner.timing import LEFT
from cassie_control.schedule import gait_refusal
from cassie_msgs.experiment.scenario import Scenario
from cassie_msgs.layout import Gait, GaitResult, MotorCommand, RobotMode
from cassie_msgs.schedule import GAIT_TICKS


def made(speed=0.5, change=0.01, slope=0.0, seq=500):
    """A gait that is the library's of a speed, but for a change of every coefficient."""
    right, left, time = LIBRARY.interpolate(speed)
    gait = Gait()
    gait.seq[...], gait.effective_seq[...] = seq, seq + GAIT_TICKS
    gait.vx[...], gait.slope[...], gait.step_time[...] = speed, slope, time
    gait.right_stance[:], gait.left_stance[:] = right.ravel() + change, left.ravel() + change
    return gait


def touchdown(core):
    """Walk until a step ends."""
    command, state = MotorCommand(), random_state(4)
    stance = core.timing.stance
    state.foot_force[1 - stance] = 0.0
    readings = readings_of(state)
    for _ in range(120):
        core.step(readings, mode_of(), command)
    state.foot_force[1 - stance] = 300.0
    assert core.step(readings_of(state), mode_of(), command)


def read(core, speed):
    """The right leg's coefficients at a speed, as the core walks on them."""
    axes, _, rows = core._gaits
    at = list(axes[0]).index(speed)
    return rows[at][:54].reshape(9, 6)


def test_a_gait_is_taken_up_at_the_next_touchdown_and_moves_the_whole_library():
    core = walking(LEFT)
    core.offer(made(change=0.01))
    np.testing.assert_array_equal(read(core, 0.5), LIBRARY.interpolate(0.5)[0])
    touchdown(core)
    for speed in (0.0, 0.5, 1.0):
        wanted = LIBRARY.interpolate(speed)[0] + 0.01
        np.testing.assert_allclose(read(core, speed), wanted, atol=1e-12)


def test_the_slope_of_the_swing_foot_stays_the_controllers_own():
    core = walking(LEFT)
    gait = made(change=0.0, slope=0.1)
    for stance in (gait.right_stance, gait.left_stance):
        stance.reshape(9, 6)[FOOT_SW] += 0.1
    core.offer(gait)
    touchdown(core)
    np.testing.assert_allclose(read(core, 0.5), LIBRARY.interpolate(0.5)[0], atol=1e-12)


def test_what_was_not_found_leads_back_to_the_library():
    core = walking(LEFT)
    core.offer(made())
    touchdown(core)
    none = Gait()
    none.result[...] = int(GaitResult.NOT_FOUND)
    core.offer(none)
    wanted = LIBRARY.interpolate(0.5)[0]
    for shift in (0.005, 0.0025, 0.00125):
        touchdown(core)
        np.testing.assert_allclose(read(core, 0.5), wanted + shift, atol=1e-12)
    touchdown(core)
    touchdown(core)
    assert core._gaits[2] is LIBRARY.table[2]


def test_without_answers_it_goes_back_to_the_library():
    """The gait of a time when the optimizer still answered stayed for good."""
    core = walking(LEFT)
    core.offer(made())
    touchdown(core)
    for _ in range(12):
        touchdown(core)
    assert core._gaits[2] is LIBRARY.table[2]


def test_walking_that_begins_anew_begins_on_the_library():
    core = walking(LEFT)
    core.offer(made())
    touchdown(core)
    core.offer(made())
    core.start(readings_of(state_of(leg_joints(), leg_joints())), LEFT)
    touchdown(core)
    assert core._gaits[2] is LIBRARY.table[2]


def test_the_library_itself_is_not_changed():
    before = LIBRARY.table[2].copy()
    core = walking(LEFT)
    core.offer(made())
    touchdown(core)
    np.testing.assert_array_equal(LIBRARY.table[2], before)


@pytest.mark.parametrize(("mass", "spring"), [(8.0, 1.0), (8.0, 0.7), (0.0, 1.3)])
def test_a_payload_is_found_whatever_the_springs(mass, spring):
    """By the springs' forces it was always near 0: their scale follows the nominal weight."""
    scenario = {"start": "standing", "payload": {"mass": mass}, "model": {"spring": spring}}
    robot = Robot(Scenario.from_mapping(scenario), "faithful")
    robot.run(4.0)  # where the CoM is, is found in standing
    robot.ask(mode=int(RobotMode.WALK), vx=0.3)
    asked = []
    for _ in range(6000):
        robot.run(PERIOD)
        if (request := robot.controller.request()) is not None:
            asked.append(float(request.payload))
    assert asked[-1] == pytest.approx(mass, abs=1.0)


def test_requests_come_on_their_schedule_while_it_walks():
    core = GaitController(ControllerConfig(), LIBRARY, 0.002)
    state, mode = state_of(leg_joints(), leg_joints()), mode_of()
    mode.mode[...] = int(RobotMode.WALK)
    mode.vx[...], mode.vy[...], mode.yaw_rate[...] = 0.3, 0.1, -0.2
    asked = []
    for tick in range(1500):
        state.seq[...] = tick
        core.step(state, mode)
        if (request := core.request()) is not None:
            asked.append((tick, int(request.seq), int(request.effective_seq)))
            assert request.floats[:3].tolist() == [0.3, 0.1, -0.2]
    assert asked
    assert all(
        tick == seq and seq % GAIT_TICKS == 0 and effective == seq + GAIT_TICKS
        for tick, seq, effective in asked
    )


@pytest.mark.parametrize(("vx", "asked"), [(0.3, 0.3), (2.2, 1.0), (-1.2, -0.5)])
def test_gaits_are_asked_for_speeds_of_the_library(vx, asked):
    core = GaitController(ControllerConfig(), LIBRARY, 0.002)
    state, mode = state_of(leg_joints(), leg_joints()), mode_of(vx=vx)
    mode.mode[...] = int(RobotMode.WALK)
    requests = []
    for tick in range(1001):
        state.seq[...] = tick
        core.step(state, mode)
        if (request := core.request()) is not None:
            requests.append(float(request.vx))
    assert set(requests) == {asked}


def test_no_request_while_it_stands():
    core = GaitController(ControllerConfig(), LIBRARY, 0.002)
    state, mode = state_of(leg_joints(), leg_joints()), mode_of()
    mode.mode[...] = int(RobotMode.STAND)
    core.step(state, mode)
    assert core.request() is None


@pytest.mark.parametrize(
    ("change", "tick", "words"),
    [
        ({}, 750, ""),
        ({}, 600, ""),
        ({}, 751, "late: for tick 750, came before tick 751"),
        ({"seq": 900}, 700, "gait seq = 900 is outside 0 .. 700"),
        ({"effective_seq": 500}, 600, "effective_seq = 500 is outside 750 .. 750"),
        ({"effective_seq": 2000}, 600, "effective_seq = 2000"),
        ({"result": 9}, 600, "result = 9 is outside 0 .. 3"),
        ({"step_time": 5.0}, 600, "step_time is 5 s, expected 0.2 .. 1.0 s"),
        ({"slope": float("nan")}, 600, "slope is nan"),
        ({"right_stance": 1e9}, 600, "right_stance[0] is 1e+09"),
    ],
)
def test_what_is_not_believed_or_comes_late_is_refused_in_words(change, tick, words):
    gait = made()
    for name, value in change.items():
        getattr(gait, name)[...] = value
    refused = gait_refusal(gait, tick)
    assert words in refused
    assert bool(words) == bool(refused)
