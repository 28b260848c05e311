"""Messages of another build, or without a time, cost no node a traceback."""

from __future__ import annotations

import time

import numpy as np
import pytest

from cassie_control.ros.common import RateCheck
from cassie_control.ros.mode_source import ModeSource
from cassie_control.ros.operator_source import OperatorSource
from cassie_msgs.layout import Mode, OperatorCommand, RobotMode, RobotState
from cassie_msgs.ros.fast_lane import LanePublisher, LaneSubscription
from cassie_msgs.ros.process import Stop


class Told(dict):
    """Conditions by subject."""

    def set(self, subject, problem):
        self[subject] = problem


def until(holds):
    deadline = time.monotonic() + 10.0
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_a_mode_of_another_layout_is_told_and_the_next_one_holds(node):
    told = Told()
    modes = ModeSource(node, Stop(), LaneSubscription(node, RobotState), told, 0.002)
    modes.reset(1)
    publisher = LanePublisher(node, Mode)
    until(lambda: publisher.matched)
    publisher.publish_raw(Mode().to_bytes()[:-8])
    until(lambda: modes.is_ready(0) or told.get("mode"))
    assert "cassie_msgs/msg/Mode has" in told["mode"]
    good = Mode()
    good.episode[...], good.effective_seq[...] = 1, 10
    publisher.publish(good)
    until(lambda: modes.is_ready(10))
    assert told["mode"] == ""


def test_an_operator_command_of_another_layout_is_told_until_a_good_one_comes(node):
    told = Told()
    states = LaneSubscription(node, RobotState)
    operator = OperatorSource(node, Stop(), states, told, scripted=False)
    publisher = LanePublisher(node, OperatorCommand)
    until(lambda: publisher.matched)
    publisher.publish_raw(OperatorCommand().to_bytes()[:-8])
    until(lambda: operator.at(RobotState()) or told.get("operator_command"))
    publisher.publish(OperatorCommand())
    until(lambda: operator.at(RobotState()) is not None)
    until(lambda: operator.at(RobotState()) is None or not told["operator_command"])


def test_a_supervisor_that_joins_a_walking_robot_names_no_refused_power(node):
    """It said "no power" until stand was asked for, while the robot walked on."""
    states = LaneSubscription(node, RobotState)
    operator = OperatorSource(node, Stop(), states, Told(), scripted=False)
    command, state = OperatorCommand(), RobotState()
    command.power[...] = command.link[...] = True
    command.mode[...], command.vx[...] = int(RobotMode.WALK), 0.5
    for power, words in ((1.0, ""), (0.0, "no power: power comes on only with stand"), (1.0, "")):
        state.power[...] = power
        operator.at(state)
        operator.operators.take(command, b"writer", time.monotonic())
        assert " ".join(operator.faults).startswith(words)
        assert bool(operator.faults) == bool(words)


class Logging:
    """In place of a node: keeps what is logged."""

    def __init__(self, said):
        self._said = said

    def get_logger(self):
        return self

    def fatal(self, text):
        self._said.append(text)


def ended_by(times):
    """Exit code of a node for 500 Hz and why it ended, by seq and time in ms of its samples."""
    said = []
    stop, state = Stop(), RobotState()
    check = RateCheck(Logging(said), stop, 500)
    for seq, ms in times:
        state.stamp_ns = round(1e6 * ms)
        check.check(1, seq, state)
    return stop.exit_code, " ".join(said)


@pytest.mark.parametrize(
    ("period", "words"), [(2.5, "come at 400 Hz"), (1.0, "come at 1000 Hz"), (0.0, "carry no time")]
)
@pytest.mark.parametrize("first", [0, 20, 100_000])
def test_samples_at_another_rate_end_the_node_with_a_reason(period, words, first):
    code, said = ended_by([(seq, period * seq) for seq in range(first, first + 8)])
    assert code == 2
    assert words in said


def test_a_rate_that_is_one_percent_off_shows_after_some_ticks():
    assert ended_by([(seq, 2.02 * seq) for seq in range(60)])[0] == 2


def test_every_tenth_sample_of_the_right_rate_is_enough():
    assert ended_by([(seq, 2.0 * seq) for seq in range(0, 1000, 10)]) == (0, "")


def test_samples_of_no_rate_do_not_end_the_node():
    rng = np.random.default_rng(3)
    seqs = np.cumsum(rng.integers(1, 1000, 200))
    assert ended_by(zip(map(int, seqs), rng.uniform(-2e6, 2e6, 200), strict=True)) == (0, "")
