"""Where the pendulum lands, and when."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cassie_control.planner.pendulum import (
    FootholdLaw,
    PendulumState,
    Reach,
    contact_time,
    foothold,
    predict_com,
)

RATE = 3.5
LEFT_SWINGS = Reach(
    side=1.0,
    hip_x=0.0,
    hip_y=0.135,
    max_x=0.4,
    max_inward=0.2,
    max_outward=0.3,
    min_foot_distance=0.12,
    friction_cone=1.0,
)
IN_PLACE = FootholdLaw(
    ux=0.0, uy=0.13, vx=0.0, vy=0.23, gain_x=0.3, gain_y=0.35, loss_x=0.5, loss_y=0.2
)


def test_the_fall_is_that_of_an_inverted_pendulum():
    found = predict_com(PendulumState(0.05, -0.1, 0.4, 0.2, RATE, 0.0), 0.3)
    motion = solve_ivp(
        lambda _, s: [s[2], s[3], RATE**2 * s[0], RATE**2 * s[1]],
        (0.0, 0.3),
        (0.05, -0.1, 0.4, 0.2),
        rtol=1e-10,
        atol=1e-12,
    )
    assert found == pytest.approx(motion.y[:, -1], abs=1e-8)


def test_it_coasts_before_it_falls():
    coasting = predict_com(PendulumState(0.0, 0.0, 0.4, 0.2, RATE, 0.1), 0.1)
    assert coasting == pytest.approx((0.04, 0.02, 0.4, 0.2))


@pytest.mark.parametrize("seed", range(20))
def test_the_foot_stays_within_reach_and_apart(seed):
    rng = np.random.default_rng(seed)
    end = tuple(rng.uniform(-1.5, 1.5, 4) * (0.2, 0.2, 1.0, 1.0))
    ux, uy, missed = foothold(IN_PLACE, LEFT_SWINGS, end)
    assert abs(ux) <= 0.4 + 1e-12
    assert end[1] + uy >= 0.12 - 1e-9
    assert missed >= 0.0
    if missed == 0.0:
        gain = 0.35 / (1.0 + 0.2 * abs(end[2]))
        assert uy == pytest.approx(0.13 + gain * (end[3] - 0.23))


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_the_gains_are_those_of_the_map_at_the_velocity_of_the_touchdown(way):
    """Of both axes, fore and aft alike."""
    for vx in (0.0, 0.4, 0.8):
        ux, uy, _ = foothold(IN_PLACE, LEFT_SWINGS, (0.0, 0.1, way * vx, 0.33))
        assert ux == pytest.approx(way * vx * 0.3 / (1.0 + 0.5 * vx))
        assert uy == pytest.approx(0.13 + 0.1 * 0.35 / (1.0 + 0.2 * vx))


def test_a_step_that_can_be_made_keeps_its_time():
    fall = PendulumState(0.0, 0.14, 0.0, -0.25, RATE, 0.0)
    assert contact_time(fall, IN_PLACE, LEFT_SWINGS, 0.3, 0.15, 0.4) == 0.3


def test_a_fall_to_the_side_of_the_swing_leg_is_met_sooner():
    fall = PendulumState(0.0, 0.05, 0.0, 0.6, RATE, 0.0)
    time = contact_time(fall, IN_PLACE, LEFT_SWINGS, 0.3, 0.1, 0.4)
    assert 0.1 <= time < 0.3
    planned, chosen = (
        foothold(IN_PLACE, LEFT_SWINGS, predict_com(fall, t))[2] for t in (0.3, time)
    )
    assert chosen < planned


def test_a_fall_over_the_stance_foot_is_met_as_soon_as_can_be():
    fall = PendulumState(0.0, -0.02, 0.0, -0.6, RATE, 0.0)
    assert contact_time(fall, IN_PLACE, LEFT_SWINGS, 0.3, 0.1, 0.4) == pytest.approx(0.1, abs=1e-3)


@pytest.mark.parametrize("seed", range(20))
def test_no_other_contact_time_costs_less(seed):
    """Distance of the foot out of reach, squared, and that of the step's time with its weight."""
    rng = np.random.default_rng(seed)
    x, y, vx, vy = rng.uniform(-1.0, 1.0, 4) * (0.1, 0.15, 0.8, 0.8)
    fall = PendulumState(x, y, vx, vy, RATE, 0.0)

    def cost(time):
        missed = foothold(IN_PLACE, LEFT_SWINGS, predict_com(fall, time))[2]
        return missed**2 + 0.2 * (time - 0.3) ** 2

    chosen = contact_time(fall, IN_PLACE, LEFT_SWINGS, 0.3, 0.1, 0.4)
    best = min(np.linspace(0.1, 0.4, 301), key=cost)
    assert abs(chosen - best) < 2e-3 or cost(chosen) < cost(best) + 1e-5


def test_the_contact_time_moves_without_jumps():
    """It is asked for anew at every tick."""
    times = [
        contact_time(
            PendulumState(0.0, 0.05, 0.0, vy, RATE, 0.0), IN_PLACE, LEFT_SWINGS, 0.3, 0.1, 0.4
        )
        for vy in np.linspace(0.0, 0.8, 401)
    ]
    assert np.abs(np.diff(times)).max() < 0.01


def test_a_foot_outside_of_the_friction_cone_makes_the_step_quicker():
    """The sooner a foot lands to catch a fall, the nearer: that needs less friction."""
    fall = PendulumState(0.0, 0.05, 0.0, 0.3, RATE, 0.0)
    planned = contact_time(fall, IN_PLACE, LEFT_SWINGS, 0.3, 0.1, 0.4)
    narrow = LEFT_SWINGS._replace(friction_cone=0.15)
    sooner = contact_time(fall, IN_PLACE, narrow, 0.3, 0.1, 0.4)
    assert sooner < planned - 0.02
    nearer, farther = (
        foothold(IN_PLACE, narrow, predict_com(fall, t))[1] for t in (sooner, planned)
    )
    assert nearer < farther - 0.01
