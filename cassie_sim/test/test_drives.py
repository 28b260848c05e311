"""Drives: the law with known answers, bound, delay, power, watchdog, refusals."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cassie_gaits import robot
from cassie_gaits.drive_limits import DAMPING
from cassie_gaits.names import DRIVES, LEG_DRIVES
from cassie_msgs.layout import MotorCommand
from cassie_sim.drives import Drives
from cassie_sim.errors import CommandError

PERIOD = 0.0005
ONES = np.ones(10)
REST = np.zeros(10)
LIMIT = np.array([robot.DRIVES[name].torque_limit for name in LEG_DRIVES] * 2)
NO_LOAD = np.array([robot.DRIVES[name].speed_limit for name in LEG_DRIVES] * 2)


def drives(delay: float = 0.0, constant: np.ndarray = ONES) -> Drives:
    made = Drives(PERIOD, delay, constant, watchdog=0.02)
    made.powered = True
    return made


def command(**fields: float | np.ndarray) -> MotorCommand:
    made = MotorCommand()
    for name, value in fields.items():
        getattr(made, name)[:] = value
    return made


def test_limits_are_those_of_the_real_drives():
    np.testing.assert_allclose(LIMIT[:5], [112.5, 112.5, 195.2, 195.2, 45.0])
    turns_a_minute = NO_LOAD[:5] * 60.0 / (2.0 * math.pi)
    np.testing.assert_allclose(turns_a_minute, [116.0, 116.0, 81.25, 81.25, 110.0])


def test_impedance_law():
    unit = drives()
    unit.set_points(command(torque=1.0, position=0.3, velocity=0.5, kp=20.0, kd=4.0))
    # 1 + 20 (0.3 - 0.1) + 4 (0.5 - 0.25)
    np.testing.assert_allclose(unit.step(0.1 * ONES, 0.25 * ONES), 6.0)


def test_each_drive_has_its_own_set_points():
    unit = drives()
    unit.set_points(command(torque=np.arange(10.0)))
    np.testing.assert_allclose(unit.step(REST, REST), np.arange(10.0))


@pytest.mark.parametrize(
    ("speed", "share"), [(0.0, 1.0), (0.5, 1.0), (0.75, 0.5), (0.9, 0.2), (1.0, 0.0), (1.5, 0.0)]
)
@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("turning", [1.0, -1.0])
def test_torque_is_bounded_by_speed(speed, share, direction, turning):
    unit = drives()
    unit.set_points(command(torque=direction * 1000.0))
    torque = unit.step(REST, turning * speed * NO_LOAD)
    np.testing.assert_allclose(torque, direction * share * LIMIT, atol=1e-9)


def test_torque_constant_scales_what_acts():
    constant = np.linspace(0.97, 1.03, 10)
    unit = drives(constant=constant)
    unit.set_points(command(torque=10.0))
    np.testing.assert_allclose(unit.step(REST, REST), 10.0 * constant)


def test_torque_acts_exactly_six_steps_later():
    unit = drives(delay=robot.DRIVE_DELAY)
    unit.set_points(command(torque=7.0))
    acting = [unit.step(REST, REST)[0] for _ in range(8)]
    assert acting == [0.0] * 6 + [7.0] * 2


def test_power_off_takes_the_torque_within_one_step_and_forgets_what_is_under_way():
    unit = drives(delay=robot.DRIVE_DELAY)
    unit.set_points(command(torque=7.0))
    for _ in range(10):
        unit.step(REST, REST)
    unit.powered = False
    np.testing.assert_array_equal(unit.step(REST, REST), 0.0)
    unit.powered = True
    acting = [unit.step(REST, REST)[0] for _ in range(7)]
    assert acting == [0.0] * 6 + [7.0]


def test_watchdog_damps_after_20_ms():
    unit = drives()
    unit.set_points(command(torque=5.0))
    for _ in range(40):
        unit.step(REST, 0.5 * ONES)
        assert not unit.damped
    np.testing.assert_allclose(unit.step(REST, 0.5 * ONES), -0.5 * DAMPING)
    assert unit.damped


def test_each_command_feeds_the_watchdog():
    unit = drives()
    for _ in range(10):
        unit.set_points(command(torque=5.0))
        for _ in range(40):
            unit.step(REST, REST)
    assert not unit.damped


@pytest.mark.parametrize(
    ("field", "index", "value", "message"),
    [
        ("torque", 3, math.nan, "torque of left_knee is nan, must be finite"),
        ("position", 9, math.inf, "position of right_toe is inf, must be finite"),
        ("velocity", 0, -math.inf, "velocity of left_hip_roll is -inf, must be finite"),
        ("kp", 7, 9000.0, "kp of right_hip_pitch is 9000, must be 0 .. 5000"),
        ("kp", 5, -1.0, "kp of right_hip_roll is -1, must be 0 .. 5000"),
        ("kd", 4, 501.0, "kd of left_toe is 501, must be 0 .. 500"),
        ("kd", 1, math.nan, "kd of left_hip_yaw is nan, must be finite"),
        ("torque", 2, 1e300, "torque of left_hip_pitch is 1e+300, must be -1e"),
    ],
)
def test_bad_value_is_refused_by_name_and_changes_nothing(field, index, value, message):
    unit = drives()
    unit.set_points(command(torque=5.0))
    bad = command(torque=6.0)
    getattr(bad, field)[index] = value
    assert DRIVES[index] in message
    with pytest.raises(CommandError, match="motor command refused: " + message.replace("+", r"\+")):
        unit.set_points(bad)
    np.testing.assert_allclose(unit.step(REST, REST), 5.0)


def test_the_next_valid_command_ends_damping():
    unit = drives()
    unit.damp()
    np.testing.assert_allclose(unit.step(REST, ONES), -DAMPING)
    unit.set_points(command(torque=3.0))
    assert not unit.damped
    np.testing.assert_allclose(unit.step(REST, ONES), 3.0)


def test_largest_values_together_stay_finite():
    unit = drives()
    unit.set_points(command(torque=1e6, position=1e6, velocity=-1e6, kp=5000.0, kd=500.0))
    assert np.isfinite(unit.step(REST, REST)).all()


def test_reset_is_off_and_damped():
    unit = drives(delay=robot.DRIVE_DELAY)
    unit.set_points(command(torque=7.0))
    for _ in range(10):
        unit.step(REST, REST)
    unit.reset()
    assert unit.damped and not unit.powered
    np.testing.assert_array_equal(unit.applied, 0.0)
    unit.powered = True
    assert [unit.step(REST, REST)[0] for _ in range(10)] == [0.0] * 10
