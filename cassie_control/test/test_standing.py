"""Standing: what toes, legs and hips are told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from robot_states import (
    leg_joints,
    mirrored_command,
    mirrored_mode,
    mirrored_state,
    mode_of,
    random_state,
    readings_of,
    state_of,
)

from cassie_control.config import StandConfig
from cassie_control.control import standing
from cassie_control.control.balance import Balance
from cassie_control.control.compliance import compliance
from cassie_control.control.robot import HIP_DOWN, TOE_JOINT_HEIGHT
from cassie_control.control.standing import StandingController
from cassie_gaits import virtual_leg
from cassie_gaits.robot import DRIVES, GRAVITY, WEIGHT
from cassie_msgs.layout import MotorCommand

CONFIG = StandConfig()
PERIOD = 0.002
TOES, KNEES, HIP_ROLLS = [4, 9], [3, 8], [0, 5]


def stood(state, mode=None, ticks=1, lean=0.0, config=CONFIG):
    """The command after so many ticks in one state."""
    core, command, readings = (
        StandingController(Balance(config, PERIOD), PERIOD),
        MotorCommand(),
        readings_of(state),
    )
    core.start(readings)
    for _ in range(ticks):
        core.step(readings, mode or mode_of(height=0.9), command, lean)
    return command


def both_feet(com_x=None, **kwargs):
    state = state_of(leg_joints(), leg_joints(), **kwargs)
    state.com_position[0] = 0.0 if com_x is None else com_x
    return state


def lengths(command):
    return [virtual_leg.length(knee) for knee in command.position[KNEES]]


@pytest.fixture
def rigid(monkeypatch):
    """Legs that need not be longer for the weight they get."""
    monkeypatch.setattr(standing, "compliance", lambda length: 0.0)


def test_toes_push_the_com_back():
    still = stood(both_feet()).torque[TOES]
    ahead = stood(both_feet(com_x=0.02)).torque[TOES]
    moving = stood(both_feet(velocity=(0.2, 0.0))).torque[TOES]
    asked = stood(both_feet(com_x=0.02), mode_of(height=0.9, com_x=0.02)).torque[TOES]
    # A positive toe angle lifts the tip: to push forward of the toe joint it turns down.
    assert (ahead < still).all()
    assert (moving < still).all()
    assert (asked > ahead).all()


def test_toe_torque_puts_the_centre_of_pressure_under_the_com():
    state = both_feet(com_x=0.01)
    readings = readings_of(state)
    torque = stood(state).torque[TOES]
    push = CONFIG.kp_com_x * 0.01 / WEIGHT
    lean = -push / readings.com_from_feet[2]
    for leg, value in zip(readings.legs, torque, strict=True):
        arm = readings.com[0] + push - leg.toe_joint[0] + TOE_JOINT_HEIGHT * lean
        assert value == pytest.approx(-0.5 * WEIGHT * arm, rel=5e-3)


@pytest.mark.parametrize("com_x", [-1.0, 1.0])
def test_toe_torque_is_bounded(com_x):
    torque = stood(both_feet(com_x=com_x, velocity=(com_x, 0.0))).torque[TOES]
    assert (np.abs(torque) <= DRIVES["toe"].torque_limit).all()
    assert (torque * com_x < 0.0).all()


def test_a_foot_in_the_air_gets_no_toe_torque_and_keeps_its_sole_level():
    state = both_feet(com_x=0.05, forces=(WEIGHT, 0.0))
    command = stood(state, ticks=500)
    assert command.torque[9] == 0.0
    assert command.kp[9] == pytest.approx(CONFIG.kp_toe, rel=1e-3)
    assert command.position[9] == pytest.approx(virtual_leg.toe_angle(0.0, 0.0, 0.5))


@pytest.mark.parametrize("vy", [-0.2, 0.2])
def test_the_weight_shifts_to_the_side_the_com_moves_to(vy):
    left, right = stood(both_feet(velocity=(0.0, vy))).torque[KNEES]
    assert (left > right) == (vy > 0.0)
    middle = stood(both_feet()).torque[KNEES]
    assert middle[0] == pytest.approx(middle[1], rel=5e-3)  # the pelvis is 0.3 mm out of true


def test_the_weight_on_both_legs_adds_up():
    for vy in (-0.5, 0.0, 0.1):
        torque = stood(both_feet(velocity=(0.0, vy))).torque[KNEES]
        assert torque.sum() == pytest.approx(stood(both_feet()).torque[KNEES].sum(), rel=1e-6)


@pytest.mark.parametrize(("roll", "longer"), [(0.05, 1), (-0.05, 0)])
@pytest.mark.usefixtures("rigid")
def test_the_leg_of_the_lower_side_extends(roll, longer):
    both = lengths(stood(both_feet(roll=roll)))
    assert both[longer] - both[1 - longer] == pytest.approx(CONFIG.roll_length * 0.05, rel=1e-6)


@pytest.mark.usefixtures("rigid")
def test_the_leg_of_a_lifted_foot_does_not_shorten():
    state = both_feet(roll=-0.1, forces=(WEIGHT, 0.0))
    lifted = stood(state, ticks=300)
    assert np.diff(lengths(lifted)) == pytest.approx(0.0, abs=1e-3)
    lean = lengths(stood(both_feet(), lean=-0.08))
    assert lean[1] - lean[0] == pytest.approx(CONFIG.roll_length * 0.08, rel=1e-6)


def test_the_leg_that_gets_more_weight_is_told_to_be_longer(monkeypatch):
    moving = both_feet(velocity=(0.0, 0.05))
    left, right = lengths(stood(moving))
    monkeypatch.setattr(standing, "compliance", lambda length: 0.0)
    stiff_left, stiff_right = lengths(stood(moving))
    by_share = 0.5 * ((left - right) - (stiff_left - stiff_right))
    assert 0.001 < by_share < 0.5 * WEIGHT * compliance(0.8)


@pytest.mark.parametrize(("height", "sign"), [(0.5, 1.0), (1.2, -1.0)])
def test_the_sum_of_the_height_error_is_bounded(height, sign):
    mode = mode_of(height=0.8)
    level = 0.8 - HIP_DOWN - TOE_JOINT_HEIGHT
    level += 0.5 * WEIGHT * compliance(level)
    much_later = np.mean(lengths(stood(both_feet(height=height), mode, ticks=20000)))
    assert much_later == pytest.approx(level + sign * 0.08, abs=2e-3)


def test_loaded_legs_keep_their_length_at_first():
    own = virtual_leg.length(leg_joints()[3])
    for height in (own + 0.09, own + 0.16):
        assert np.mean(lengths(stood(both_feet(), mode_of(height=height)))) == pytest.approx(
            own, abs=1e-3
        )


def test_moving_legs_are_fed_forward():
    """Knees are told their rate, and the force is less while it speeds up and more as it brakes."""
    config = replace(CONFIG, height_integral=0.0, height_damping=0.0)
    controller, command = StandingController(Balance(config, PERIOD), PERIOD), MotorCommand()
    readings = readings_of(both_feet(height=0.9))
    controller.start(readings)
    knees, rates, torques = [], [], []
    for _ in range(1000):
        controller.step(readings, mode_of(height=0.8), command, 0.0)
        knees.append(command.position[KNEES[0]])
        rates.append(command.velocity[KNEES[0]])
        torques.append(command.torque[KNEES[0]])
    moved = np.diff(knees) / PERIOD
    assert np.abs(moved).max() > 0.5
    # The springs get shorter, too, and with the acceleration, which comes and goes within a mode.
    assert np.quantile(np.abs(moved - rates[1:]), 0.9) < 0.1 * np.abs(rates).max()
    assert rates[-1] == 0.0
    more = np.quantile(np.array(torques) / torques[-1] - 1.0, (0.05, 0.95))
    expected = CONFIG.height_acceleration / GRAVITY
    assert more == pytest.approx((-expected, expected), rel=0.05)


def test_legs_give_way_to_the_bounce_of_the_springs():
    still, rising = both_feet(), both_feet()
    rising.v[2] = 0.2
    shorter = np.mean(lengths(stood(rising))) - np.mean(lengths(stood(still)))
    assert shorter == pytest.approx(-0.2 * CONFIG.height_damping, rel=1e-6)


def test_the_height_error_is_not_summed_up_in_the_air():
    state = both_feet(height=0.5, forces=(0.0, 0.0))
    mode = mode_of(height=0.8)
    assert lengths(stood(state, mode, ticks=4000)) == pytest.approx(
        lengths(stood(state, mode, ticks=2000))
    )


@pytest.mark.parametrize("height", [0.4, 1.0])
def test_the_legs_move_smoothly_to_whatever_height(height):
    core, command, readings = (
        StandingController(Balance(CONFIG, PERIOD), PERIOD),
        MotorCommand(),
        None,
    )
    readings = readings_of(both_feet(forces=(0.0, 0.0)))
    core.start(readings)
    found = []
    for _ in range(1500):
        core.step(readings, mode_of(height=height), command, 0.0)
        found.append(np.mean(lengths(command)))
    rate = np.diff(found) / PERIOD
    assert np.abs(rate).max() <= CONFIG.height_rate * 1.01
    assert np.abs(np.diff(rate)).max() <= CONFIG.height_acceleration * PERIOD * 1.5
    length = height - HIP_DOWN - TOE_JOINT_HEIGHT
    assert found[-1] == pytest.approx(length + 0.5 * WEIGHT * compliance(length), abs=1e-6)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_com_is_held_to_be_where_the_feet_press(side):
    """More force on one foot at rest: the CoM is there, whatever its estimate, and is sent back."""
    share = 0.5 + 0.1 * side
    aside = both_feet(forces=(share * WEIGHT, (1.0 - share) * WEIGHT))
    core, command, readings = (
        StandingController(Balance(CONFIG, PERIOD), PERIOD),
        MotorCommand(),
        readings_of(aside),
    )
    core.start(readings)
    knees = []
    for _ in range(5000):
        readings.update(aside, core.com_error)
        core.step(readings, mode_of(height=0.9), command, 0.0)
        knees.append(command.torque[KNEES][0])
    assert (knees[-1] - knees[0]) * side > 1.0
    left, right = readings.legs
    assert core.com_error[1] == pytest.approx(0.1 * side * (left.foot[1] - right.foot[1]), abs=1e-3)


def settled(state, config=CONFIG):
    """The command in a state, of one who has stood calmly before."""
    core, command = StandingController(Balance(config, PERIOD), PERIOD), MotorCommand()
    before = readings_of(both_feet())
    core.start(before)
    for _ in range(round(1.1 * config.settle_time / PERIOD)):
        core.step(before, mode_of(height=0.9), command, 0.0)
    now = readings_of(state)
    for _ in range(20):
        core.step(now, mode_of(height=0.9), command, 0.0)
    return command


def test_joint_rates_that_ring_do_not_shake_the_toes_of_one_who_has_settled():
    """Shin rates come late: in the springs' mode the CoM seems to move, and its place does not."""
    core, command, state = (
        StandingController(Balance(CONFIG, PERIOD), PERIOD),
        MotorCommand(),
        both_feet(),
    )
    core.start(readings_of(state))
    readings, torques = readings_of(state), []
    for tick in range(1000):
        state.stamp_ns = round(1e9 * PERIOD * tick)
        state.com_velocity[0] = 0.2 * np.sin(2.0 * np.pi * 42.0 * PERIOD * tick)
        readings.update(state)
        core.step(readings, mode_of(height=0.9), command, 0.0)
        torques.append(command.torque[4])
    assert np.ptp(torques[:100]) > 5.0
    assert np.ptp(torques[-100:]) < 0.1


@pytest.mark.parametrize("speed", [-0.6, 0.6])
def test_the_torso_bends_to_where_the_feet_cannot_press(speed):
    config = replace(CONFIG, kp_hip_pitch=0.0, kd_hip_pitch=0.0)
    within, beyond = (
        settled(both_feet(velocity=(v, 0.0)), config).torque
        - settled(both_feet(velocity=(v, 0.0)), replace(config, bend_gain=0.0)).torque
        for v in (0.1 * speed, speed)
    )
    assert within[[2, 7]] == pytest.approx(0.0)
    assert (beyond[[2, 7]] * speed > 0.0).all()


def test_who_has_not_settled_meets_a_push_with_less():
    """Ground that has just been met bounces: gains that stop a push would shake it."""
    moving = both_feet(velocity=(0.03, 0.0))
    early = stood(moving, ticks=20).torque[TOES] - stood(both_feet()).torque[TOES]
    later = settled(moving).torque[TOES] - settled(both_feet()).torque[TOES]
    assert (later < 1.2 * early).all()
    assert (early < 0.0).all()


def test_a_push_forward_makes_it_rise_and_others_do_not():
    still, forward, back, aside = (
        np.mean(lengths(settled(both_feet(velocity=v))))
        for v in ((0.0, 0.0), (0.4, 0.0), (-0.4, 0.0), (0.1, 0.4))
    )
    assert forward > still + 1e-3
    assert back == pytest.approx(still, abs=1e-4)
    assert aside == pytest.approx(still, abs=1e-4)


def test_hips_hold_where_the_feet_took_load_and_go_home_in_the_air():
    wide = state_of(leg_joints(hip_roll=0.2), leg_joints(hip_roll=-0.2))
    assert stood(wide, ticks=2000).position[HIP_ROLLS] == pytest.approx([0.2, -0.2])
    wide.contact_probability[:] = wide.foot_force[:] = 0.0
    left, right = stood(wide, ticks=2000).position[HIP_ROLLS]
    assert left == pytest.approx(-right)
    assert 0.0 < left < 0.05


@pytest.mark.parametrize("pitch", [-0.1, 0.1])
def test_torso_pitch_is_regulated_through_both_hips(pitch):
    config = replace(CONFIG, kp_hip_pitch=0.0)
    own = stood(both_feet(pitch=pitch)).torque - stood(both_feet(pitch=pitch), config=config).torque
    assert own[[2, 7]] == pytest.approx(-CONFIG.kp_hip_pitch * pitch)


def test_standing_gains_are_the_configured_ones():
    c = replace(CONFIG, settle_time=1e6)
    for command, hip_roll in (
        (stood(both_feet(), config=c), c.kp_hip_roll),
        (settled(both_feet()), c.settled_kp_hip_roll),
    ):
        kp = (hip_roll, c.kp_hip_yaw, 0.0, c.kp_knee, 0.0)  # toes and hips by torque
        assert command.kp == pytest.approx(kp * 2)
        assert command.kd[2:5] == pytest.approx((c.kd_leg_pitch, c.kd_knee, c.kd_toe))


@pytest.mark.parametrize("seed", range(4))
def test_the_mirror_image_of_a_state_gets_the_mirror_image_of_the_command(seed):
    state = random_state(seed, roll=0.05, pitch=0.1)
    state.foot_force[:] += 80.0
    mode = mode_of(height=0.85, com_x=0.01, com_y=0.02, roll=0.03, pitch=0.04)
    here = stood(state, mode, ticks=20, lean=-0.02)
    there = stood(mirrored_state(state), mirrored_mode(mode), ticks=20, lean=0.02)
    assert there.floats == pytest.approx(mirrored_command(here).floats, abs=1e-9)
