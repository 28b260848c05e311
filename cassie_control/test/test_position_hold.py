"""Holding the place while stepping in place."""

from __future__ import annotations

import math

import pytest
from robot_states import leg_joints, readings_of, state_of

from cassie_control.config import WalkConfig
from cassie_control.planner.hold import PositionHold

CONFIG = WalkConfig(hold_gain=0.5, hold_distance=0.2)


def readings_at(x, y, yaw=0.0):
    state = state_of(leg_joints(), leg_joints())
    state.q[0], state.q[1], state.q[3] = x, y, yaw
    return readings_of(state)


def settled(x=1.0, y=2.0):
    hold = PositionHold(0.1)
    for _ in range(20):
        assert hold.velocity(CONFIG, readings_at(x, y)) == pytest.approx((0.0, 0.0), abs=1e-12)
    return hold


def test_it_leads_back_to_the_place_in_the_robots_own_axes():
    assert settled().velocity(CONFIG, readings_at(1.1, 2.0)) == pytest.approx((-0.05, 0.0))
    turned = readings_at(1.1, 2.0, yaw=0.5 * math.pi)
    assert settled().velocity(CONFIG, turned) == pytest.approx((0.0, 0.05))


def test_what_pushes_it_far_takes_the_place_along():
    hold = settled()
    assert hold.velocity(CONFIG, readings_at(1.3, 2.4)) == pytest.approx((-0.06, -0.08))
    assert hold.velocity(CONFIG, readings_at(1.18, 2.24)) == pytest.approx((0.0, 0.0), abs=1e-12)


def test_the_place_is_the_middle_of_the_sway():
    hold = PositionHold(0.02)
    for tick in range(59):
        sway = 0.04 * math.sin(2.0 * math.pi * 0.02 * tick / 0.8 + 0.3)
        assert hold.velocity(CONFIG, readings_at(1.0, 2.0 + sway)) == (0.0, 0.0)
    vx, vy = hold.velocity(CONFIG, readings_at(1.0, 2.0))
    assert math.hypot(vx, vy) < CONFIG.hold_gain * 0.003


def test_a_released_place_is_forgotten():
    hold = settled()
    hold.release()
    for _ in range(20):
        velocity = hold.velocity(CONFIG, readings_at(4.0, 6.0))
    assert velocity == pytest.approx((0.0, 0.0))


def test_without_a_gain_it_lets_the_robot_drift():
    config = WalkConfig(hold_gain=0.0)
    hold = PositionHold(0.1)
    for x in range(30):
        assert hold.velocity(config, readings_at(float(x), 0.0)) == (0.0, 0.0)
