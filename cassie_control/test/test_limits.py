"""No command exceeds what drives and joints bear."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cassie_control.control.limits import MARGIN, limit, stops
from cassie_control.errors import ControlError
from cassie_gaits.drive_limits import KD_LIMIT, KP_LIMIT
from cassie_gaits.names import DRIVES
from cassie_msgs.layout import MotorCommand
from cassie_sim.scenes import scene_spec


def test_stops_are_those_of_the_simulated_robot():
    model = scene_spec("flat", {}).compile()
    low, high = stops()
    for drive, lower, upper in zip(DRIVES, low, high, strict=True):
        true = model.joint(drive).range
        assert upper == pytest.approx(true[1])
        if drive.endswith("knee"):  # the tarsus is at its stop first
            assert true[0] < lower < true[0] + math.radians(10.0)
        else:
            assert lower == pytest.approx(true[0])


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_set_points_stay_inside_the_stops(sign):
    command = MotorCommand()
    command.floats[:] = sign * 1e9
    limit(command)
    low, high = stops()
    edge = high - MARGIN if sign > 0.0 else low + MARGIN
    assert command.position == pytest.approx(edge)
    assert (command.kp == (KP_LIMIT if sign > 0.0 else 0.0)).all()
    assert (command.kd == (KD_LIMIT if sign > 0.0 else 0.0)).all()


def test_a_command_within_the_limits_is_left_alone():
    command = MotorCommand()
    low, high = stops()
    command.torque[:] = 150.0
    command.position[:] = 0.5 * (low + high)
    command.velocity[:] = -8.0
    command.kp[:] = 700.0
    command.kd[:] = 30.0
    before = command.to_bytes()
    limit(command)
    assert command.to_bytes() == before


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_value_that_is_no_number_is_refused_by_name(value):
    command = MotorCommand()
    command.velocity[3] = value
    with pytest.raises(ControlError, match=r"command velocity\[3\] is (nan|inf|-inf)"):
        limit(command)
