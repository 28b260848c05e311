"""The hip as the torso's set-points take it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from walkers import CONFIG

from cassie_control.control.drives import PITCH_AXIS, filter_hips
from cassie_control.control.gains import make_gains
from cassie_control.control.outputs import Step
from cassie_control.control.robot import Robot

PERIOD = 0.002
LEFT = 0
TORSO_PITCH, TORSO_RATE = 0.05, 0.1


def hips_of(angles, rates, config=CONFIG):
    """Left hip pitch and rate as the set-points take them, tick by tick. Shape (n, 2)."""
    robot, step = Robot(pitch=TORSO_PITCH, pitch_rate=TORSO_RATE), Step()
    gain, here, steps = (each.records[0] for each in (make_gains(config, PERIOD), robot, step))
    taken = []
    for angle, rate in zip(angles, rates, strict=True):
        robot.joints[LEFT, 2], robot.rates[LEFT, 2] = angle, rate
        filter_hips(gain, here, steps)
        taken.append((step.hip[LEFT, PITCH_AXIS], step.hip_rates[LEFT, PITCH_AXIS]))
    return np.array(taken)


def test_the_first_one_is_the_measured_hip():
    assert hips_of([0.4], [-1.0])[0] == pytest.approx([0.4, -1.0])


def test_a_steady_swing_is_followed_without_lag():
    times = PERIOD * np.arange(200)
    still = hips_of(0.4 - 0.8 * times, np.full(200, -0.8 + TORSO_RATE))
    assert still[-1] == pytest.approx([0.4 - 0.8 * times[-1], -0.8 + TORSO_RATE], abs=0.01)


def test_a_ringing_hip_is_followed_in_part_only():
    """The rest of it the drive damps by itself, however late its set-points come."""
    times, w = PERIOD * np.arange(500), 2.0 * np.pi * 42.0
    ring = 0.01 * np.sin(w * times), 0.01 * w * np.cos(w * times)
    taken = np.abs(hips_of(*ring)[250:]).max(axis=0) / (0.01, 0.01 * w)
    assert taken[0] == pytest.approx(1.0 - CONFIG.thigh_angle, abs=0.1)
    assert taken[1] == pytest.approx(1.0 - CONFIG.thigh_rate, abs=0.05)


def test_the_papers_law_takes_the_measured_hip():
    rng = np.random.default_rng(3)
    angles, rates = rng.normal(size=(2, 50))
    taken = hips_of(angles, rates, replace(CONFIG, law="paper"))
    assert taken == pytest.approx(np.stack([angles, rates], 1))
