"""Walking: desired outputs and their continuity, mirror images, new gains on the way."""

from __future__ import annotations

import itertools
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from robot_states import (
    leg_joints,
    mirrored_command,
    mirrored_mode,
    mirrored_state,
    mode_of,
    put,
    put_toe_joint,
    random_state,
    readings_of,
    state_of,
)
from walkers import CONFIG, LIBRARY, swinging, walking

from cassie_control.config import WalkConfig
from cassie_control.control.outputs import (
    FOOT_SW,
    LENGTH_ST,
    LENGTH_SW,
    PITCH_SW,
    ROLL_SW,
    YAW_ST,
    YAW_SW,
    Step,
    adjust_outputs,
    evaluate_gait,
)
from cassie_control.control.walking import WalkingController, advance_step
from cassie_control.planner.placement import Commanded, SwingTarget
from cassie_control.planner.terrain import update_at_touchdown
from cassie_control.planner.timing import (
    LEFT,
    RIGHT,
    adapt_phase_rate,
    time_to_planned_touchdown,
)
from cassie_gaits import virtual_leg
from cassie_gaits.gait_library import Gait, GaitLibrary
from cassie_msgs.layout import MotorCommand, RobotState

STANCES = pytest.mark.parametrize("stance", [LEFT, RIGHT])


@STANCES
def test_desired_outputs_go_on_from_where_the_legs_are_at_touchdown(stance):
    core, command = walking(stance, config=WalkConfig(law="paper")), MotorCommand()
    state = random_state(4)
    state.foot_force[1 - stance] = 0.0
    readings = readings_of(state)
    for _ in range(120):
        core.step(readings, mode_of(), command)
    state.foot_force[1 - stance] = 300.0
    assert core.step(readings_of(state), mode_of(), command)
    assert core.timing.stance == 1 - stance
    kept = [YAW_ST, LENGTH_ST, ROLL_SW, YAW_SW, PITCH_SW, LENGTH_SW, FOOT_SW]
    assert core.plan.desired[kept] == pytest.approx(core.plan.measured[kept], abs=1e-12)
    # The leg's own rates jump at the impact, so only what the torso carries along goes on.
    carried = [ROLL_SW, PITCH_SW]
    assert core.plan.desired_rates[carried] == pytest.approx(
        core.plan.measured_rates[carried], abs=1e-9
    )
    held = [YAW_ST, LENGTH_ST, YAW_SW, LENGTH_SW, FOOT_SW]
    assert core.plan.desired_rates[held] == pytest.approx(0.0, abs=1e-9)


def on_a_fixed_foot(stance: int, seed: int) -> RobotState:
    """A state whose pelvis moves as its stance leg turns above the foot."""
    state, period = random_state(seed), 1e-6
    state.v[:6] = 0.0
    state.foot_force[1 - stance] = 0.0
    moved = RobotState()
    moved.copy_from(state)
    moved.q[:] += period * state.v
    before, after = (np.array(readings_of(each).legs[stance].toe_joint) for each in (state, moved))
    forward, left, up = (before - after) / period
    c, s = np.cos(state.q[3]), np.sin(state.q[3])
    state.v[:3] = c * forward - s * left, s * forward + c * left, up
    state.com_velocity[:] = forward, left, up
    return state


def step_towards(core, readings, mode, landing, lead):
    """One tick up to the desired outputs, with an answer of leg-angle adjustment.

    The answer is pitch, roll and length of the swing leg, at the gait's own touchdown.
    """
    timings, slopes, steps = core.timing.records, core._slope.records, core.plan.records
    gains, robots, table = core._gains.records, readings.records, core.library.table
    advance_step(robots, mode.record, timings, steps, Commanded().records)
    commanded = float(mode.vy), float(mode.yaw_rate)
    evaluate_gait(gains, robots, timings, slopes, *table, *commanded, steps)
    target = SwingTarget(*landing, time_to_planned_touchdown(timings[0]), lead)
    adapt_phase_rate(timings[0], target.remaining)
    now = (each[0] for each in (gains, robots, mode.record, timings, slopes))
    adjust_outputs(*now, target, steps[0])


@pytest.mark.parametrize("law", ["pendulum", "paper"])
@pytest.mark.parametrize("lead", [0.0, 0.03])
@pytest.mark.parametrize("level", [False, True])
@pytest.mark.parametrize("phase", [0.05, 0.15, 0.3, 0.55, 0.65, 0.9])
@STANCES
def test_desired_rates_and_accelerations_are_derivatives(stance, phase, level, lead, law):
    """While adjustment gives the same answer and no foot is pressed down in its swing.

    Only the rate of a stance leg that travels level leaves out how its share grows: see
    "Rate of the level hip" in DECISIONS.md.
    """
    period = 1e-6
    config = replace(CONFIG, law=law, slope_time=0.0, level_back=1.0 if level else 0.0)
    state = on_a_fixed_foot(stance, seed=7)
    state.v[3] = 0.3  # as commanded
    library = replace(LIBRARY, gaits=(LIBRARY.gaits[4],))
    core = WalkingController(config, library, period)
    core.start(readings_of(on_a_fixed_foot(stance, seed=8)), stance)
    core.timing.phase = phase
    core.timing.velocity = (-1.0, 0.0)
    found = []
    for _ in range(3):
        step_towards(core, readings_of(state), mode_of(yaw_rate=0.3), (0.3, -0.05, 0.8), lead)
        accelerations = core.plan.accelerations
        found.append(np.array([core.plan.desired, core.plan.desired_rates, accelerations]))
        state.q[:] += period * state.v
    slopes = (found[2] - found[1])[:2] / period
    rows = [row for row in range(9) if row != LENGTH_ST or not level or law == "paper"]
    assert slopes[0][rows] == pytest.approx(found[1][1][rows], abs=2e-3)
    accelerated = [ROLL_SW, YAW_SW, PITCH_SW, LENGTH_SW, FOOT_SW]  # by the swing leg's torques
    assert slopes[1][accelerated] == pytest.approx(found[1][2][accelerated], abs=2e-2)


@pytest.mark.parametrize(("law", "higher"), [("pendulum", 0.05), ("paper", 0.0)])
@STANCES
def test_a_foot_swings_higher_by_its_clearance_in_the_middle_of_a_step(stance, law, higher):
    def length(phase: float, clearance: float) -> float:
        config = replace(CONFIG, law=law, clearance=clearance)
        core = walking(stance, config=config, period=1e-9)
        core.timing.phase = phase
        core.step(readings_of(swinging(stance)), mode_of(), MotorCommand())
        return core.plan.desired[LENGTH_SW]

    drawn_up = [length(phase, 0.0) - length(phase, 0.05) for phase in (0.0, 0.25, 0.5, 0.75, 1.0)]
    assert drawn_up == pytest.approx(np.array([0.0, 9 / 16, 1.0, 9 / 16, 0.0]) * higher, abs=1e-6)


@pytest.mark.parametrize(("law", "higher"), [("pendulum", 0.08), ("paper", 0.0)])
@STANCES
def test_after_a_step_up_the_other_foot_swings_higher_by_as_much(stance, law, higher):
    """It has to come up as far, and the next step may be as high: its toe caught on each riser."""

    def length(height: float) -> float:
        core = walking(stance, config=replace(CONFIG, law=law), period=1e-9)
        readings = readings_of(state_of(leg_joints(), leg_joints()))
        put_toe_joint(readings, 1 - stance, (0.0, 0.0, -0.8))
        put_toe_joint(readings, stance, (0.3, 0.0, height - 0.8))
        update_at_touchdown(core._slope.records, readings.records, stance)
        core._slope.foothold_height = core._slope.ahead = 0.0
        core.timing.phase = 0.5
        core.step(readings_of(swinging(stance)), mode_of(), MotorCommand())
        return core.plan.desired[LENGTH_SW]

    assert length(0.0) - length(0.08) == pytest.approx(higher, abs=2e-3)
    assert length(-0.08) == pytest.approx(length(0.0), abs=2e-3)


@pytest.mark.parametrize(("law", "waits"), [("pendulum", True), ("paper", False)])
@STANCES
def test_a_leg_whose_foot_is_held_down_is_not_wound_up(stance, law, waits):
    """It sprang free at 5 m/s, up by as much as 0.4 m, and landed behind the other foot."""
    core, command = walking(stance, config=replace(CONFIG, law=law), period=1e-9), MotorCommand()
    held = swinging(stance)
    core.timing.phase = 0.5
    core.step(readings_of(held), mode_of(), command)
    knee = 5 * (1 - stance) + 3
    length = virtual_leg.length(held.q[9 if stance == RIGHT else 16])
    lag = length - virtual_leg.length(command.position[knee])
    assert lag == pytest.approx(0.03, abs=1e-6) if waits else lag > 0.05


@STANCES
def test_desired_outputs_reach_the_gaits_end(stance):
    paper = replace(CONFIG, law="paper")
    core, command, state = walking(stance, config=paper), MotorCommand(), swinging(stance)
    core.timing.velocity = (0.4, 0.0)
    readings = readings_of(state)
    put(readings, velocity=(0.4, 0.0, 0.0))
    while core.timing.phase < 0.9999:
        core.step(readings, mode_of(), command)
    gait = LIBRARY.interpolate(core.library_speed)[0 if stance == RIGHT else 1]
    rows = [LENGTH_ST, LENGTH_SW, FOOT_SW]
    assert core.plan.desired[rows] == pytest.approx(gait[rows, 5], abs=1e-3)


def with_yaws(gait: Gait, yaw: float) -> Gait:
    """The gait with hip yaws that turn, fast at first and at the end."""
    alpha = gait.coefficients.copy()
    alpha[:, YAW_ST] = yaw * np.array([1.0, -1.0, -1.0, -1.0, -1.0, -1.0])
    alpha[:, YAW_SW] = yaw * np.array([-1.0, -1.0, -1.0, -1.0, -1.0, 1.0])
    return replace(gait, coefficients=alpha)


def grid_library():
    """A gait for each corner of a grid of speeds, told apart by its stance leg's length."""
    gaits = []
    for i, speeds in enumerate(itertools.product((0.0, 0.4), (-0.2, 0.2), (-0.6, 0.6))):
        alpha = LIBRARY.gaits[2].coefficients.copy()
        alpha[:, LENGTH_ST] = 0.8 + 0.01 * i
        gaits.append(Gait(*speeds, 0.4, alpha))
    return replace(LIBRARY, gaits=tuple(gaits))


def test_the_gait_is_read_at_the_commanded_lateral_speed_and_turn():
    """By the measured lateral speed a push changed the gait, and more robots fell."""
    library = grid_library()
    command, readings = MotorCommand(), readings_of(swinging(LEFT))
    core = WalkingController(replace(CONFIG, law="paper"), library, 0.002)
    core.start(readings, LEFT)
    put(readings, velocity=(0.1, 0.2, 0.0))
    mode = mode_of(vx=0.1, vy=-0.1, yaw_rate=0.3)
    while not core.step(readings, mode, command):
        assert core.timing.steps == 0
    core.timing.phase = 1.0
    core.step(readings_of(swinging(RIGHT)), mode, command)
    expected = library.interpolate(core.library_speed, -0.1, 0.3)[0][LENGTH_ST, 5]
    assert core.plan.desired[LENGTH_ST] == pytest.approx(expected, abs=1e-6)


def turn(library: GaitLibrary) -> tuple[np.ndarray, np.ndarray, Step]:
    """Desired yaws and yaw rates of both hips in a step that turns, and the step at its end."""
    core, command = WalkingController(CONFIG, library, 0.002), MotorCommand()
    readings = readings_of(swinging(LEFT))
    core.start(readings, LEFT)
    yaws, rates, rows = [], [], [YAW_ST, YAW_SW]
    while core.timing.phase < 0.98:
        core.step(readings, mode_of(yaw_rate=0.4), command)
        yaws.append(core.plan.desired[rows].copy())
        rates.append(core.plan.desired_rates[rows].copy())
    return np.array(yaws), np.array(rates), core.plan


@pytest.mark.parametrize("yaw", [-0.1, 0.1])
def test_a_gait_that_turns_does_not_turn_the_hips_twice(yaw):
    """The turn has a constant rate: the foot has little friction to turn the body faster."""
    gaits = [with_yaws(gait, yaw) for gait in LIBRARY.gaits]
    yaws, rates, step = turn(replace(LIBRARY, gaits=tuple(gaits)))
    error = step.initial[YAW_ST] - step.half_turn  # at touchdown, which decays
    assert step.half_turn > 0.05
    assert np.mean(rates[:, 0]) * 0.4 * 0.98 == pytest.approx(
        -2.0 * step.half_turn - error, rel=0.15
    )
    straight_yaws, straight_rates, _ = turn(LIBRARY)
    np.testing.assert_array_equal(yaws, straight_yaws)
    np.testing.assert_array_equal(rates, straight_rates)


def test_a_foot_that_lands_and_one_that_leaves_do_not_turn_over_the_ground():
    """A hip that ended its swing at 3 rad/s took near half of its torque to brake."""
    yaws, rates, step = turn(LIBRARY)
    assert rates[0] == pytest.approx([-0.4, -0.4], abs=0.05)
    assert rates[-1] == pytest.approx([-0.4, -0.4], abs=0.02)
    assert yaws[-1] == pytest.approx([-step.half_turn, step.landing_yaw], abs=0.01)
    assert np.abs(rates).max() < 2.0


@STANCES
def test_knees_press_on_at_a_touchdown_as_they_did_before(stance):
    """A loaded leg is shorter than it aims at: that much of its push must not vanish."""
    core, command, state = walking(stance), MotorCommand(), swinging(stance)
    state.q[[9, 16]] = -1.3
    readings = readings_of(state)
    before = np.zeros(10)
    while not core.step(readings, mode_of(), command):
        before[:] = command.position
    knees = command.position[[3, 8]]
    assert np.abs(knees - state.q[[9, 16]]).max() > 0.02
    assert knees == pytest.approx(before[[3, 8]], abs=5e-3)


@STANCES
def test_swing_leg_ends_where_leg_angle_adjustment_says(stance):
    law = replace(CONFIG, law="paper", paper_offset=0.05, paper_narrowing=0.0)
    core, command, state = walking(stance, config=law), MotorCommand(), swinging(stance)
    mode = mode_of(trims=(0.02, -0.03, 0.0, 0.0))
    readings = readings_of(state)
    while core.timing.phase < 0.9999:
        core.step(readings, mode, command)
    gait = LIBRARY.interpolate(core.library_speed)[1 - stance]
    assert core.plan.desired[PITCH_SW] == pytest.approx(gait[PITCH_SW, 5] + 0.07, abs=1e-3)
    assert core.plan.desired[ROLL_SW] == pytest.approx(gait[ROLL_SW, 5] - 0.03, abs=1e-3)


@pytest.mark.parametrize("law", ["pendulum", "paper"])
@pytest.mark.parametrize("seed", range(4))
def test_the_mirror_image_of_a_state_gets_the_mirror_image_of_the_command(law, seed):
    config = replace(CONFIG, law=law)
    state = random_state(seed, roll=0.05, pitch=0.1)
    mirrored = mirrored_state(state)
    left = walking(LEFT, config=config, state=state)
    right = walking(RIGHT, config=config, state=mirrored)
    mode = mode_of(vx=0.3, vy=0.1, yaw_rate=0.2, roll=0.03, trims=(0.01, 0.02, 0.03, 0.04))
    here, there = MotorCommand(), MotorCommand()
    readings, mirrored_readings = readings_of(state), readings_of(mirrored)
    for _ in range(150):
        left.step(readings, mode, here)
        right.step(mirrored_readings, mirrored_mode(mode), there)
    assert left.timing.steps == right.timing.steps
    assert there.floats == pytest.approx(mirrored_command(here).floats, abs=1e-9)


def test_the_swing_leg_reaches_down_for_late_ground():
    config = replace(CONFIG, law="paper", late_speed=0.3)
    core, command, state = walking(config=config), MotorCommand(), swinging(LEFT)
    lengths, readings = [], readings_of(state)
    while not core.step(readings, mode_of(), command):
        lengths.append((core.timing.phase, core.plan.desired[LENGTH_SW]))
    planned = next(length for phase, length in lengths if phase >= 1.0)
    late = [length for phase, length in lengths if phase > 1.0]
    assert (np.diff(late) > 0.0).all()
    assert late[-1] - planned == pytest.approx(
        (config.latest_touchdown - 1.0) * 0.4 * 0.3, abs=3e-3
    )


def test_hip_yaws_turn_towards_the_heading_within_their_bound():
    core, command, state = walking(), MotorCommand(), swinging(LEFT)
    for yaw, sign in ((0.2, -1.0), (-5.0, 1.0)):
        state.q[3] = yaw
        core.timing.phase = 0.99
        core.step(readings_of(state), mode_of(), command)
        expected = sign * min(CONFIG.yaw_limit, CONFIG.heading_gain * abs(yaw))
        assert core.plan.desired[YAW_SW] == pytest.approx(expected, abs=5e-3)


@STANCES
def test_a_foot_that_landed_turned_in_turns_the_body_at_an_even_rate(stance):
    """Turned by jerks, the body makes the stance foot slip."""
    turn = 0.5 * 0.8 * 0.4
    state = state_of(*[leg_joints(hip_yaw=turn, knee=-1.3)] * 2, forces=(330.0, 0.0))
    state.foot_force[:] = (330.0, 0.0) if stance == LEFT else (0.0, 330.0)
    core, command = walking(stance, state=state), MotorCommand()
    readings = readings_of(state)
    while core.timing.phase < 0.98:
        core.step(readings, mode_of(yaw_rate=0.8), command)
        assert core.plan.desired[YAW_ST] == pytest.approx(
            turn * (1.0 - 2.0 * core.timing.phase), abs=5e-3
        )
        assert core.plan.desired_rates[YAW_ST] == pytest.approx(
            -2.0 * turn * core.timing.rate, rel=0.1
        )


def test_turning_does_not_wind_up_while_the_robot_is_held():
    core, command, readings = walking(), MotorCommand(), readings_of(swinging(LEFT))
    for _ in range(3000):
        core.step(readings, mode_of(yaw_rate=0.5), command)
    for _ in range(1000):  # back by less than what was asked for
        core.step(readings, mode_of(yaw_rate=-0.5), command)
    core.timing.phase = 0.99
    core.step(readings_of(swinging(core.timing.stance)), mode_of(), command)
    assert core.plan.desired[YAW_SW] == pytest.approx(-0.25, abs=5e-3)


def test_new_gains_leave_phase_and_sums_as_they_are():
    state = state_of(leg_joints(), leg_joints(), forces=(330.0, 300.0), velocity=(0.5, 0.0))
    fast = readings_of(state)
    changed, same = walking(), walking()
    command, other = MotorCommand(), MotorCommand()
    for tick in range(1000):
        if tick == 900:
            changed.configure(replace(CONFIG, heading_gain=0.7))
            changed.configure(CONFIG)
        changed.step(fast, mode_of(), command)
        same.step(fast, mode_of(), other)
        assert command.to_bytes() == other.to_bytes()
    assert changed.timing.steps > 3


def test_another_law_takes_over_while_walking_goes_on():
    core, command, state = walking(), MotorCommand(), swinging(LEFT)
    readings = readings_of(state)
    for _ in range(60):
        core.step(readings, mode_of(), command)
    phase = core.timing.phase
    core.configure(replace(CONFIG, law="paper"))
    core.step(readings_of(state), mode_of(), command)
    assert core.timing.phase > phase
    assert np.isfinite(command.floats).all()


@pytest.mark.parametrize(("most", "read"), [(0.6, 0.6), (3.0, LIBRARY.speed_range[1])])
def test_the_library_is_read_up_to_gait_speed_and_within_its_range(most, read):
    core = walking(config=replace(CONFIG, gait_speed=most))
    core.timing.velocity = (9.0, 0.0)
    assert core.library_speed == read
    core.step(readings_of(swinging(LEFT)), mode_of(), MotorCommand())
    core.timing.velocity = (9.0, 0.0)
    assert core.timing.step_time == pytest.approx(LIBRARY.interpolate(read)[2])
    core.timing.velocity = (-9.0, 0.0)
    assert core.library_speed == LIBRARY.speed_range[0]


LOADED = """
import sys
from numba.core.dispatcher import Dispatcher
from walkers import swinging, walking
from robot_states import mode_of, readings_of
from cassie_msgs.layout import MotorCommand, RobotState

def loaded():
    modules = [m for name, m in sys.modules.items() if name.startswith("cassie_")]
    found = {f for m in modules for f in vars(m).values() if isinstance(f, Dispatcher)}
    return sum(len(f.signatures) for f in found)

core, readings = walking(), readings_of(swinging(0))
before = loaded()
core.step(readings, mode_of(vx=0.5, yaw_rate=0.1), MotorCommand())
print(before, loaded())
"""


def test_nothing_is_compiled_or_loaded_any_more_when_it_begins_to_walk():
    """That would take as long as fifteen ticks."""
    folder = str(Path(__file__).parent)
    run = subprocess.run(
        [sys.executable, "-c", LOADED], cwd=folder, capture_output=True, text=True, check=True
    )
    before, after = map(int, run.stdout.split())
    assert 0 < before == after
