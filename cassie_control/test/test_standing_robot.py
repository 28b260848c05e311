"""A simulated Cassie stands: pushed, with late commands, from a crouch in the harness."""

from __future__ import annotations

import numpy as np
import pytest
from closed_loop import PERIOD, Robot

from cassie_control.config import ControllerConfig, TransitionConfig
from cassie_msgs.experiment.scenario import Draw, Scenario
from cassie_msgs.layout import RobotMode

LET_DOWN = {
    "start": "gantry",
    "gantry": [{"t": 0.2, "action": "lower", "height": 0.8, "speed": 0.5}],
}


def stood(height: float, duration: float, **scenario) -> Robot:
    """Stands for so long with faithful sensors; every tick is recorded."""
    robot = Robot(Scenario.from_mapping({"start": "standing", **scenario}), "faithful", record=True)
    robot.ask(height=height)
    robot.run(duration)
    return robot


@pytest.mark.parametrize("height", [0.45, 0.75])
@pytest.mark.parametrize("seed", [2, 104])
def test_a_crouch_neither_overshoots_nor_swings(height, seed):
    """Springs whose deflection was left to the integral let the pelvis sink by 4 to 6 cm more."""
    robot = stood(0.9, 5.0, draw=vars(Draw.from_seed(seed)), **LET_DOWN)
    before = len(robot.moments)
    robot.ask(height=height)
    robot.run(4.0)
    heights = np.array([m.position[2] for m in robot.moments[before:]])
    assert heights.min() > height - 0.012
    assert np.ptp(heights[round(1.5 / PERIOD) :]) < 0.012


def test_the_lowest_height_is_reached_without_a_bounce():
    """Brakes fed forward 60 ms late let the pelvis bounce by 2 cm on its lowest height."""
    robot = stood(1.01, 5.0, draw=vars(Draw.from_seed(101)), **LET_DOWN)
    robot.ask(height=0.39)
    robot.run(2.0)
    before = len(robot.moments)
    robot.run(2.0)
    heights = np.array([m.position[2] for m in robot.moments[before:]])
    assert np.abs(heights - 0.39).max() < 0.012


@pytest.mark.parametrize("force", [(100.0, 0.0, 0.0), (-90.0, 0.0, 0.0), (0.0, 180.0, 0.0)])
def test_pushes_are_stood_without_a_step(force):
    robot = stood(0.9, 7.0, pushes=[{"t": 4.0, "duration": 0.1, "force": force}])
    assert not robot.fallen
    assert {m.activity for m in robot.moments if m.time > 1.0} == {"standing"}
    assert abs(robot.moments[-1].velocity).max() < 0.05
    assert robot.moments[-1].position[2] == pytest.approx(0.9, abs=0.02)


@pytest.mark.parametrize("force", [(0.0, 180.0, 0.0), (0.0, -180.0, 0.0)])
def test_a_drawn_robot_stands_on_the_edge_of_one_foot(force):
    push = {"t": 5.0, "duration": 0.1, "force": force}
    robot = stood(0.9, 9.0, pushes=[push], draw=vars(Draw.from_seed(7)), **LET_DOWN)
    assert not robot.fallen
    assert {m.activity for m in robot.moments if m.time > 5.0} == {"standing"}
    assert abs(robot.moments[-1].velocity).max() < 0.05


@pytest.mark.parametrize(
    "force",
    [(-99.0, 99.0, 0.0), (99.0, -99.0, 0.0), (113.0, -113.0, 0.0), (110.0, 0.0, 0.0)],
)
def test_a_push_between_standing_and_stepping_is_no_fall(force):
    push = {"t": 5.0, "duration": 0.1, "force": force}
    robot = stood(0.9, 10.0, pushes=[push], draw=vars(Draw.from_seed(7)), **LET_DOWN)
    assert not robot.fallen


@pytest.mark.parametrize("seed", [5, 6, 102])
def test_a_step_from_straight_legs_keeps_a_foot_on_the_ground(seed):
    """Just beyond what it stands, a push forward makes it rise to straight legs before it steps."""
    push = {"t": 5.0, "duration": 0.1, "force": (110.0, 0.0, 0.0)}
    robot = stood(0.9, 9.0, pushes=[push], draw=vars(Draw.from_seed(seed)), **LET_DOWN)
    assert not robot.fallen
    walking = [m for m in robot.moments if m.activity == "walking"]
    in_air = [m.forces.max() < 1.0 for m in walking]
    assert len(walking) > 0
    assert sum(in_air) * PERIOD < 0.02


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("seed", [2, 7])
def test_let_down_with_one_foot_on_a_block_it_reaches_for_the_ground(side, seed):
    scene = {"scene": "block", "scene_parameters": {"height": 0.1, "side": side}}
    moves = [{"t": 0.5, "action": "lower", "height": 0.7, "speed": 0.3}]
    draw = vars(Draw.from_seed(seed))
    robot = stood(0.85, 5.0, start="gantry", gantry=moves, draw=draw, **scene)
    tilts = np.abs([m.angles[1:] for m in robot.moments if m.time > 1.0])
    assert not robot.fallen
    assert tilts.max() < 0.25
    assert tilts[-1].max() < 0.1


@pytest.mark.parametrize("force", [(200.0, 0.0, 0.0), (-145.0, -145.0, 0.0)])
def test_a_push_beyond_that_makes_it_step_and_stand_again(force):
    push = {"t": 2.0, "duration": 0.1, "force": force}
    robot = stood(0.9, 2.0, pushes=[push], draw=vars(Draw.from_seed(3)))
    told = set()
    for _ in range(80):
        robot.run(0.1)
        told.add(robot.supervisor.status.readiness)
    assert not robot.fallen
    activities = [m.activity for m in robot.moments if m.time > 2.0]
    assert "walking" in activities
    assert set(activities[-1000:]) == {"standing"}
    assert abs(robot.moments[-1].velocity).max() < 0.05
    assert "one foot off the ground: stepping until it rests" in told
    assert robot.supervisor.status.readiness == ""
    assert robot.mode is RobotMode.STAND


def test_without_the_recovery_step_such_a_push_is_a_fall():
    config = ControllerConfig(transition=TransitionConfig(recovery_step=False))
    push = {"t": 2.0, "duration": 0.1, "force": (200.0, 0.0, 0.0)}
    scenario = Scenario.from_mapping(
        {"start": "standing", "pushes": [push], "draw": vars(Draw.from_seed(3))}
    )
    robot = Robot(scenario, "faithful", config)
    robot.ask(height=0.9)
    robot.run(6.0)
    assert robot.fallen


@pytest.mark.parametrize("force", [(50.0, 0.0, 0.0), (-50.0, 0.0, 0.0), (0.0, 50.0, 0.0)])
def test_late_torques_and_set_points_do_not_shake_it(force):
    push = {"t": 4.0, "duration": 0.1, "force": force}
    robot = stood(0.9, 6.0, delays={"torque": 0.002, "set_point": 0.015}, pushes=[push])
    calm = [m.velocity for m in robot.moments if 3.0 < m.time < 4.0]
    assert not robot.fallen
    assert np.abs(calm).max() < 0.02


@pytest.mark.parametrize("force", [(70.0, 0.0, 0.0), (-60.0, 0.0, 0.0), (0.0, 80.0, 0.0)])
def test_late_commands_do_not_make_a_drawn_robot_ring(force):
    delays = {"torque": 0.002, "set_point": 0.015}
    push = {"t": 5.0, "duration": 0.1, "force": force}
    draw = vars(Draw.from_seed(7))
    robot = stood(0.9, 8.0, delays=delays, pushes=[push], draw=draw, **LET_DOWN)
    assert not robot.fallen
    assert abs(robot.moments[-1].velocity).max() < 0.02


def test_it_does_not_ring_where_commands_come_40_ms_late():
    push = {"t": 5.0, "duration": 0.1, "force": (30.0, 40.0, 0.0)}
    draw = vars(Draw.from_seed(9))
    robot = stood(0.9, 8.0, delays={"set_point": 0.04}, pushes=[push], draw=draw, **LET_DOWN)
    assert not robot.fallen
    assert abs(robot.moments[-1].velocity).max() < 0.02


def test_it_stands_up_from_a_crouch_in_the_harness():
    moves = [
        {"t": 0.1, "action": "hold", "height": 0.5, "speed": 1.0},
        {"t": 2.0, "action": "lower", "height": 0.4},
    ]
    robot = Robot(Scenario.from_mapping({"gantry": moves}), "faithful", record=True)
    robot.ask(power=False)
    robot.run(1.0)
    robot.ask(power=True, height=0.85)
    robot.run(5.0)
    assert not robot.fallen
    assert robot.moments[-1].position[2] == pytest.approx(0.85, abs=0.01)


@pytest.mark.parametrize(
    ("scene", "parameters"),
    [
        ("block", {"height": 0.1, "side": "right", "start": 3.0, "rate": 0.1}),
        ("tilting", {"rise_deg": 7.0, "side_deg": 7.0, "start": 3.0, "rate_deg": 5.0}),
    ],
)
def test_ground_that_moves_under_it_is_stood(scene, parameters):
    robot = stood(0.85, 6.5, scene=scene, scene_parameters=parameters)
    assert not robot.fallen
    assert {m.activity for m in robot.moments if m.time > 1.0} == {"standing"}
    late = [m.angles for m in robot.moments if m.time > 6.0]
    assert np.abs(np.array(late)[:, 1:]).max() < np.radians(5.0)


def test_random_commands_do_not_make_it_fall():
    """Every command the radio can make of standing, changing at random within seconds."""
    robot = stood(0.9, 2.0)
    draw = np.random.default_rng(5)
    for _ in range(10):
        robot.ask(
            height=draw.uniform(0.3, 1.1),
            com_x=draw.uniform(-0.1, 0.1),
            com_y=draw.uniform(-0.1, 0.1),
            roll=draw.uniform(-0.4, 0.4),
            pitch=draw.uniform(-0.4, 0.4),
        )
        robot.run(draw.uniform(0.2, 2.0))
        assert not robot.fallen
    assert {m.activity for m in robot.moments if m.time > 1.0} == {"standing"}


def test_knees_do_not_shake_while_the_commanded_height_comes_in_steps():
    """The command moves by 8 mm each 20 ms: its acceleration, fed forward, shook them by 35 Nm."""
    robot = stood(0.9, 2.0)
    robot.ask(height=0.6)
    robot.run(0.3)
    torques = []
    for _ in range(250):
        robot.run(PERIOD)
        torques.append(float(robot.state.drive_torque[3]))
    assert np.abs(np.diff(torques)).max() < 8.0
