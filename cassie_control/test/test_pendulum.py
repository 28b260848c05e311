"""Where the pendulum lands, and when."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cassie_control.planner.pendulum import Aim, Fall, Reach, fallen, foot, touchdown_time

RATE = 3.5
LEFT_SWINGS = Reach(1.0, 0.0, 0.135, 0.4, 0.2, 0.3, 0.12, 0.45, 0.5, 0.3, 0.3)
IN_PLACE = Aim(0.0, 0.13, 0.0, 0.23, 0.35, 0.35, 0.35, 0.0, 0.3)


def test_the_fall_is_that_of_an_inverted_pendulum():
    found = fallen(Fall(0.05, -0.1, 0.4, 0.2, RATE, 0.0), 0.3)
    motion = solve_ivp(
        lambda _, s: [s[2], s[3], RATE**2 * s[0], RATE**2 * s[1]],
        (0.0, 0.3),
        (0.05, -0.1, 0.4, 0.2),
        rtol=1e-10,
        atol=1e-12,
    )
    assert found == pytest.approx(motion.y[:, -1], abs=1e-8)


def test_it_coasts_before_it_falls():
    coasting = fallen(Fall(0.0, 0.0, 0.4, 0.2, RATE, 0.1), 0.1)
    assert coasting == pytest.approx((0.04, 0.02, 0.4, 0.2))


@pytest.mark.parametrize("seed", range(20))
def test_the_foot_stays_within_reach_and_apart(seed):
    rng = np.random.default_rng(seed)
    end = tuple(rng.uniform(-1.5, 1.5, 4) * (0.2, 0.2, 1.0, 1.0))
    ux, uy, missed = foot(IN_PLACE, LEFT_SWINGS, end)
    assert abs(ux) <= 0.4 + 1e-12
    assert end[1] + uy >= 0.12 - 1e-9
    slippery = LEFT_SWINGS._replace(slippery=0.2)
    assert end[1] + foot(IN_PLACE, slippery, end)[1] >= 0.12 - 1e-9
    assert missed >= 0.0
    if missed == 0.0:
        assert uy == pytest.approx(0.13 + 0.35 * (end[3] - 0.23))


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_push_is_caught_by_less_the_faster_it_makes_it(way):
    slow, fast = (
        way * foot(IN_PLACE, LEFT_SWINGS, (0.0, 0.1, way * v, 0.23))[0] for v in (0.4, 0.8)
    )
    assert slow == pytest.approx(0.35 * 0.4 * (1.0 - 0.3 * 0.4))
    assert fast == pytest.approx(0.35 * 0.8 * (1.0 - 0.3 * 0.8))


def test_walking_backward_steadily_takes_nothing_off_its_gain():
    steady = IN_PLACE._replace(vx=-0.5, speed=-0.5)
    ux = foot(steady, LEFT_SWINGS, (0.0, 0.1, -0.4, 0.23))[0]
    assert ux == pytest.approx(0.35 * 0.1)
    assert foot(steady, LEFT_SWINGS, (0.0, 0.1, -0.7, 0.23))[0] > -0.35 * 0.2


def test_of_the_way_that_the_ground_may_not_bear_a_foot_goes_a_share():
    slippery = LEFT_SWINGS._replace(slippery=0.2, far_share=0.3)
    end = (0.0, 0.1, 0.0, 0.23 + 0.3)
    free, held = (foot(IN_PLACE, reach, end)[1] for reach in (LEFT_SWINGS, slippery))
    assert free == pytest.approx(0.13 + 0.35 * 0.3)
    assert held == pytest.approx(0.2 + 0.3 * (free - 0.2))


def test_a_foot_is_not_held_back_so_far_that_the_speed_to_the_side_grows():
    slippery = LEFT_SWINGS._replace(slippery=0.2, far_share=0.0, far_most=0.04)
    for vy in (0.5, 0.6):
        free, held = (
            foot(IN_PLACE, reach, (0.0, 0.1, 0.0, vy))[1] for reach in (LEFT_SWINGS, slippery)
        )
        assert held == pytest.approx(max(0.2, free - 0.04))


def test_a_step_that_can_be_made_keeps_its_time():
    fall = Fall(0.0, 0.14, 0.0, -0.25, RATE, 0.0)
    assert touchdown_time(fall, IN_PLACE, LEFT_SWINGS, 0.3, 0.15, 0.4) == 0.3


def test_a_fall_to_the_side_of_the_swing_leg_is_met_sooner():
    fall = Fall(0.0, 0.05, 0.0, 0.6, RATE, 0.0)
    time = touchdown_time(fall, IN_PLACE, LEFT_SWINGS, 0.3, 0.1, 0.4)
    assert 0.1 <= time < 0.3
    planned, chosen = (foot(IN_PLACE, LEFT_SWINGS, fallen(fall, t))[2] for t in (0.3, time))
    assert chosen < planned


def test_a_fall_over_the_stance_foot_is_met_as_soon_as_can_be():
    fall = Fall(0.0, -0.02, 0.0, -0.6, RATE, 0.0)
    assert touchdown_time(fall, IN_PLACE, LEFT_SWINGS, 0.3, 0.1, 0.4) == pytest.approx(0.1)


def test_a_foot_that_would_land_far_out_lands_sooner_and_nearer():
    fall, near = Fall(0.0, 0.02, 0.0, 0.3, RATE, 0.0), LEFT_SWINGS._replace(easy=0.2)
    assert touchdown_time(fall, IN_PLACE, LEFT_SWINGS, 0.3, 0.1, 0.4) == 0.3
    time = touchdown_time(fall, IN_PLACE, near, 0.3, 0.1, 0.4)
    assert time < 0.27
    planned, chosen = (foot(IN_PLACE, near, fallen(fall, t))[1] for t in (0.3, time))
    assert chosen < planned - 0.01
