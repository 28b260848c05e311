"""How late the drives act, as the controller finds it in the torques that they report."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from walkers import CONFIG

from cassie_control.control.gains import make_gains
from cassie_control.control.latency import CommandLatency
from cassie_msgs.layout import MotorCommand, RobotState


class Drives:
    """Ten drives that act late and report half a physics step after their 3 ms; joints swing.

    Args:
        late: From a command to its effect on what the drives run. In s.
        period: Of control. In s.
        swing: Of the joints. In rad.
        error: Of the torque constants.
        torque_delay: From the torque that a drive computes to its effect, beyond 3 ms. In s.
        ringing: Of the joints at 42 Hz, with the leg springs. In rad.
    """

    def __init__(self, late, period=0.002, swing=0.2, error=0.03, torque_delay=0.0, ringing=0.0):
        self.late, self.period, self.swing, self.error = late, period, swing, error
        self.torque_delay, self.ringing = torque_delay, ringing
        self.sent: list[MotorCommand] = []
        self.rng = np.random.default_rng(7)

    def angles(self, t):
        w, fast = 8.0 + np.arange(10.0), 2.0 * np.pi * 42.0
        angle = self.swing * np.sin(w * t) + self.ringing * np.sin(fast * t)
        return angle, self.swing * w * np.cos(w * t) + self.ringing * fast * np.cos(fast * t)

    def state(self, tick):
        state, now = RobotState(), tick * self.period
        state.seq[...], state.power[...] = tick, 1.0
        angle, rate = self.angles(now)
        joints = [0, 1, 2, 3, 6]
        state.q[6:].reshape(2, 7)[:, joints] = angle.reshape(2, 5)
        state.v[6:].reshape(2, 7)[:, joints] = rate.reshape(2, 5)
        set_at = now - 0.0035 - self.torque_delay
        command = int(np.floor((set_at - self.late) / self.period + 1e-9))
        if command >= 0:
            c, (angle, rate) = self.sent[command], self.angles(set_at)
            u = c.torque + c.kp * (c.position - angle) + c.kd * (c.velocity - rate)
            state.drive_torque[:] = (1.0 + self.error) * u + self.rng.normal(0.0, 0.5, 10)
        return state

    def send(self, tick):
        command = MotorCommand()
        angle, rate = self.angles(tick * self.period + 0.01)
        command.position[:], command.velocity[:] = angle, rate
        command.kp[:], command.kd[:], command.torque[:] = 300.0, 10.0, 20.0 * np.sign(rate)
        self.sent.append(command)
        return command


def run(latency, drives, ticks, first=0):
    for tick in range(first, first + ticks):
        latency.observe(drives.state(tick))
        latency.sent(drives.send(tick))


@pytest.mark.parametrize("late", [0.0, 0.01, 0.026, 0.04, 0.07])
@pytest.mark.parametrize("period", [0.002, 0.001])
def test_a_latency_is_found_to_a_tick(late, period):
    latency = CommandLatency(period)
    run(latency, Drives(late, period), round(1.0 / period))
    assert latency.latency == pytest.approx(late, abs=1.1 * period)


@pytest.mark.parametrize("late", [0.0, 0.016, 0.028])
@pytest.mark.parametrize("torque_delay", [0.002, 0.003])
@pytest.mark.parametrize("period", [0.004, 0.002, 0.0005])
def test_late_torques_are_told_from_late_set_points_as_springs_ring(late, torque_delay, period):
    """Each alone explains neither: the joints are those of before the torques' delay."""
    latency = CommandLatency(period)
    drives = Drives(late, period, torque_delay=torque_delay, ringing=0.01)
    run(latency, drives, round(1.5 / period))
    assert latency.torque_delay == pytest.approx(torque_delay, abs=0.0011)
    assert latency.latency == pytest.approx(late + torque_delay, abs=max(0.0011, 1.1 * period))


def test_torque_constants_and_noise_do_not_look_like_one():
    latency = CommandLatency(0.002)
    run(latency, Drives(0.0, error=0.1), 1000)
    assert latency.latency == latency.torque_delay == 0.0


def test_standing_still_tells_nothing_and_changes_nothing():
    latency, drives = CommandLatency(0.002), Drives(0.03, swing=0.0)
    run(latency, drives, 500)
    assert latency.latency == 0.0
    drives.swing = 0.2
    run(latency, drives, 500, first=500)
    assert latency.latency == pytest.approx(0.03)
    drives.swing = 0.0
    run(latency, drives, 500, first=1000)
    assert latency.latency == pytest.approx(0.03)


def test_drives_that_report_something_else_are_not_late():
    """Of a watchdog that damps, say: no command explains it."""
    latency, drives = CommandLatency(0.002), Drives(0.0)
    for tick in range(1000):
        state = drives.state(tick)
        state.drive_torque[:] = -4.0 * drives.angles(0.002 * tick)[1]
        latency.observe(state)
        latency.sent(drives.send(tick))
    assert latency.latency == 0.0


def test_states_that_are_missing_begin_a_new_record():
    latency, drives = CommandLatency(0.002), Drives(0.0)
    for tick in range(1000):
        command = drives.send(tick)
        if tick % 20:
            latency.observe(drives.state(tick))
            latency.sent(command)
    assert latency.latency == 0.0


def test_gains_go_over_with_the_latency_and_not_below_it():
    late = CONFIG.late
    usual = make_gains(CONFIG, 0.002)
    assert make_gains(CONFIG, 0.002, late.latency).records == usual.records
    half = make_gains(CONFIG, 0.002, late.latency + 0.5 * late.latency_span)
    assert half.thigh_rate == pytest.approx(0.5 * (CONFIG.thigh_rate + 1.0))
    assert half.latency == late.latency + 0.5 * late.latency_span
    whole = make_gains(CONFIG, 0.002, 0.05)
    assert whole.thigh_track == late.thigh_track
    assert whole.thigh_rate == 1.0


def test_late_torques_lower_the_gains_of_knees_and_pitch():
    """They feed the oscillation of the leg springs: 3 ms late, a quarter of a period in all."""
    usual, late = make_gains(CONFIG, 0.002), make_gains(CONFIG, 0.002, 0.003, 0.003)
    factor = 1.0 / (1.0 + 0.003 * CONFIG.late.softening)
    for name in ("kp", "kd"):
        ratio = getattr(late, name) / getattr(usual, name)
        assert ratio == pytest.approx([1.0, 1.0, factor, factor, 1.0])
        torso = f"{name}_torso_pitch"
        assert getattr(late, torso) == pytest.approx(factor * getattr(usual, torso))


def test_the_papers_law_stays_as_it_is():
    paper = replace(CONFIG, law="paper")
    assert make_gains(paper, 0.002, 0.05, 0.003).records == make_gains(paper, 0.002).records
