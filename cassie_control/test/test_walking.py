"""Walking: desired outputs, their continuity, and the drives' set-points that bring them about."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from robot_states import (
    DRIVE_JOINTS,
    leg_joints,
    mirrored_command,
    mirrored_mode,
    mirrored_state,
    mode_of,
    random_state,
    readings_of,
    state_of,
)

from cassie_control.controller.config import WalkConfig
from cassie_control.controller.outputs import (
    FOOT_SW,
    LENGTH_ST,
    LENGTH_SW,
    PITCH_SW,
    ROLL_SW,
    YAW_ST,
    YAW_SW,
)
from cassie_control.controller.step_timing import LEFT, RIGHT
from cassie_control.controller.walking import WalkingController
from cassie_gaits.provisional import provisional_library
from cassie_msgs.layout import MotorCommand

LIBRARY = provisional_library()
CONFIG = WalkConfig()
STANCES = pytest.mark.parametrize("stance", [LEFT, RIGHT])


def walking(stance=LEFT, period=0.002, config=CONFIG, state=None):
    core = WalkingController(config, LIBRARY, period)
    core.start(readings_of(state or state_of(leg_joints(), leg_joints())), stance)
    return core


def swinging(stance, swing_force=0.0):
    """A state in the middle of a step: the stance leg carries the weight."""
    forces = (330.0, swing_force) if stance == LEFT else (swing_force, 330.0)
    return state_of(leg_joints(), leg_joints(knee=-1.3), forces=forces)


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
    assert core.desired[kept] == pytest.approx(core.outputs[kept], abs=1e-12)
    # The leg's own rates jump at the impact, so only what the torso carries along goes on.
    carried = [ROLL_SW, PITCH_SW]
    assert core.desired_rates[carried] == pytest.approx(core.rates[carried], abs=1e-9)
    held = [YAW_ST, LENGTH_ST, YAW_SW, LENGTH_SW, FOOT_SW]
    assert core.desired_rates[held] == pytest.approx(0.0, abs=1e-9)


@STANCES
def test_desired_rates_are_the_derivatives_of_the_desired_outputs(stance):
    period = 1e-5
    core, command, state = walking(stance, period), MotorCommand(), swinging(stance)
    core.config = replace(CONFIG, law="paper")
    for phase in (0.1, 0.5, 0.9):
        core.timing.phase = phase
        core.step(readings_of(state), mode_of(), command)
        before, rates = core.desired.copy(), core.desired_rates.copy()
        core.step(readings_of(state), mode_of(), command)
        rows = [LENGTH_ST, LENGTH_SW, FOOT_SW, YAW_SW, YAW_ST]
        slope = (core.desired - before) / period
        assert slope[rows] == pytest.approx(rates[rows], abs=2e-3)


@STANCES
def test_desired_outputs_reach_the_gaits_end(stance):
    core, command, state = walking(stance), MotorCommand(), swinging(stance)
    core.timing.velocity = (0.4, 0.0)
    readings = readings_of(state)
    readings.velocity = (0.4, 0.0, 0.0)
    while core.timing.phase < 0.9999:
        core.step(readings, mode_of(), command)
    gait = LIBRARY.interpolate(core.gait_speed)[0 if stance == RIGHT else 1]
    rows = [LENGTH_ST, LENGTH_SW, FOOT_SW]
    assert core.desired[rows] == pytest.approx(gait[rows, 5], abs=1e-3)


@STANCES
def test_swing_leg_ends_where_leg_angle_adjustment_says(stance):
    law = replace(CONFIG, law="paper", paper_offset=0.05, paper_narrowing=0.0)
    core, command, state = walking(stance, config=law), MotorCommand(), swinging(stance)
    mode = mode_of(trims=(0.02, -0.03, 0.0, 0.0))
    readings = readings_of(state)
    while core.timing.phase < 0.9999:
        core.step(readings, mode, command)
    assert core.desired[PITCH_SW] == pytest.approx(0.07, abs=1e-3)
    assert core.desired[ROLL_SW] == pytest.approx(-0.03, abs=1e-3)


def joints_at(command, state):
    """The state with its driven joints at their set-points, springs relaxed."""
    for leg in range(2):
        q = state.q[6 + 7 * leg : 13 + 7 * leg]
        q[list(DRIVE_JOINTS)] = command.position[5 * leg : 5 * leg + 5]
    return state


@STANCES
@pytest.mark.parametrize("seed", range(5))
def test_outputs_are_zero_if_and_only_if_the_joints_are_at_their_set_points(stance, seed):
    """The remark below eq:hdtilde."""
    state = random_state(seed, roll=0.08, pitch=-0.06)
    state.v[:] = state.com_velocity[:] = 0.0
    state.foot_load[stance] = 1.0
    state.foot_force[1 - stance] = 0.0
    mode = mode_of(roll=0.08, pitch=-0.06)
    # The paper's law does not look at the pose, so the desired outputs hold still meanwhile.
    config = replace(CONFIG, law="paper", least_foot_distance=0.05)
    core = walking(stance, period=1e-12, config=config, state=random_state(seed + 50))
    core.timing.phase = 0.4
    command = MotorCommand()
    for _ in range(2):  # the toe's set-point follows the hip's position
        core.step(readings_of(state), mode, command)
        state = joints_at(command, state)
    core.step(readings_of(state), mode, command)
    assert core.outputs == pytest.approx(core.desired, abs=1e-9)
    for joint, row in ((0, ROLL_SW), (1, YAW_SW), (2, PITCH_SW), (4, FOOT_SW)):
        state.q[6 + 7 * (1 - stance) + DRIVE_JOINTS[joint]] += 0.05
        core.step(readings_of(state), mode, command)
        assert core.outputs[row] - core.desired[row] == pytest.approx(
            0.05 if joint != 4 else 0.1,  # the foot turns with the hip too
            abs=1e-6,
        )


@STANCES
def test_swing_set_points_are_eq_hdtilde(stance):
    core, command = walking(stance, state=random_state(9)), MotorCommand()
    state = swinging(stance)
    state.q[4:6] = (0.1, -0.05)
    core.timing.phase = 0.5
    core.step(readings_of(state), mode_of(), command)
    h = core.desired
    swing = command.position[5 * (1 - stance) : 5 * (1 - stance) + 5]
    length = h[LENGTH_SW]
    knee = -np.arccos((length**2 - 0.5292**2 - 0.25) / 0.5292) - 0.035
    lean = np.arccos((0.5 * np.cos(knee + 0.035) + 0.5292) / length)
    assert swing[0] == pytest.approx(h[ROLL_SW] + 0.05)
    assert swing[1] == pytest.approx(h[YAW_SW])
    assert swing[2] == pytest.approx(h[PITCH_SW] + 0.1 + lean - 0.1)
    assert swing[3] == pytest.approx(knee)
    q3 = state.q[6 + 7 * (1 - stance) + 2]
    assert swing[4] == pytest.approx(h[FOOT_SW] + 0.1 - q3 - np.radians(63.0))


@STANCES
def test_the_stance_toe_gives_no_torque(stance):
    core, command = walking(stance), MotorCommand()
    command.floats[:] = 1.0
    readings = readings_of(swinging(stance))
    for _ in range(100):
        core.step(readings, mode_of(), command)
    toe = 5 * stance + 4
    assert command.torque[toe] == command.kp[toe] == command.kd[toe] == 0.0
    assert command.kp[5 * (1 - stance) + 4] > 0.0


@STANCES
def test_torso_errors_act_through_the_loaded_stance_hip(stance):
    core, command, state = walking(stance), MotorCommand(), swinging(stance)
    state.q[4:6] = (0.1, 0.07)
    core.step(readings_of(state), mode_of(), command)
    joints = state.q[6 + 7 * stance : 13 + 7 * stance]
    roll, _, pitch, _, _ = command.position[5 * stance : 5 * stance + 5]
    # With the foot on the ground q3 = pitch + const and q1 = const - roll (eq:IK).
    assert pitch - joints[2] == pytest.approx(-0.1)
    assert roll - joints[0] == pytest.approx(0.07)
    state.foot_load[stance] = 0.0
    core.step(readings_of(state), mode_of(), command)
    assert command.position[5 * stance + 2] == pytest.approx(joints[2])


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
    core, command, state = walking(), MotorCommand(), swinging(LEFT)
    lengths, readings = [], readings_of(state)
    while not core.step(readings, mode_of(), command):
        lengths.append((core.timing.phase, core.desired[LENGTH_SW]))
    planned = next(length for phase, length in lengths if phase >= 1.0)
    late = [length for phase, length in lengths if phase > 1.0]
    assert (np.diff(late) > 0.0).all()
    assert late[-1] - planned == pytest.approx(0.25 * 0.4 * 0.3, abs=3e-3)


def test_weight_is_fed_forward_to_the_leg_that_carries_it():
    core, command = walking(), MotorCommand()
    core.step(readings_of(swinging(LEFT)), mode_of(), command)
    stance, swing = command.torque.reshape(2, 5)
    assert stance[3] > 50.0  # Nm, the knee is pushed straight
    assert np.abs(swing).max() == 0.0


def test_hip_yaws_turn_towards_the_heading_within_their_bound():
    core, command, state = walking(), MotorCommand(), swinging(LEFT)
    for yaw, sign in ((0.2, -1.0), (-5.0, 1.0)):
        state.q[3] = yaw
        core.timing.phase = 0.99
        core.step(readings_of(state), mode_of(), command)
        expected = sign * min(CONFIG.yaw_limit, CONFIG.heading_gain * abs(yaw))
        assert core.desired[YAW_SW] == pytest.approx(expected, abs=5e-3)


def test_turning_does_not_wind_up_while_the_robot_is_held():
    core, command, readings = walking(), MotorCommand(), readings_of(swinging(LEFT))
    for _ in range(3000):
        core.step(readings, mode_of(yaw_rate=0.5), command)
    for _ in range(1000):  # back by less than what was asked for
        core.step(readings, mode_of(yaw_rate=-0.5), command)
    core.timing.phase = 0.99
    core.step(readings, mode_of(), command)
    assert core.desired[YAW_SW] == pytest.approx(-0.25, abs=5e-3)


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
    assert changed.timing.steps == same.timing.steps > 3
    assert command.to_bytes() == other.to_bytes()


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


def test_the_library_is_read_within_its_range():
    core = walking()
    core.timing.velocity = (9.0, 0.0)
    assert core.gait_speed == LIBRARY.speed_range[1]
