"""When modes hold, and what holds when they stay away."""

from __future__ import annotations

import itertools

import pytest

from cassie_control.schedule import ModeTable, StopAndStand
from cassie_msgs.layout import Mode, RobotMode

PERIOD = 0.002


def _mode(effective: int, mode: RobotMode = RobotMode.WALK, vx: float = 0.0) -> Mode:
    sample = Mode()
    sample.effective_seq[...] = effective
    sample.mode[...] = int(mode)
    sample.vx[...] = vx
    return sample


def _table(*effective: int) -> ModeTable:
    table = ModeTable()
    table.reset(7)
    for seq in effective:
        table.add(_mode(seq))
    return table


def test_an_answer_holds_for_its_ten_ticks() -> None:
    table = _table(10, 20)
    for tick in range(10, 30):
        mode = table.at(tick)
        assert mode is not None
        assert int(mode.effective_seq) == tick - tick % 10
    assert table.at(30) is None
    assert not table.may_begin(30)


def test_off_holds_before_the_first_answer_does() -> None:
    table = _table(10)
    for tick in range(10):
        mode = table.at(tick)
        assert mode is not None
        assert mode.mode == RobotMode.OFF
        assert table.may_begin(tick)


def test_robot_time_does_not_begin_without_the_first_answer() -> None:
    assert not _table().may_begin(0)


def test_the_newest_is_the_one_for_the_latest_ticks_in_whatever_order_they_come() -> None:
    assert int(_table(30, 20, 40, 10).newest.effective_seq) == 40
    assert _table().newest.mode == RobotMode.OFF


def test_a_new_episode_forgets() -> None:
    table = _table(10, 20)
    table.reset(8)
    assert table.at(20) is None
    assert int(table.newest.episode) == 8


def test_only_the_latest_are_kept() -> None:
    table = _table(*range(10, 1000, 10))
    assert table.at(990) is not None
    assert table.at(500) is None


def test_a_lost_supervisor_means_slowing_down_stepping_in_place_and_standing() -> None:
    fallback = StopAndStand(PERIOD)
    fallback.start(_mode(500, RobotMode.WALK, vx=0.8))
    speeds, modes = [], []
    for _ in range(round(6.0 / PERIOD)):
        mode = fallback.step()
        speeds.append(float(mode.vx))
        modes.append(int(mode.mode))
    slow_down = 0.8 / StopAndStand.DECELERATION
    assert speeds[0] == pytest.approx(0.8, abs=0.01)
    assert max(a - b for a, b in itertools.pairwise(speeds)) < 0.001
    assert speeds[round(slow_down / PERIOD) + 2] == 0.0
    stands = modes.index(int(RobotMode.STAND)) * PERIOD
    assert stands == pytest.approx(slow_down + StopAndStand.STEPPING_TIME, abs=0.02)
    assert set(modes[modes.index(int(RobotMode.STAND)) :]) == {int(RobotMode.STAND)}
    assert float(mode.transition) == 1.0


@pytest.mark.parametrize("mode", [RobotMode.OFF, RobotMode.DAMP, RobotMode.STAND])
def test_other_modes_stay_without_a_supervisor(mode: RobotMode) -> None:
    fallback = StopAndStand(PERIOD)
    fallback.start(_mode(500, mode))
    for _ in range(2000):
        assert fallback.step().mode == mode


def test_backward_speeds_go_to_zero_too() -> None:
    fallback = StopAndStand(PERIOD)
    fallback.start(_mode(0, RobotMode.WALK, vx=-0.3))
    for _ in range(1000):
        mode = fallback.step()
    assert float(mode.vx) == 0.0


@pytest.mark.parametrize(("mode", "left"), [(RobotMode.SEGWAY, 0.0), (RobotMode.STAND, 1.0)])
def test_only_a_lean_that_drives_a_segway_goes_back_without_a_supervisor(
    mode: RobotMode, left: float
) -> None:
    leaning = _mode(500, mode, vx=4.0)
    leaning.com_x[...], leaning.com_y[...] = 0.09, -0.05
    fallback = StopAndStand(PERIOD)
    fallback.start(leaning)
    for _ in range(round(0.09 / StopAndStand.SHIFT_RATE / PERIOD) + 1):
        answer = fallback.step()
    assert answer.mode == mode
    assert (float(answer.com_x), float(answer.com_y)) == (left * 0.09, left * -0.05)
