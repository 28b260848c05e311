"""Riding: which way is up, what the ground does, and where it leans."""

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

from cassie_control.config import SegwayConfig, StandConfig
from cassie_control.control.compliance import compliance
from cassie_control.control.riding import (
    MovingBalance,
    RidingController,
    VehicleSpeedFilter,
    VerticalFilter,
)
from cassie_control.control.robot import HIP_DOWN, TOE_JOINT_HEIGHT
from cassie_gaits.robot import WEIGHT
from cassie_msgs.layout import MotorCommand

CONFIG, STAND = SegwayConfig(), StandConfig()
PERIOD = 0.002
GRAVITY = 9.81


def test_riding_stands_with_gains_of_its_own_and_for_the_rest_with_those_of_standing():
    stand = replace(STAND, kp_com_x=1.0, kp_knee=2.0, kp_hip_roll=3.0, velocity_bandwidth=4.0)
    riding = replace(CONFIG, kd_com_x=5.0, kd_com_y=6.0)
    assert riding.standing(stand) == replace(
        stand,
        kp_com_x=CONFIG.kp_com_x,
        kd_com_x=5.0,
        kp_com_y=CONFIG.kp_com_y,
        kd_com_y=6.0,
        kd_hip_roll=CONFIG.kd_hip_roll,
        roll_rate_length=CONFIG.roll_rate_length,
        settled_kd_com_x=5.0,
        settled_kd_com_y=6.0,
        settled_kp_hip_roll=3.0,
        settled_bandwidth=4.0,
        rise=0.0,
    )


def crouched():
    return state_of(leg_joints(), leg_joints(), height=0.65)


def test_the_torso_tilts_by_the_gyro_where_the_ground_accelerates():
    level, state = VerticalFilter(PERIOD), crouched()
    level.start(state)
    state.angular_velocity[1] = 0.1
    state.q[4] = -0.2  # what the estimate makes of the acceleration
    for _ in range(500):
        found = level.corrected(state, 120.0, (2.0, 0.0))
    assert found.q[4] == pytest.approx(0.1, abs=0.002)
    assert found.v[4] == pytest.approx(0.1, abs=1e-6)


def test_at_rest_the_estimate_comes_in_over_its_time():
    level, state = VerticalFilter(PERIOD), crouched()
    level.start(state)
    state.q[5] = 0.1
    for _ in range(500):
        found = level.corrected(state, 1.0, (0.0, 0.0))
    assert found.q[5] == pytest.approx(0.1 * (1.0 - np.exp(-1.0)), rel=0.01)


def test_the_com_moves_with_the_vertical_and_its_velocity_is_seen_from_the_feet():
    level, state = VerticalFilter(PERIOD), crouched()
    level.start(state)
    before = float(state.com_position[0])
    state.q[4] = -0.05
    state.com_velocity[0] = 3.0  # that of the vehicle
    found = level.corrected(state, 1000.0, (2.0, 0.0))
    assert found.com_position[0] - before == pytest.approx(0.05 * found.com_position[2], rel=1e-3)
    state.com_position[0] += 0.001
    found = level.corrected(state, 1000.0, (2.0, 0.0))
    assert found.com_velocity[0] == pytest.approx(0.001 / PERIOD, rel=0.01)


class Pendulum:
    """A point mass above feet on ground that accelerates, held by `MovingBalance`."""

    def __init__(self, config=CONFIG) -> None:
        self.readings = readings_of(crouched())
        self.balance = MovingBalance(config, STAND, PERIOD)
        self._middle = self.readings.com[0] - self.readings.com_from_feet[0]
        self._height = self.readings.com_from_feet[2]
        self.x = self.v = self.gained = 0.0
        self._show()
        self.balance.start(self.readings)

    def _show(self) -> None:
        _, y, z = self.readings.com
        self.readings.com = (self._middle + self.x, y, z)
        self.readings.com_from_feet = (self.x, 0.0, self._height)
        self.readings.com_velocity = (self.v, 0.0, 0.0)

    def run(self, duration: float, acceleration: float, com_x: float = 0.0) -> None:
        """The ground's acceleration (m/s^2) comes up in a second."""
        mode = mode_of(height=0.65, com_x=com_x)
        for tick in range(round(duration / PERIOD)):
            ground = acceleration * min(1.0, tick * PERIOD)
            self._show()
            self.balance.step(self.readings, mode, 0.0, (1.0, 1.0))
            self.gained += self.balance.speed_change
            fall = GRAVITY * (self.x - self.balance.cop_x) / self._height
            self.v += PERIOD * (fall - ground)
            self.x += PERIOD * self.v


@pytest.mark.parametrize("acceleration", [0.0, 0.5, -0.5])
def test_the_grounds_acceleration_is_found_and_the_com_held_in_spite_of_it(acceleration):
    pendulum = Pendulum()
    wanted = 0.04 * acceleration  # a Segway goes where it leans
    pendulum.run(6.0, acceleration, wanted)
    assert pendulum.balance.acceleration[0] == pytest.approx(acceleration, abs=0.02)
    assert pendulum.gained == pytest.approx(5.5 * acceleration, abs=0.1)
    assert pendulum.x == pytest.approx(wanted, abs=0.005)
    assert abs(pendulum.v) < 0.005


def test_what_standing_learnt_of_the_com_holds_while_riding():
    seen, felt = crouched(), crouched()
    seen.com_position[0] += 0.01
    _, command = ridden(felt, mode_of(height=0.65), 500, com_error=(0.01, 0.0))
    _, same = ridden(seen, mode_of(height=0.65), 500)
    np.testing.assert_allclose(command.torque, same.torque, atol=1e-9)
    _, other = ridden(felt, mode_of(height=0.65), 500)
    assert np.abs(command.torque - other.torque).max() > 1.0


def ridden(state, mode, ticks=1, config=CONFIG, com_error=(0.0, 0.0)):
    """The controller and its command after so many ticks in one state."""
    core, command, readings = (
        RidingController(config, STAND, PERIOD),
        MotorCommand(),
        readings_of(state),
    )
    core.start(readings, com_error)
    for _ in range(ticks):
        core.step(readings, mode, command)
    return core, command


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_left_and_right_are_alike(seed):
    state, mode = random_state(seed), mode_of(height=0.65, com_x=0.03, com_y=0.05)
    _, command = ridden(state, mode, 5)
    _, other = ridden(mirrored_state(state), mirrored_mode(mode), 5)
    mirrored = mirrored_command(other)
    for name in ("torque", "position", "kp"):
        np.testing.assert_allclose(getattr(command, name), getattr(mirrored, name), atol=1e-9)


@pytest.mark.parametrize(("speed", "left"), [(4.0, 1.0), (2.0, CONFIG.roll_give)])
def test_where_bumps_come_fast_hips_stay_stiff_as_one_foot_carries_it(speed, left):
    """A platform that rolls on a lawn steers: limp hips would throw the torso to and fro."""
    pendulum = Pendulum()
    balance, readings = pendulum.balance, pendulum.readings
    readings.com_velocity = (0.0, 0.5, 0.0)
    for _ in range(50):
        balance.vehicle.speed = speed
        balance.step(readings, mode_of(height=0.65), 0.0, (1.0, 1.0))
    assert balance.left_share == 1.0
    assert balance.torso_regulation[1] == pytest.approx(left)


def test_where_bumps_come_fast_speed_to_a_side_shifts_less_weight():
    def shifted(speed: float) -> float:
        pendulum = Pendulum()
        balance, readings = pendulum.balance, pendulum.readings
        readings.com_velocity = (0.0, 0.1, 0.0)
        for _ in range(50):
            balance.vehicle.speed = speed
            balance.step(readings, mode_of(height=0.65), 0.0, (1.0, 1.0))
        return balance.left_share - 0.5

    assert shifted(2.0) == pytest.approx(shifted(0.0))
    assert 0.05 < shifted(4.0) < 0.85 * shifted(0.0)
    assert shifted(-4.0) == pytest.approx(shifted(4.0))


@pytest.mark.parametrize("higher", [0.0, 0.03])
def test_where_bumps_come_fast_legs_differ_until_one_foot_carries_it(higher):
    """Legs that differ by more would throw it from foot to foot."""
    pendulum = Pendulum()
    balance, readings = pendulum.balance, pendulum.readings
    left, right = readings.legs
    x, y, z = right.toe_joint
    readings.legs = (replace(left, toe_joint=(x, -y, z + higher)), right)
    balance.left_share = 0.7
    weight = 2.0 * WEIGHT * compliance(readings.height - HIP_DOWN - TOE_JOINT_HEIGHT)
    bounds = {1.0: 0.7 * weight, 0.01: 0.01, -0.01: -0.01, -1.0: -0.3 * weight}
    for wanted, permitted in bounds.items():
        for speed, expected in ((4.0, permitted), (-4.0, permitted), (2.0, wanted)):
            balance.vehicle.speed = speed
            difference = balance.bounded_difference(readings, higher + wanted)
            assert difference == pytest.approx(higher + expected)


def test_who_leans_it_at_a_steady_speed_tells_it_that_speed():
    """In one state all the time the ground seems to accelerate: without him it drifts off."""
    leaning = mode_of(height=0.65, com_x=0.01, vx=3.0)
    told, _ = ridden(crouched(), leaning, 15000)
    silent, _ = ridden(crouched(), mode_of(height=0.65, com_x=0.01), 15000)
    assert told.vehicle.speed == pytest.approx(3.0, abs=0.2)
    assert abs(silent.vehicle.speed - 3.0) > 1.0


class Rolling:
    """A vehicle that goes where its rider leans, and what the filter makes of it."""

    HEIGHT = 0.55

    def __init__(self, error=0.02, neutral=-0.015, seed=1) -> None:
        self.filter = VehicleSpeedFilter(PERIOD)
        self.v = self._noise = 0.0
        self._error, self._neutral = error, neutral
        self._random = np.random.default_rng(seed)

    def lean(self, com_x, seconds, turn=0.0) -> None:
        """`com_x` in m, or a function of the speed (m/s); `turn` in rad/s."""
        for _ in range(round(seconds / PERIOD)):
            x = com_x(self.v) if callable(com_x) else com_x
            a = 0.75 * GRAVITY / self.HEIGHT * (x - self._neutral)
            self.v += PERIOD * a
            self._noise += PERIOD * (self._random.normal(0.0, 0.5) - self._noise)
            felt = a - self._error + self._noise
            self.filter.predict(PERIOD * felt)
            self.filter.correct_by_lean(felt, x, self.HEIGHT)
            self.filter.correct_by_turn(turn, turn * (self.v + 0.4))


def test_what_a_lean_does_tells_where_it_would_do_nothing():
    rolling = Rolling(error=0.0)
    rolling.lean(lambda v: -0.015 + 0.04 * (2.0 - v), 20.0)
    assert rolling.filter.neutral == pytest.approx(-0.015, abs=0.002)
    assert rolling.filter.speed == pytest.approx(2.0, abs=0.2)


def test_a_speed_that_is_seen_tells_the_error_of_what_is_felt():
    rolling = Rolling()
    for _ in range(30 * 500):
        rolling.lean(lambda v: -0.015 + 0.04 * (2.0 - v), PERIOD)
        rolling.filter.correct_by_speed(rolling.v)
    assert rolling.filter.bias == pytest.approx(0.02, abs=0.01)
    assert rolling.filter.neutral == pytest.approx(-0.015, abs=0.002)
    rolling.lean(lambda v: -0.015 + 0.04 * (2.0 - v), 10.0)
    assert rolling.filter.speed == pytest.approx(2.0, abs=0.1)


def test_held_at_rest_an_error_of_the_com_is_found():
    """It looks like an acceleration, and shifts where a lean does nothing."""
    height, error = 0.55, 0.003
    held = VehicleSpeedFilter(PERIOD)
    held.start(-0.02, height)
    felt = GRAVITY / height * error
    for _ in range(10 * 500):
        held.predict(PERIOD * felt)
        held.correct_by_lean(felt, -0.02 + error, height)
        held.correct_by_speed(0.0)
    assert held.bias == pytest.approx(-felt, rel=0.2)
    assert held.neutral == pytest.approx(-0.02 + error, abs=0.001)
    assert abs(held.speed) < 0.05


def test_a_ride_begins_with_the_com_above_the_axle():
    riding, _ = ridden(crouched(), mode_of(height=0.65), 1)
    assert riding.vehicle.neutral == pytest.approx(SegwayConfig().axle_x)
    above = replace(SegwayConfig(), axle_x=0.0)
    riding, _ = ridden(crouched(), mode_of(height=0.65), 1, config=above)
    assert riding.vehicle.neutral == pytest.approx(0.0, abs=1e-6)


def test_at_rest_a_lean_tells_nothing():
    """Somebody may hold the vehicle."""
    still = VehicleSpeedFilter(PERIOD)
    for _ in range(5000):
        still.predict(0.0)
        still.correct_by_speed(0.0)
        still.correct_by_lean(0.0, 0.03, 0.55)
    assert abs(still.neutral) < 1e-3
    assert abs(still.speed) < 1e-3


def turned(turn, pushed, ticks):
    """Speed that it knows after a turn (rad/s) on feet that press beside the CoM all the time.

    The ground goes away to the other side, with the acceleration of a speed `pushed` (m/s).
    """
    standing = readings_of(crouched())
    height, half = standing.com_from_feet[2], standing.legs[0].foot[1]
    push = 0.5 * WEIGHT * pushed * turn * height / (GRAVITY * half)
    state = state_of(
        *(leg_joints(), leg_joints()),
        height=0.65,
        forces=(0.5 * WEIGHT - push, 0.5 * WEIGHT + push),
    )
    state.v[3] = turn
    return ridden(state, mode_of(height=0.65, com_x=0.001), ticks)[0].vehicle.speed


def test_a_turn_tells_the_speed_by_the_grounds_acceleration_to_its_side():
    slow, fast = (turned(0.6, speed, 40000) for speed in (0.5, 1.5))
    assert fast - slow == pytest.approx(1.0, abs=0.05)


def test_a_turn_to_either_side_tells_the_same():
    left, right = (turned(turn, 1.0, 4000) for turn in (0.6, -0.6))
    assert left == pytest.approx(right, abs=0.005)


def test_a_speed_that_has_just_been_asked_for_is_not_taken_for_its_own():
    told, _ = ridden(crouched(), mode_of(height=0.65, com_x=0.01, vx=3.0), 2000)
    silent, _ = ridden(crouched(), mode_of(height=0.65, com_x=0.01), 2000)
    assert told.vehicle.speed == pytest.approx(silent.vehicle.speed, abs=1e-9)


def com_shift(core):
    """Set-point of the CoM after all bounds, forward and to the left of the feet."""
    return float(core._set_points.com_x), float(core._set_points.com_y)


def leant(ahead=0.0, outward=0.03, **commanded):
    """Where it leans a second after a command, with its CoM so far ahead (m).

    Hips rolled `outward` (rad): by 0.03 the feet are 0.32 m from each other, as on a platform.
    """
    left, right = leg_joints(hip_roll=outward), leg_joints(hip_roll=-outward)
    state = state_of(left, right, height=0.65)
    state.com_position[0] += ahead
    return com_shift(ridden(state, mode_of(height=0.65, **commanded), 500)[0])


def test_the_nearer_the_feet_the_less_it_leans_to_a_side():
    """It ends a walk with feet 0.22 to 0.27 m from each other, and tipped over them."""
    platform, narrow, narrower = (
        leant(ahead=0.03, outward=o, com_y=0.1)[1] for o in (0.03, 0.0, -0.02)
    )
    assert platform == pytest.approx(0.08, abs=0.005)
    assert platform > narrow + 0.01 > narrower + 0.02
    assert narrower > 0.025


def test_far_back_it_does_not_lean_to_a_side():
    """There the outer shin catches the pad of the bar, and its foot slips."""
    assert leant(ahead=0.05, com_y=0.05)[1] == pytest.approx(0.05)
    assert leant(com_y=0.05)[1] == pytest.approx(0.05)
    assert leant(ahead=-0.08, com_y=0.05)[1] < 0.035


@pytest.mark.parametrize(("carried", "left"), [(0.97, 1.0), (0.9, 0.5), (0.8, 0.0)])
def test_it_leans_less_where_the_feet_do_not_carry_it(carried, left):
    """A shin on the bar's pad did: the feet told of rest while it rolled backward, and fell."""
    half = 0.5 * carried * WEIGHT
    state = state_of(leg_joints(), leg_joints(), height=0.65, forces=(half, half))
    for sign in (1.0, -1.0):
        core = ridden(state, mode_of(height=0.65, com_y=0.02 * sign), 1000)[0]
        assert com_shift(core)[1] == pytest.approx(0.02 * sign * left, abs=0.001)


def test_hands_off_it_steers_back_to_the_heading_that_it_had():
    """Only the yaw rate was held, and the heading wandered."""
    core, readings, mode = (
        RidingController(CONFIG, STAND, PERIOD),
        readings_of(crouched()),
        mode_of(vx=2.0),
    )
    core.start(readings)
    core.step(readings, mode, MotorCommand())
    _, ahead = com_shift(core)
    state = crouched()
    state.q[3] -= 0.1
    core.step(readings_of(state), mode, MotorCommand())
    assert com_shift(core)[1] - ahead == pytest.approx(
        CONFIG.kp_yaw_rate * CONFIG.heading_gain * 0.1
    )
    leant = mode_of(vx=2.0, com_x=0.02)
    core.step(readings_of(state), leant, MotorCommand())
    core.step(readings_of(state), mode, MotorCommand())
    assert com_shift(core)[1] == pytest.approx(ahead, abs=1e-6)
