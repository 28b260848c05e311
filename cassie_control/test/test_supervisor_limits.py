"""What each limits_in_force permits of a command."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

import cassie_control.supervisor.limits as module
from cassie_control.supervisor.config import SupervisorConfig
from cassie_control.supervisor.limits import command_limits, limits_in_force, on_foot, on_segway
from cassie_control.supervisor.set_points import SetPoints
from cassie_msgs.layout import RobotMode
from cassie_msgs.tunables import ParameterError, replace_checked

C = SupervisorConfig()


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"height_low": 0.9, "height_high": 0.8}, "height_low = 0.9 is above height_high = 0.8"),
        ({"walk_height": 1.05}, "walk_height = 1.05 is above height_high = 1.01"),
        ({"upright_tilt": 0.8, "fall_tilt": 0.3}, "upright_tilt = 0.8 is above fall_tilt = 0.3"),
        ({"ride_height_low": 0.7}, "ride_height_low = 0.7 is above ride_height = 0.67"),
    ],
)
def test_bounds_that_contradict_each_other_are_refused(changes, reason):
    """Between them the height followed no command, and nothing said why."""
    with pytest.raises(ParameterError, match=reason):
        replace_checked(C, **changes)


MODES = (RobotMode.STAND, RobotMode.WALK, RobotMode.SEGWAY)
README = Path(__file__).resolve().parents[1] / "README.md"


def drawn(seed: int) -> SetPoints:
    """A command that asks for anything."""
    rng = np.random.default_rng(seed)
    values = rng.uniform(-2.0, 2.0, 8).tolist()
    trims = rng.uniform(-0.5, 0.5, 4).tolist()
    return SetPoints(*values, trims=tuple(trims))


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("mode", MODES)
def test_the_nearest_permitted_command_is_permitted(mode, seed):
    limits = command_limits(mode, C)
    once = limits.clamp(drawn(seed))
    again = limits.clamp(once)
    for field in fields(SetPoints):
        assert getattr(again, field.name) == pytest.approx(getattr(once, field.name), abs=1e-12)
    assert limits.height_low <= once.height <= limits.height_high
    assert abs(once.roll + once.trims[3]) <= limits.roll + 1e-12
    assert abs(once.pitch + once.trims[2]) <= limits.pitch + 1e-12


@pytest.mark.parametrize("mode", MODES)
def test_what_is_permitted_stays_as_it_is(mode):
    limits = command_limits(mode, C)
    height = 0.5 * (limits.height_low + limits.height_high)
    asked = SetPoints(vx=0.3, height=height, com_x=0.01, pitch=0.02, trims=(0.01, 0.0, 0.005, 0.0))
    assert limits.clamp(asked) == asked


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_speeds_asked_for_at_once_are_scaled_down_together(sign):
    most = on_foot(C)
    asked = SetPoints(vx=most.vx_forward, vy=sign * most.vy, yaw_rate=-sign * most.yaw_rate)
    found = most.clamp(asked)
    assert found.vx / asked.vx == pytest.approx(3.0 ** (-1.0 / 3.0))
    assert found.vy / asked.vy == pytest.approx(found.vx / asked.vx)
    assert found.yaw_rate / asked.yaw_rate == pytest.approx(found.vx / asked.vx)


def test_a_rider_turns_less_while_it_rides_fast():
    most = on_segway(C)
    found = most.clamp(SetPoints(vx=most.vx_forward, yaw_rate=-most.yaw_rate))
    assert found.vx / most.vx_forward == pytest.approx(np.sqrt(0.5))
    assert found.yaw_rate / most.yaw_rate == pytest.approx(-np.sqrt(0.5))


def test_a_fast_turn_with_a_step_aside_is_walked_as_commanded():
    asked = SetPoints(vx=1.0, vy=0.2, yaw_rate=0.4)
    found = on_foot(C).clamp(asked)
    assert (found.vx, found.vy, found.yaw_rate) == pytest.approx((1.0, 0.2, 0.4))


@pytest.mark.parametrize("requested", MODES)
@pytest.mark.parametrize("current", MODES)
def test_nobody_moves_in_a_mode_that_is_not_asked_for(current, requested):
    limits = limits_in_force(C, current, requested, stepping=False, walked=False)
    found = limits.clamp(SetPoints(vx=0.5, vy=0.1, yaw_rate=0.2, height=0.65))
    moves = current is requested is not RobotMode.STAND
    assert (found.vx, found.vy, found.yaw_rate) == ((0.5, 0.1, 0.2) if moves else (0.0, 0.0, 0.0))


def test_a_ride_that_ends_brakes_at_once_and_leans_nowhere():
    limits = limits_in_force(C, RobotMode.SEGWAY, RobotMode.STAND, stepping=False, walked=False)
    now = SetPoints(vx=3.0, height=0.65, com_x=0.05)
    limits.approach(now, limits.clamp(SetPoints(vx=3.0, height=0.95, com_x=0.05)), 0.02)
    assert now.vx == 0.0
    assert now.com_x == pytest.approx(0.05 - 0.02 * on_segway(C).shift_rate)
    assert now.height == pytest.approx(0.65 + 0.02 * C.ride_height_rate)


def test_standing_takes_over_from_walking_upright():
    for walked, current in ((True, RobotMode.STAND), (False, RobotMode.WALK)):
        limits = limits_in_force(C, current, RobotMode.STAND, stepping=False, walked=walked)
        found = limits.clamp(SetPoints(roll=0.1, pitch=0.1, height=0.7, trims=(0.01,) * 4))
        assert (found.roll, found.pitch, *found.trims[2:]) == (0.0, 0.0, 0.0, 0.0)
        assert found.height == C.walk_height


def test_the_readme_has_the_table_of_the_code():
    def rows(text: str) -> list[str]:
        lines = [line.strip() for line in text.replace("`", "").splitlines()]
        begin = lines.index("|---|---|---|---|---|---|")
        table = []
        for line in lines[begin + 1 :]:
            if not line.startswith("|"):
                break
            table.append([cell.strip() for cell in line.strip("|").split("|")])
        return table

    text = README.read_text(encoding="utf-8")
    readme = rows(text[text.index("| mode in force | asked for |") :])
    code = rows(module.limits_in_force.__doc__ or "")
    assert [row[:3] for row in readme] == [row[:3] for row in code]
