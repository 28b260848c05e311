"""When a step ends, and the velocities that are averaged over steps."""

from __future__ import annotations

import pytest
from robot_states import leg_joints, readings_of, state_of

from cassie_control.config import WalkConfig
from cassie_control.planner.timing import LEFT, RIGHT, StepTiming, advance, end_step

CONFIG = WalkConfig()
PERIOD = 0.002


def timing(stance=LEFT):
    core = StepTiming(CONFIG, 0.4, PERIOD)
    core.start(stance)
    return core


def readings(swing_force, stance=LEFT, velocity=(0.0, 0.0)):
    forces = (300.0, swing_force) if stance == LEFT else (swing_force, 300.0)
    return readings_of(state_of(leg_joints(), leg_joints(), forces=forces, velocity=velocity))


def step_to_end(core, swing_force, stance=LEFT):
    seen = readings(swing_force, stance)
    for _ in range(1000):
        if advance(core.records, seen.records):
            return
    raise AssertionError("the step never ends")


@pytest.mark.parametrize("stance", [LEFT, RIGHT])
def test_a_loaded_swing_foot_ends_the_step_but_not_early(stance):
    core = timing(stance)
    step_to_end(core, CONFIG.touchdown_force + 1.0, stance)
    assert core.elapsed == pytest.approx(CONFIG.earliest_touchdown, abs=PERIOD)


def test_a_quick_step_ends_no_sooner():
    """A leg that is swung quickly bends its springs as if the foot were loaded."""
    core, seen = timing(LEFT), readings(CONFIG.touchdown_force + 1.0, LEFT)
    core.rate *= 2.0
    while not advance(core.records, seen.records):
        pass
    assert core.elapsed == pytest.approx(CONFIG.earliest_touchdown, abs=PERIOD)


def test_without_touchdown_a_step_ends_late():
    core = timing()
    step_to_end(core, CONFIG.touchdown_force - 1.0)
    assert core.phase == pytest.approx(CONFIG.latest_touchdown, abs=0.006)


def test_a_foot_that_is_thrown_up_has_not_touched_down_whatever_its_springs_feel():
    """One that came free of an edge sprang up at 3 m/s, and its step ended 0.2 m up in the air."""
    core, seen = timing(LEFT), readings(300.0)
    feet, height, speed = seen.records[0]["foot"], -0.05, 3.0
    core.phase, core.elapsed = 0.4, 0.16
    while speed > -3.0:  # its leg stops it within 20 ms and draws it down again
        feet[RIGHT, 2] = feet[LEFT, 2] + height
        assert not advance(core.records, seen.records)
        speed -= 150.0 * PERIOD * (core.phase > 0.6)
        height += speed * PERIOD
    assert any(advance(core.records, seen.records) for _ in range(50))


@pytest.mark.parametrize("height", [-0.17, 0.0, 0.17])
def test_a_foot_is_set_down_on_what_is_higher_or_lower(height):
    core, seen = timing(LEFT), readings(300.0)
    feet = seen.records[0]["foot"]
    feet[RIGHT, 2] = feet[LEFT, 2] + height
    assert any(advance(core.records, seen.records) for _ in range(200))
    assert core.elapsed == pytest.approx(CONFIG.earliest_touchdown, abs=PERIOD)


def test_load_on_the_stance_foot_ends_no_step():
    core = timing(RIGHT)
    step_to_end(core, 0.0, RIGHT)
    assert core.phase > 1.0


def test_the_legs_exchange_and_the_phase_begins_anew():
    core = timing(RIGHT)
    step_to_end(core, 300.0, RIGHT)
    end_step(core.records)
    assert (core.stance, core.steps, core.phase, core.elapsed) == (LEFT, 1, 0.0, 0.0)


def test_mean_velocity_is_that_of_the_last_two_steps():
    core, means = timing(), []
    for velocity in ((1.0, 0.0), (0.5, 0.2), (0.3, -0.2)):
        seen = readings(0.0, velocity=velocity)
        for _ in range(100):
            advance(core.records, seen.records)
        means.append(end_step(core.records))
    assert means[0] == pytest.approx((1.0, 0.0))
    assert means[1] == pytest.approx((0.75, 0.1))
    assert means[2] == pytest.approx((0.4, 0.0))


def test_low_passed_velocity_has_its_cut_off():
    core = timing()
    time_constant = 1.0 / (2.0 * 3.14159265 * CONFIG.speed_filter)
    seen = readings(0.0, velocity=(1.0, -1.0))
    for _ in range(round(time_constant / PERIOD)):
        advance(core.records, seen.records)
    assert core.velocity == pytest.approx((0.632, -0.632), abs=0.005)
