"""The way to a set-point with bounded rate and acceleration."""

from __future__ import annotations

import numpy as np
import pytest

from cassie_control.control.standing import approach

PERIOD = 0.002


def way(target, fastest=0.7, acceleration=6.0, braking=None, ticks=1000):
    """Values and rates from rest at 0."""
    value = rate = 0.0
    found = []
    for _ in range(ticks):
        value, rate = approach(value, rate, target, fastest, acceleration, PERIOD, braking)
        found.append((value, rate))
    return np.array(found).T


@pytest.mark.parametrize("braking", [None, 3.0, 6.0, 12.0])
@pytest.mark.parametrize("target", [0.02, 0.13, 0.6, -0.13])
def test_it_arrives_without_overshoot_within_its_bounds(target, braking):
    values, rates = way(target, braking=braking)
    assert values[-1] == pytest.approx(target, abs=1e-12)
    assert rates[-1] == 0.0
    assert (values * np.sign(target)).max() <= abs(target) * 1.001
    assert np.abs(rates).max() <= 0.7 + 1e-12
    speeds = np.diff(np.abs(rates)) / PERIOD
    assert speeds.max() <= 6.0 + 1e-9
    assert speeds[:-1].min() >= -2.0 * (braking or 6.0) - 1e-9


def test_gentler_braking_begins_sooner_and_takes_longer():
    hard, soft = way(0.13)[0], way(0.13, braking=3.0)[0]
    arrived = [int(np.argmax(values >= 0.13)) * PERIOD for values in (hard, soft)]
    assert arrived[0] < arrived[1] < 0.5
    assert soft[:20] == pytest.approx(hard[:20])
