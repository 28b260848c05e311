"""Set-points of the drives that bring the desired outputs about."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from robot_states import (
    DRIVE_JOINTS,
    mode_of,
    random_state,
    readings_of,
)
from walkers import CONFIG, swinging, walking, weight_torques

from cassie_control.control.outputs import FOOT_SW, LENGTH_SW, PITCH_SW, ROLL_SW, YAW_SW
from cassie_control.planner.timing import LEFT, RIGHT
from cassie_gaits.robot import WEIGHT
from cassie_msgs.layout import MotorCommand

STANCES = pytest.mark.parametrize("stance", [LEFT, RIGHT])


def joints_at(command, state):
    """The state with its driven joints at their set-points, springs relaxed."""
    for leg in range(2):
        q = state.q[6 + 7 * leg : 13 + 7 * leg]
        q[list(DRIVE_JOINTS)] = command.position[5 * leg : 5 * leg + 5]
    return state


def step_and_measure(core, state, mode, command):
    readings = readings_of(state)
    core.step(readings, mode, command)
    core.measure(readings)


@STANCES
@pytest.mark.parametrize("seed", range(5))
def test_outputs_are_zero_if_and_only_if_the_joints_are_at_their_set_points(stance, seed):
    """The remark below eq:hdtilde."""
    state = random_state(seed, roll=0.08, pitch=-0.06)
    state.v[:] = state.com_velocity[:] = 0.0
    state.foot_load[stance], state.foot_load[1 - stance] = 1.0, 0.0
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
    step_and_measure(core, state, mode, command)
    assert core.plan.measured == pytest.approx(core.plan.desired, abs=1e-9)
    for joint, row in ((0, ROLL_SW), (1, YAW_SW), (2, PITCH_SW), (4, FOOT_SW)):
        state.q[6 + 7 * (1 - stance) + DRIVE_JOINTS[joint]] += 0.05
        step_and_measure(core, state, mode, command)
        assert core.plan.measured[row] - core.plan.desired[row] == pytest.approx(
            0.05 if joint != 4 else 0.1,  # the foot turns with the hip too
            abs=1e-6,
        )


@STANCES
def test_swing_set_points_are_eq_hdtilde(stance):
    core, command = walking(stance, state=random_state(9)), MotorCommand()
    state = swinging(stance)
    state.q[4:6] = (0.1, -0.05)
    state.q[9 if stance == RIGHT else 16] = -2.2  # drawn up: nothing holds the knee back
    core.timing.phase = 0.5
    core.step(readings_of(state), mode_of(), command)
    h = core.plan.desired
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
def test_swing_velocities_are_the_derivatives_of_the_set_points(stance):
    dt = 1e-6
    still = dict.fromkeys(("paper_kp_x", "paper_kd_x", "paper_kp_y", "paper_kd_y"), 0.0)
    config = replace(CONFIG, law="paper", heading_gain=0.0, paper_narrowing=0.0, **still)
    state = random_state(7, roll=0.05, pitch=0.1)
    state.v[:3] = state.com_velocity[:] = 0.0
    state.foot_load[1 - stance] = state.foot_force[1 - stance] = 0.0
    core = walking(stance, period=dt, config=config, state=random_state(8))
    core.timing.phase = 0.4
    swing = slice(5 * (1 - stance), 5 * (1 - stance) + 5)
    command, before = MotorCommand(), np.zeros(5)
    core.step(readings_of(state), mode_of(), command)
    before[:] = command.position[swing]
    state.q[:] += dt * state.v
    core.step(readings_of(state), mode_of(), command)
    slope = (command.position[swing] - before) / dt
    assert command.velocity[swing] == pytest.approx(slope, abs=1e-3)


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


@STANCES
def test_a_swing_leg_that_still_carries_weight_holds_the_torso_instead_of_swinging(stance):
    """The drives' torque is that of the torso's law by the leg's share of the weight."""
    core, command, state = walking(stance), MotorCommand(), swinging(stance)
    core.timing.phase = 0.3
    state.q[4:6] = (0.1, 0.07)
    readings = readings_of(state)
    core.step(readings, mode_of(), command)
    at = 5 * (1 - stance)
    joints = np.array(readings.legs[1 - stance].joints)[[0, 2]]
    drives = [at, at + 2]
    swung = command.kp[drives] * (command.position[drives] - joints)
    state.foot_load[1 - stance], state.foot_force[1 - stance] = 1.0, 200.0
    core.step(readings_of(state), mode_of(), command)
    torque = command.kp[drives] * (command.position[drives] - joints)
    torso = np.array([CONFIG.kp_torso_roll * 0.07, -CONFIG.kp_torso_pitch * 0.1])
    assert np.abs(swung).max() > 5.0
    assert torque == pytest.approx(0.5 * torso, abs=1e-3)


@STANCES
def test_a_swing_foot_that_is_still_pressed_down_is_drawn_up(stance):
    lengths = []
    for force in (0.0, 130.0):
        core, state = walking(stance, period=1e-9), swinging(stance)
        core.timing.phase = 0.4
        state.foot_force[1 - stance] = force
        core.step(readings_of(state), mode_of(), MotorCommand())
        lengths.append(core.plan.desired[LENGTH_SW])
    assert lengths[1] == pytest.approx(lengths[0] - 0.05, abs=1e-6)


@STANCES
def test_the_stance_hip_takes_to_the_ground_what_swinging_does_to_the_torso(stance):
    core, command = walking(stance, state=random_state(3)), MotorCommand()
    core.timing.phase = 0.15
    readings = readings_of(swinging(stance))
    core.step(readings, mode_of(), command)
    added = (command.torque - weight_torques(core, readings)).reshape(2, 5)
    assert np.abs(added[1 - stance, 2]) > 1.0  # Nm
    for joint in (0, 2):
        assert added[stance, joint] == pytest.approx(-added[1 - stance, joint])
    assert added[stance, [1, 3, 4]] == pytest.approx(0.0)


def test_under_the_papers_law_the_torques_carry_the_weight_alone():
    core, command = walking(config=replace(CONFIG, law="paper")), MotorCommand()
    core.timing.phase = 0.15
    readings = readings_of(swinging(LEFT))
    core.step(readings, mode_of(), command)
    assert (command.torque == weight_torques(core, readings)).all()


def test_weight_is_fed_forward_to_the_leg_that_carries_it():
    core, readings = walking(), readings_of(swinging(LEFT))
    core.step(readings, mode_of(), MotorCommand())
    stance, swing = weight_torques(core, readings).reshape(2, 5)
    assert stance[3] > 50.0  # Nm, the knee is pushed straight
    assert np.abs(swing).max() == 0.0


@pytest.mark.parametrize(("law", "rise"), [("pendulum", 0.2), ("pendulum", -0.3), ("paper", 0.2)])
def test_the_stance_leg_presses_less_while_the_com_rises_but_not_under_the_papers_law(law, rise):
    config = replace(CONFIG, law=law, slope_time=0.0)
    core, state = walking(config=config), swinging(LEFT)

    def stance_torques():
        readings = readings_of(state)
        core.step(readings, mode_of(), MotorCommand())
        return weight_torques(core, readings)[:4]

    still = stance_torques()
    state.com_velocity[2] = rise
    damping = config.bounce_damping if law == "pendulum" else 0.0
    assert stance_torques() == pytest.approx(still * (1.0 - damping * rise / WEIGHT), abs=0.5)


@pytest.mark.parametrize("law", ["pendulum", "paper"])
def test_weight_goes_over_with_the_forces_of_the_feet_but_by_loads_under_the_papers_law(law):
    """Loads saturate at 200 N: by them the change is steep, and rings in the leg springs."""
    config = replace(CONFIG, law=law)

    def knee(force):
        core, readings = walking(config=config), readings_of(swinging(LEFT, swing_force=force))
        core.step(readings, mode_of(), MotorCommand())
        return weight_torques(core, readings)[8]

    by_law = {"pendulum": (0.0, 50.0 / 330.0, 100.0 / 380.0), "paper": (0.0, 0.0, 0.5 / 1.5)}
    half = knee(330.0)
    for force, share in zip((50.0, 100.0, 150.0), by_law[law], strict=True):
        assert knee(force) / half == pytest.approx(share / 0.5, abs=0.01)


@STANCES
def test_feed_forward_holds_a_force_from_the_foot_through_the_com(stance):
    """Virtual work: turning a hip moves the foot against that force."""
    core, state = walking(stance), swinging(stance)
    state.com_velocity[:2] = (0.3, 0.2)
    readings = readings_of(state)
    core.step(readings, mode_of(), MotorCommand())
    torques = weight_torques(core, readings)
    foot = np.array(readings.legs[stance].toe_joint)
    line = np.array(readings.com) - foot
    force = WEIGHT * line / line[2]
    for joint in range(3):
        state.q[6 + 7 * stance + joint] += 1e-6
        moved = (np.array(readings_of(state).legs[stance].toe_joint) - foot) / 1e-6
        state.q[6 + 7 * stance + joint] -= 1e-6
        assert torques[5 * stance + joint] == pytest.approx(-moved @ force, abs=1e-3)
