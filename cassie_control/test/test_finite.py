"""Numbers that cannot be computed with are named."""

from __future__ import annotations

import math

import pytest

from cassie_control.errors import ControlError
from cassie_control.finite import LARGEST, check, fault
from cassie_msgs.layout import Mode, OperatorCommand, RobotState


def test_ordinary_numbers_pass():
    state = RobotState()
    state.q[:] = 9e5
    assert fault(state) == ""
    check(state, "state", ControlError)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_named_with_its_place(value):
    state = RobotState()
    state.com_velocity[2] = value
    assert fault(state) == f"com_velocity[2] is {value:g}, must be finite"


def test_what_would_overflow_is_named_with_what_is_permitted():
    mode = Mode()
    mode.vy[...] = -2e6
    assert fault(mode) == f"vy is -2e+06, must be within ±{LARGEST:g}"


def test_the_error_says_which_message():
    command = OperatorCommand()
    command.trims[1] = math.nan
    with pytest.raises(ControlError, match=r"^operator command trims\[1\] is nan, must be finite$"):
        check(command, "operator command", ControlError)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("value", [1e200, -1e308, math.inf, math.nan])
def test_a_value_whose_square_overflows_is_refused_without_a_warning(value):
    state = RobotState()
    state.q[5] = value
    with pytest.raises(ControlError, match=r"q\[5\]"):
        check(state, "state", ControlError)
