"""The ground's slope as the feet find it, and walking along it."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest
from closed_loop import Robot
from robot_states import leg_joints, put_toe_joint, readings_of, state_of
from walkers import CONFIG

from cassie_control.planner.terrain import (
    GroundSlope,
    initialize_slope,
    step_up_height,
    update_at_touchdown,
    update_in_stance,
)
from cassie_gaits import virtual_leg
from cassie_msgs.experiment.scenario import Scenario
from cassie_msgs.layout import RobotMode

PERIOD = 0.002
LEFT, RIGHT = 0, 1


@functools.cache  # nobody writes it, and most steps show the same all the time
def standing_on(rise):
    """A left foot flat on ground that rises ahead, the torso pitched."""
    pitch = 0.07
    flat = virtual_leg.toe_angle(np.arctan(rise), pitch, 0.5)
    state = state_of(leg_joints(toe=flat), leg_joints(knee=-1.3), pitch=pitch, forces=(330.0, 0.0))
    return readings_of(state)


def walk_with(slope, *rises):
    """Steps of 0.3 s; what the stance foot shows in each, by phase. Yields `ahead`."""
    phases = np.arange(150) / 150
    known = {rise: [(p, standing_on(rise(p))) for p in phases] for rise in set(rises)}
    for rise in rises:
        for phase, readings in known[rise]:
            update_in_stance(slope.records, readings.records, LEFT, phase)
            yield slope.ahead


@pytest.mark.parametrize("rise", [-0.3, 0.0, 0.2])
def test_the_sole_of_the_stance_foot_gives_the_slope_ahead(rise):
    *_, ahead = walk_with(GroundSlope(CONFIG, PERIOD), *36 * [lambda phase: rise])
    assert ahead == pytest.approx(rise, abs=1e-3)


def test_a_foot_that_has_just_landed_or_carries_little_tells_nothing():
    slope, readings = GroundSlope(CONFIG, PERIOD), standing_on(0.2)
    update_in_stance(slope.records, readings.records, LEFT, 0.1)
    update_in_stance(slope.records, readings.records, RIGHT, 0.5)
    assert slope.ahead == 0.0


def test_no_slope_is_believed_beyond_its_bound():
    *_, ahead = walk_with(GroundSlope(CONFIG, PERIOD), *45 * [lambda phase: 3.0])
    assert ahead == pytest.approx(0.6, abs=1e-3)


@pytest.mark.parametrize("side", [-0.15, 0.1])
def test_the_heights_of_both_feet_give_the_slope_to_the_side(side):
    slope, readings = GroundSlope(CONFIG, PERIOD), readings_of(state_of(leg_joints(), leg_joints()))
    for leg in range(2):
        x, y, _ = readings.legs[leg].toe_joint
        put_toe_joint(readings, leg, (x, y, -0.8 + side * y))
    for step in range(60):
        update_at_touchdown(slope.records, readings.records, step % 2)
    assert slope.left == pytest.approx(side, abs=1e-3)


@pytest.mark.parametrize(("lifted", "left"), [(False, 0.2), (True, 0.0)])
def test_walking_begins_with_the_side_slope_on_which_both_feet_stand(lifted, left):
    """On one of 12 degrees four of 20 robots fell in their first steps: it was taken for level."""
    forces = (330.0, 0.0 if lifted else 330.0)
    readings = readings_of(state_of(leg_joints(), leg_joints(), forces=forces))
    for leg, y in ((LEFT, 0.15), (RIGHT, -0.15)):
        put_toe_joint(readings, leg, (0.0, y, -0.8 + 0.2 * y))
    slope = GroundSlope(CONFIG, PERIOD)
    initialize_slope(slope.records, readings.records)
    assert slope.left == pytest.approx(left, abs=0.03)


def test_risers_that_one_foot_always_climbs_are_no_slope_to_the_side():
    """The right foot goes up each riser, the left one follows onto its tread: it fell sideways."""
    slope, readings = GroundSlope(CONFIG, PERIOD), readings_of(state_of(leg_joints(), leg_joints()))
    for step in range(10):
        new = (RIGHT, LEFT)[step % 2]
        x, y, z = ((0.33, -0.25, 0.1), (-0.1, 0.35, 0.0))[step % 2]
        put_toe_joint(readings, 1 - new, (0.0, 0.0, -0.8))
        put_toe_joint(readings, new, (x, y, z - 0.8))
        update_at_touchdown(slope.records, readings.records, new)
        assert abs(slope.left) < 0.1


@pytest.mark.parametrize(("before", "higher"), [(0.0, 0.1), (-0.005, 0.1), (-0.2, 0.0)])
def test_a_foot_that_comes_back_up_from_a_step_down_has_not_stepped_up(before, higher):
    """Swung higher after that, robots fell that took a step of 20 cm down."""
    slope, readings = GroundSlope(CONFIG, PERIOD), readings_of(state_of(leg_joints(), leg_joints()))
    for new, height in ((LEFT, before), (RIGHT, 0.1)):
        slope.ahead = slope.left = 0.0
        put_toe_joint(readings, 1 - new, (0.0, 0.0, -0.8))
        put_toe_joint(readings, new, (0.0, 0.0, height - 0.8))
        update_at_touchdown(slope.records, readings.records, new)
    assert step_up_height(slope.records[0]) == pytest.approx(higher)


def test_footholds_that_tilt_either_way_do_not_look_like_a_rise():
    """A foot that expects the ground too high lands late, and the robot speeds up meanwhile."""
    footholds = [lambda phase: 0.15, lambda phase: -0.15]
    seen = list(walk_with(GroundSlope(CONFIG, PERIOD), *10 * footholds))
    assert max(seen) < 0.05
    assert -0.15 < np.mean(seen) < 0.0


def step_on(slope, shown, found):
    """A step on a sole that shows a slope; the next foot, 0.2 m ahead, finds another one."""
    for _ in walk_with(slope, lambda phase: shown):
        pass
    readings = readings_of(state_of(leg_joints(), leg_joints()))
    for leg, x, z in ((RIGHT, 0.1, -0.8 + 0.2 * found), (LEFT, -0.1, -0.8)):
        put_toe_joint(readings, leg, (x, 0.0, z))
    update_at_touchdown(slope.records, readings.records, RIGHT)


def test_soles_that_the_next_footholds_do_not_bear_out_count_for_little():
    """Tufts of grass tilt the feet by 0.1: taken for rises it ran away at 0.8 m/s."""
    ahead = []
    for borne_out in (0.0, 1.0):
        slope = GroundSlope(CONFIG, PERIOD)
        for tilt in [*10 * [-0.1, 0.1], *5 * [0.15]]:
            step_on(slope, tilt, borne_out * tilt)
        ahead.append(slope.ahead)
    tufts, rough = ahead
    assert rough > 0.05
    assert abs(tufts) < 0.1 * rough


def test_a_slope_that_the_next_footholds_bear_out_is_believed_in_full():
    slope = GroundSlope(CONFIG, PERIOD)
    for step in range(20):
        step_on(slope, (-0.1, 0.1)[step % 2], 0.0)
    for _ in range(45):
        step_on(slope, 0.3, 0.3)
    assert slope.ahead == pytest.approx(0.3, abs=0.02)


def ever_slower(phase):
    """What a foot shows whose heel sinks into sand, as measured: 0.15 to 0.5 rad."""
    return np.tan(0.55 - 0.4 * np.exp(-4.0 * phase))


@pytest.mark.parametrize("rise", [lambda phase: np.tan(0.36 * phase), ever_slower])
def test_a_foot_that_the_ground_gives_way_under_shows_no_slope(rise):
    """Heels that sink into sand turn the feet up by 30 degrees: taken for a rise it ran away."""
    assert max(map(abs, walk_with(GroundSlope(CONFIG, PERIOD), *10 * [rise]))) < 0.02


@pytest.mark.parametrize(("rise", "least", "most"), [(0.2, 0.0, 0.01), (-0.2, -0.201, -0.19)])
def test_a_rise_is_believed_no_longer_where_the_ground_gives_way(rise, least, most):
    """A fall is: a foot that lands early costs a little speed, one that lands late throws it."""
    slope = GroundSlope(CONFIG, PERIOD)
    *_, before = walk_with(slope, *25 * [lambda phase: rise])
    *_, after = walk_with(slope, *20 * [ever_slower])
    assert before == pytest.approx(rise, abs=0.01)
    assert least <= after <= most


def land(slope, readings, new, higher):
    """A foot lands 0.2 m ahead of the other one, and so much higher. In m."""
    for leg, x, z in ((new, 0.1, -0.8 + higher), (1 - new, -0.1, -0.8)):
        put_toe_joint(readings, leg, (x, readings.legs[leg].toe_joint[1], z))
    update_at_touchdown(slope.records, readings.records, new)


@pytest.mark.parametrize(("higher", "sunk"), [(0.04, 0.03), (0.008, 0.0), (-0.04, 0.0)])
def test_feet_that_always_land_higher_tell_how_far_the_other_one_sinks(higher, sunk):
    slope, readings = GroundSlope(CONFIG, PERIOD), readings_of(state_of(leg_joints(), leg_joints()))
    for step in range(40):
        land(slope, readings, step % 2, higher)
    assert slope.sinkage == pytest.approx(sunk, abs=5e-3)


def test_steps_up_and_down_on_uneven_ground_are_no_sinking():
    slope, readings = GroundSlope(CONFIG, PERIOD), readings_of(state_of(leg_joints(), leg_joints()))
    for step in range(40):
        land(slope, readings, step % 2, (0.06, 0.05, -0.03)[step % 3])
        assert slope.sinkage == 0.0


def test_it_can_be_switched_off():
    slope = GroundSlope(replace(CONFIG, slope_time=0.0), PERIOD)
    update_in_stance(slope.records, standing_on(0.2).records, LEFT, 0.5)
    assert slope.ahead == 0.0


def test_walks_down_a_slope_at_the_commanded_speed():
    """Without the slope in the law it runs away to more than 1 m/s and falls."""
    parameters = {"rise_deg": -12.0, "start": 0.5}
    scenario = Scenario(scene="slope", scene_parameters=parameters, start="standing")
    robot = Robot(scenario, record=True)
    robot.ask(height=0.98)
    robot.run(1.8)
    robot.ask(mode=int(RobotMode.WALK))
    robot.run(3.0)
    robot.ask(vx=0.3)
    robot.run(9.0)
    assert not robot.fallen
    position = robot.moments[-1].position
    assert position[0] > 1.5
    assert position[2] < 0.85
    last = [moment.velocity[0] for moment in robot.moments[-1000:]]
    assert np.mean(last) == pytest.approx(0.3, abs=0.06)


def test_a_foothold_higher_than_the_ground_around_it_is_not_the_ground():
    """On rough ground the hips rose and sank with every foothold, and it fell to the side."""
    slope, readings = GroundSlope(CONFIG, PERIOD), readings_of(state_of(leg_joints(), leg_joints()))
    land(slope, readings, RIGHT, 0.04)
    assert 0.015 < slope.foothold_height < 0.03
    land(slope, readings, LEFT, -0.04)
    assert abs(slope.foothold_height) < 0.015
    for step in range(20):
        land(slope, readings, step % 2, 0.0)
    assert slope.foothold_height == pytest.approx(0.0, abs=1e-3)


def test_ground_that_gives_way_alike_under_each_foot_is_no_foothold_of_its_own():
    slope, readings = GroundSlope(CONFIG, PERIOD), readings_of(state_of(leg_joints(), leg_joints()))
    for step in range(60):
        land(slope, readings, step % 2, 0.04)
    assert slope.foothold_height < 0.011
    assert slope.sinkage > 0.025


def test_stairs_go_down_though_each_sole_lies_level():
    """Soles on treads show no slope; the heights of the footholds do."""
    slope = GroundSlope(CONFIG, PERIOD)
    for _ in range(30):
        step_on(slope, 0.0, -0.3)
    assert slope.ahead < -0.05
